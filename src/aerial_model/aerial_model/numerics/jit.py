"""What runs in every tick is compiled by Numba: in numpy the same formulas take four times as long.

The machine code is cached beside the sources (or where ``NUMBA_CACHE_DIR`` says): only the first start on a machine, or
after sources have changed, compiles, for about a minute. A tick must never do so: whoever owns compiled functions runs them
before they are used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import config, njit

from aerial_model.numerics.code_cache import LOCATORS

F = TypeVar("F", bound=Callable[..., Any])


def _compiled(**options: Any) -> Callable[[F], F]:
    """Return a decorator that has a function compiled when it is first called; to a type checker it stays the function."""
    decorate = njit(cache=True, error_model="numpy", **options)

    def decorated(function: F) -> F:
        usual, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, LOCATORS
        try:
            return decorate(function)
        finally:
            config.CACHE_LOCATOR_CLASSES = usual

    return decorated


compiled = _compiled()
reordered = _compiled(fastmath={"contract", "nnan", "nsz", "reassoc"})  # sums in any order: several at once
