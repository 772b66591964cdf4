"""When machine code that Numba keeps is out of date: as soon as any source that it was made of has changed.

Numba itself asks the file of a function alone, not those of the functions and constants that are built into it; machine code
that cuts a block up as another version of a structure does would read and write the wrong numbers.
"""

from __future__ import annotations

import hashlib
import re
import sys
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator

_OURS = "aerial_"  # how the names of our packages begin
_IMPORT = re.compile(r"^(?:from (\S+) import|import (\S+)) ?(\([^)]*\)|.*)", re.MULTILINE)
_NAME = re.compile(r"\w+")


def sources(module: str) -> set[str]:
    """Return the module and all of ours that it imports, those imported by these included."""
    found, open_ = set(), [module]
    while open_:
        name = open_.pop()
        if name not in found:
            found.add(name)
            open_ += _imported(name)
    return found


@cache
def _imported(module: str) -> tuple[str, ...]:
    """Return our modules that the top level of a module imports; all of them are loaded before what it compiles."""
    names = set()
    for package, alone, rest in _IMPORT.findall(_text(module).decode()):
        names |= {package or alone, *(f"{package}.{name}" for name in _NAME.findall(rest))}
    return tuple(sorted(name for name in names if name.startswith(_OURS) and name in sys.modules))


@cache
def _text(module: str) -> bytes:
    return Path(str(sys.modules[module].__file__)).read_bytes()


class _MadeOfSources:
    """A locator of Numba's for which machine code is made of all sources that its function imports."""

    def __init__(self, py_func: FunctionType, py_file: str) -> None:
        super().__init__(py_func, py_file)  # type: ignore[call-arg]  # the other base's
        self._module = py_func.__module__

    def get_source_stamp(self) -> Any:
        """Return what changes with the sources."""
        stamp = hashlib.sha256(str(super().get_source_stamp()).encode())  # type: ignore[misc]  # the other base's
        for name in sorted(sources(self._module)) if self._module in sys.modules else ():
            stamp.update(hashlib.sha256(_text(name)).digest())
        return stamp.digest()


class WhereToldTo(_MadeOfSources, UserProvidedCacheLocator):
    """Below ``NUMBA_CACHE_DIR``."""


class BesideSources(_MadeOfSources, InTreeCacheLocator):
    """In ``__pycache__``."""


class InHome(_MadeOfSources, UserWideCacheLocator):
    """In the user's folder for such things: where sources cannot be written to."""


LOCATORS = ",".join(f"{__name__}.{locator.__name__}" for locator in (WhereToldTo, BesideSources, InHome))
