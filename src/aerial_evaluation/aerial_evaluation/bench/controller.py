"""The controller's benchmark, section by section."""

from __future__ import annotations

from collections.abc import Callable

from aerial_evaluation.bench.arms import arms
from aerial_evaluation.bench.qp_solvers import solvers
from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject
from aerial_evaluation.bench.ticks import ticks
from aerial_evaluation.bench.tsid_peer import tsid

SECTIONS: dict[str, Callable[[Subject], list[Row]]] = {
    "ticks": ticks,
    "solvers": solvers,
    "arms": arms,
    "tsid": tsid,
}
MOTIONS = ("jump", "back_flip")  # unless others are asked for
