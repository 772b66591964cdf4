"""What a command says: its report on standard output, as text or as one JSON object, all else on standard error."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import Any, TextIO

from aerial_model.errors import AerialError


class UsageError(AerialError):
    """The command line contradicts itself."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """How a command ended."""

    success: bool  # the thing asked for happened
    figures: dict[str, Any]  # the JSON object
    text: str  # the same for a person


def say(sentence: str) -> None:
    """Tell a person how things go."""
    print(f"aerial: {sentence}", file=sys.stderr, flush=True)


class ProgressBar:
    """How far a long command is: one line that changes, or, where lines cannot change, one at every tenth.

    Args:
        total: number of steps.
    """

    _WIDTH = 30

    def __init__(self, total: int) -> None:
        self._total = total
        self._said = 0

    def show(self, done: int, remark: str = "") -> None:
        """Say that ``done`` steps are done."""
        tenth = 10 * done // self._total
        if sys.stderr.isatty():
            filled = self._WIDTH * done // self._total
            end = "\n" if done == self._total else ""
            bar = "█" * filled + "·" * (self._WIDTH - filled)
            print(f"\raerial: {bar} {done} of {self._total}, {remark} ", end=end, file=sys.stderr, flush=True)
        elif tenth > self._said:
            self._said = tenth
            say(f"{done} of {self._total}, {remark}")


@contextmanager
def reserved_output() -> Iterator[TextIO]:
    """Yield standard output; meanwhile whatever else writes there, libraries included, writes to standard error."""
    sys.stdout.flush()
    saved = os.dup(1)
    os.dup2(2, 1)
    try:
        with os.fdopen(os.dup(saved), "w", encoding="utf-8") as output, redirect_stdout(sys.stderr):
            yield output
    finally:
        sys.stdout.flush()
        os.dup2(saved, 1)
        os.close(saved)


def to_json(figures: Mapping[str, Any]) -> str:
    """Return figures as JSON; what is no finite number becomes null, as JSON knows no other."""
    return json.dumps(_plain(figures), indent=2, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def pairs(rows: Iterable[tuple[str, str]]) -> str:
    """Return names and values as two aligned columns."""
    rows = list(rows)
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"  {name:<{width}}  {value}" for name, value in rows)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table with aligned columns, a header and a line under it."""
    lines = [list(header), *(list(row) for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    text = [
        "  " + "  ".join(f"{cell:<{width}}" for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]
    return "\n".join([text[0], "  " + "  ".join("-" * width for width in widths), *text[1:]])


def percent(ratio: float | None) -> str:
    """Return a ratio for a table."""
    return "–" if ratio is None else f"{100 * ratio:.0f} %"
