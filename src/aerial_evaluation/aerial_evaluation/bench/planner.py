"""The planner's benchmark, section by section."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from aerial_evaluation.bench.crocoddyl_peer import crocoddyl
from aerial_evaluation.bench.goals import goals
from aerial_evaluation.bench.literal import literal
from aerial_evaluation.bench.memory import memory
from aerial_evaluation.bench.profiles import profiles
from aerial_evaluation.bench.reach import reach
from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.scaling import knots, robots
from aerial_evaluation.bench.stored import library
from aerial_evaluation.bench.subject import Subject
from aerial_evaluation.bench.timing import timing
from aerial_evaluation.bench.variants import variants

SECTIONS: dict[str, Callable[[Subject], list[Row]]] = {
    "variants": variants,
    "literal": literal,
    "crocoddyl": crocoddyl,
    "knots": knots,
    "robots": robots,
    "goals": goals,
    "reach": reach,
    "library": library,
    "timing": timing,
    "memory": memory,
    "profiles": profiles,
}


def measured(
    subject: Subject, names: Sequence[str], sections: Mapping[str, Callable[[Subject], list[Row]]] = SECTIONS
) -> Iterator[Row]:
    """Yield the rows of the sections asked for, in the order of ``sections``; each names its section and robot."""
    for name, section in sections.items():
        if name in names:
            for row in section(subject):
                yield {"section": name, "robot": subject.robot.name, **row}
