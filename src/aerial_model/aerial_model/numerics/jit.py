"""What runs in every tick is compiled by Numba: in numpy the same formulas take four times as long.

The machine code is cached beside the sources (or where ``NUMBA_CACHE_DIR`` says): only the first start on a machine, or
after sources have changed, compiles, for about a minute. A tick must never do so: whoever owns compiled functions runs them
before they are used.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from numba import config, njit
from numba.core.dispatcher import Dispatcher

from aerial_model.numerics.code_cache import LOCATORS


def _compiled(**options: Any) -> Callable[[FunctionType], Dispatcher]:
    decorate = njit(cache=True, error_model="numpy", **options)

    def decorated(function: FunctionType) -> Dispatcher:
        usual, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, LOCATORS
        try:
            return decorate(function)
        finally:
            config.CACHE_LOCATOR_CLASSES = usual

    return decorated


compiled = _compiled()
reordered = _compiled(fastmath={"contract", "nnan", "nsz", "reassoc"})  # sums in any order: several at once
