"""What plans ask of the actuators beyond their limits, by exact inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from aerial_evaluation.bench.samples import Row, Sample

FAR = 1.2  # times a limit: the greatest excess the thesis shows for AAKD*


@dataclass(frozen=True, kw_only=True)
class Beyond:
    """How much of some plans lies beyond the actuators' limits."""

    samples: int  # joints times intervals
    beyond: float  # share of them
    far_beyond: float  # share of them that is beyond by more than ``FAR``
    worst_torque_ratio: float
    worst_voltage_ratio: float
    worst_speed_ratio: float


def violations(samples: Sequence[Sample]) -> dict[str, Beyond | None]:
    """Return how much of the solved plans lies beyond the actuators' limits, ``take_off`` and ``flight`` apart.

    Counted is every joint at every interval of a plan; ``beyond`` and ``far_beyond`` are shares of them.
    """
    uses = [(s.result.plan, s.result.actuator_use) for s in samples if s.result is not None]
    parts: dict[str, list[np.ndarray]] = {"take_off": [], "flight": []}
    for plan, use in uses:
        ratios = np.stack([use.torque_ratio, use.voltage_ratio, use.speed_ratio])  # (3, K-1, n)
        in_take_off = plan.time[1:] <= plan.take_off_time + 1e-9  # rounding of the time
        parts["take_off"].append(ratios[:, in_take_off].reshape(3, -1))
        parts["flight"].append(ratios[:, ~in_take_off].reshape(3, -1))
    return {name: _beyond(np.hstack(ratios)) if ratios else None for name, ratios in parts.items()}


def violations_to_json(samples: Sequence[Sample]) -> Row:
    """Return the figures of ``violations`` as plain JSON types."""
    return {name: None if part is None else asdict(part) for name, part in violations(samples).items()}


def _beyond(ratios: np.ndarray) -> Beyond:
    """Return the figures of torque, voltage and speed over their limits ``(3, n)``."""
    worst = ratios.max(axis=0)
    torque, voltage, speed = ratios.max(axis=1).tolist()
    return Beyond(
        samples=ratios.shape[1],
        beyond=float(np.mean(worst > 1)),
        far_beyond=float(np.mean(worst > FAR)),
        worst_torque_ratio=torque,
        worst_voltage_ratio=voltage,
        worst_speed_ratio=speed,
    )
