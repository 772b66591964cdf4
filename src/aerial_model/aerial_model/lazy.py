"""Packages that re-export names without importing anything until one is asked for (PEP 562).

A command loads the modules it needs and no others, though its package offers the names of all of them.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence


def reexport(
    package: str, modules: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package.

    Args:
        package: its name.
        modules: module below the package, dotted → the names it defines that the package re-exports.
    """
    origin = {name: f"{package}.{module}" for module, names in modules.items() for name in names}

    def __getattr__(name: str) -> object:  # noqa: N807
        if name not in origin:
            raise AttributeError(f"module '{package}' has no attribute '{name}'; it has {', '.join(sorted(origin))}")
        value = getattr(importlib.import_module(origin[name]), name)
        setattr(sys.modules[package], name, value)  # asked for once
        return value

    def __dir__() -> list[str]:  # noqa: N807
        return sorted({*vars(sys.modules[package]), *origin})

    return __getattr__, __dir__
