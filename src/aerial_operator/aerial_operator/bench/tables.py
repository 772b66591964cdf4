"""The rows of a benchmark as tables for a person."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aerial_operator.console import percent, table
from aerial_wbic.stopwatch import Part

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


def _spread(times: Mapping[str, float] | None, which: str) -> str:
    return "–" if times is None else f"{times[which]:.3f} s"


def _seconds(name: str, which: str = "p50") -> Callable[[Row], str]:
    return lambda row: _spread(row[name], which)


def _count(name: str, of: str = "trials") -> Callable[[Row], str]:
    return lambda row: f"{row[name]}/{row[of]}"


def _ratio(name: str) -> Callable[[Row], str]:
    return lambda row: percent(row[name])


def _beyond(part: str, name: str, digits: int = 0) -> Callable[[Row], str]:
    return lambda row: "–" if row[part] is None else f"{100 * row[part][name]:.{digits}f} %"


def _variant(row: Row) -> str:
    return row["variant"] + ("+WS" if row["warm_start"] else "")


def _iterations(row: Row) -> str:
    return "–" if row["iterations"] is None else f"{row['iterations']['p50']:.0f}"


def _reach(row: Row) -> str:
    ends = row["reach"] or {}
    return ", ".join(f"{axis} {low:.2f}…{high:.2f}" for axis, (low, high) in ends.items())


def _micros(of: str, which: str, part: str | None = None) -> Callable[[Row], str]:
    return lambda row: f"{(row[of] if part is None else row[of][part])[which]:.0f} µs"


def _momentum(part: str) -> Callable[[Row], str]:
    return lambda row: f"{row['momentum'][part]:.2f} kg·m²/s"


def _motion(row: Row) -> str:
    return row["motion"]


_TIMES = {"median": _seconds("total_time_s"), "95 %": _seconds("total_time_s", "p95"), "CPU": _seconds("cpu_time_s")}
_COUNTS = {"solved": _count("solved"), "within limits": _count("accepted")}

_TABLES = {
    "ticks": _Table(
        "Ticks of the controller: CPU time, whole and by part (medians)",
        {
            "motion": _motion,
            "tasks": lambda row: row["tasks"],
            "solver": lambda row: row["qp_solver"],
            "median": _micros("tick_us", "p50"),
            "99 %": _micros("tick_us", "p99"),
            "largest": _micros("tick_us", "max"),
            **{part: _micros("parts_us", "p50", part) for part in Part},
        },
    ),
    "solvers": _Table(
        "Solvers of the quadratic program, on the same problems of ticks with contact: CPU time from numbers to forces",
        {
            "motion": _motion,
            "solver": lambda row: row["qp_solver"],
            "problems": lambda row: str(row["problems"]),
            "solved": _count("solved"),
            "median": _micros("time_us", "p50"),
            "99 %": _micros("time_us", "p99"),
            "largest": _micros("time_us", "max"),
            "forces differ by": lambda row: f"{row['greatest_difference_n']:.2f} N",
        },
    ),
    "arms": _Table(
        "What arms do that no goal asks for (closed loop, one run each)",
        {
            "motion": _motion,
            "phase": lambda row: row["phase"],
            "travel of a joint": lambda row: f"{row['travel_deg']:.0f}°",
            "off the plan by": lambda row: "–" if row["off_plan_deg"] is None else f"{row['off_plan_deg']:.0f}°",
            **{part: _momentum(part) for part in ("base", "legs", "arms")},
            "arms' share": _ratio("share"),
            "landed": lambda row: "yes" if row["landed"] else "no",
        },
    ),
    "tsid": _Table(
        "TSID on the same ticks with every point on the ground: CPU time",
        {
            "motion": _motion,
            "solver here": lambda row: row["qp_solver"],
            "ticks": lambda row: str(row["ticks"]),
            "whole tick": _micros("tick_us", "p50"),
            "after the estimate": _micros("after_estimate_us", "p50"),
            "TSID": _micros("peer_us", "p50"),
            "TSID, 99 %": _micros("peer_us", "p99"),
            "TSID over ours": lambda row: f"{row['speed_ratio']:.2f}",
        },
    ),
    "variants": _Table(
        "Variants (thesis, table 4.1): request to plan; peaks by exact inverse dynamics",
        {
            "motion": _motion,
            "variant": _variant,
            **_COUNTS,
            **_TIMES,
            "iterations": _iterations,
            "peak torque": _ratio("peak_torque_ratio"),
            "peak voltage": _ratio("peak_voltage_ratio"),
        },
    ),
    "literal": _Table(
        "The thesis's own formulation and solver (IPOPT/MUMPS), AAKD*+WS, its solve alone, next to request to plan here",
        {
            "motion": _motion,
            "converged": _count("converged"),
            "construction": _seconds("construction_time_s"),
            "its solve": _seconds("solve_time_s"),
            "its iterations": _iterations,
            "here": lambda row: _spread(row["reduced"]["total_time_s"], "p50"),
            "times faster": lambda row: "–" if row["speed_ratio"] is None else f"{row['speed_ratio']:.1f}",
        },
    ),
    "crocoddyl": _Table(
        "crocoddyl's FDDP on the same jump, its solve alone, next to request to plan here; what its solution is worth",
        {
            "motion": _motion,
            "knots": lambda row: f"{row['knots']} + {row['flight_knots']}",
            "converged": _count("converged"),
            "its solve": _seconds("solve_time_s"),
            "its CPU": _seconds("cpu_time_s"),
            "its iterations": _iterations,
            "here": lambda row: _spread(row["reduced"]["total_time_s"], "p50"),
            "CPU here": lambda row: _spread(row["reduced"]["cpu_time_s"], "p50"),
            "its CPU of ours": lambda row: "–" if row["speed_ratio"] is None else f"{row['speed_ratio']:.2f}",
            "off the goal": lambda row: f"{100 * row['landing_error_m']:.1f} cm, {row['landing_tilt_deg']:.1f}°",
            "torque": _ratio("peak_torque_ratio"),
            "voltage": _ratio("peak_voltage_ratio"),
        },
    ),
    "knots": _Table(
        "Take-off knots, the duration kept: AAKD*+WS",
        {
            "motion": _motion,
            "knots": lambda row: str(row["knots"]),
            "dt": lambda row: f"{1000 * row['dt_s']:.2f} ms",
            **_COUNTS,
            **_TIMES,
            "iterations": _iterations,
        },
    ),
    "robots": _Table(
        "Robots: AAKD*+WS",
        {
            "robot": lambda row: row["robot"],
            "joints": lambda row: str(row["joints"]),
            "motion": _motion,
            **_COUNTS,
            **_TIMES,
            "iterations": _iterations,
            "unsuited": lambda row: row["unsuited"] or "",
        },
    ),
    "goals": _Table(
        "Goals inside 80 % of the reach, with warm start; share of joint samples beyond a limit by exact inverse dynamics",
        {
            "goals": lambda row: row["family"],
            "variant": lambda row: row["variant"],
            **_COUNTS,
            **_TIMES,
            "take-off beyond": _beyond("take_off", "beyond", 1),
            "by 20 %": _beyond("take_off", "far_beyond", 2),
            "worst torque": _beyond("take_off", "worst_torque_ratio"),
            "voltage": _beyond("take_off", "worst_voltage_ratio"),
            "flight beyond": _beyond("flight", "beyond", 2),
            "flown": lambda row: f"{row['verified']}/{row['accepted']}",
            "reach [m, turns]": _reach,
        },
    ),
    "reach": _Table(
        "Reach of the jump: by direction on flat ground, then onto a platform ahead; what binds just beyond",
        {
            "direction": lambda row: f"{row['direction_deg']:.0f}°",
            "distance": lambda row: f"{row['distance_m']:.2f} m",
            "height": lambda row: f"{row['height_m']:.2f} m",
            "what binds": lambda row: row["binds"].rpartition("what binds: ")[2],
        },
    ),
    "library": _Table(
        "Starts of AAKD*: the bare reference, a single rigid body, the nearest of a few stored plans",
        {
            "goals": lambda row: row["family"],
            "start": lambda row: row["start"],
            "stored": lambda row: str(row["stored"]) if row["start"] == "library" else "",
            "near": lambda row: _count("found")(row) if row["start"] == "library" else "",
            **_COUNTS,
            **_TIMES,
            "iterations": _iterations,
        },
    ),
    "timing": _Table(
        "Phase durations fixed or optimized: AAKD*+WS; cost, take-off time and peaks are medians of goals both solve",
        {
            "goals": lambda row: row["family"],
            "durations": lambda row: "optimized" if row["optimize_timing"] else "fixed",
            **_COUNTS,
            **_TIMES,
            "iterations": _iterations,
            "cost": lambda row: "–" if row["cost"] is None else f"{row['cost']['p50']:.2f}",
            "take-off": _seconds("take_off_time_s"),
            "torque": lambda row: percent(None if row["torque_ratio"] is None else row["torque_ratio"]["p50"]),
            "voltage": lambda row: percent(None if row["voltage_ratio"] is None else row["voltage_ratio"]["p50"]),
            "reach [m, turns]": _reach,
        },
    ),
    "memory": _Table(
        "Memory of a planner that serves varied requests, those it refuses included",
        {
            "requests": lambda row: str(row["requests"]),
            "planned": lambda row: str(row["planned"]),
            "memory": lambda row: f"{row['memory_mb']:.0f} MB",
        },
    ),
}
