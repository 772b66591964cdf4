"""The loop closed in one process: runs, their judgement, campaigns of many."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_evaluation.campaign.campaign import Campaign
    from aerial_evaluation.closed_loop import run
    from aerial_evaluation.judgement.landing import Landing, judge
    from aerial_evaluation.record import Run
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "campaign.campaign": ["Campaign"],
            "closed_loop": ["run"],
            "judgement.landing": ["Landing", "judge"],
            "record": ["Run"],
        },
    )

__all__ = [
    "Campaign",
    "Landing",
    "Run",
    "judge",
    "run",
]
