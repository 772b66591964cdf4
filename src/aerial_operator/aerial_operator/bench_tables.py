"""The rows of a benchmark as tables for a person."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aerial_operator.console import percent, table

Row = Mapping[str, Any]


@dataclass(frozen=True)
class _Table:
    """A section's title and columns: header → cell of a row."""

    title: str
    columns: Mapping[str, Callable[[Row], str]]


def tables(rows: Sequence[Row]) -> str:
    """Return one table per section that has rows."""
    texts = []
    for name, layout in _TABLES.items():
        lines = [[cell(row) for cell in layout.columns.values()] for row in rows if row["section"] == name]
        if lines:
            texts.append(f"{layout.title}\n\n{table(list(layout.columns), lines)}")
    return "\n\n".join(texts)


def _seconds(name: str, which: str = "p50") -> Callable[[Row], str]:
    return lambda row: "–" if row[name] is None else f"{row[name][which]:.3f} s"


def _solved(row: Row) -> str:
    return f"{row['solved']}/{row['trials']}"


def _accepted(row: Row) -> str:
    return f"{row['accepted']}/{row['trials']}"


def _variant(row: Row) -> str:
    return row["variant"] + ("+WS" if row["warm_start"] else "")


def _iterations(row: Row) -> str:
    return "–" if row["iterations"] is None else f"{row['iterations']['p50']:.0f}"


_TABLES = {
    "variants": _Table(
        "Variants (thesis, table 4.1): request to plan; peaks by exact inverse dynamics",
        {
            "motion": lambda row: row["motion"],
            "variant": _variant,
            "solved": _solved,
            "within limits": _accepted,
            "median": _seconds("total_time_s"),
            "95 %": _seconds("total_time_s", "p95"),
            "CPU": _seconds("cpu_time_s"),
            "iterations": _iterations,
            "peak torque": lambda row: percent(row["peak_torque_ratio"]),
            "peak voltage": lambda row: percent(row["peak_voltage_ratio"]),
        },
    ),
}
