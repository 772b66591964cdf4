"""Torques and voltages over the take-off, KD against AAKD*, as the thesis's figure 4-4 shows them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerial_evaluation import figures
from aerial_evaluation.bench.samples import Row, Sample, measure
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_evaluation.bench.violations import violations_to_json
from aerial_model.robot.robot import Robot
from aerial_model.values.plan import Plan
from aerial_planner.formulation.limits import Variant
from aerial_planner.report import PlanningResult

COLOURS = {Variant.KD: "#c44e33", Variant.AAKD_STAR: "#1f6f8b"}  # apart in grey and for the colour-blind too
_WIDTH, _MARGIN, _HEIGHT = 2.1, 0.4, 3.8  # of one kind of joint, beside the first, and of the figure [in]
_BEYOND = 1.35  # times a limit: how far axes reach at least
_RESOLUTION = 250  # [1/in]


def profiles(subject: Subject) -> list[Row]:
    """Draw one figure per motion, and return what each of the two variants asks for, one row each."""
    rows = []
    for motion in subject.motions:
        subject.progress(f"profiles of {motion}")
        requests = {variant: usual_request(motion, subject.robot, variant) for variant in COLOURS}
        samples: dict[Variant, Sample] = {}
        for variant, request in requests.items():
            subject.planner.warm_up(request)
            samples[variant] = measure(subject.planner, request)
        solved = {variant: sample.result for variant, sample in samples.items() if sample.result is not None}
        file = subject.folder / f"profiles_{motion}.png"
        draw(solved, subject.robot, file)
        rows += [
            {
                "motion": motion,
                "variant": variant.value,
                "solved": sample.solved,
                **violations_to_json([sample]),
                "file": str(file),
            }
            for variant, sample in samples.items()
        ]
    return rows


def draw(results: Mapping[Variant, PlanningResult], robot: Robot, file: Path) -> None:
    """Draw exact torques and voltages of the take-off into a PNG file: a column per kind of joint, a line per leg.

    Raises:
        ConfigurationError: if the file cannot be written.
    """
    kinds = _joint_kinds(robot)
    figure = Figure(figsize=(_WIDTH * len(kinds) + _MARGIN, _HEIGHT), layout="constrained")
    axes = figure.subplots(2, len(kinds), sharex=True, squeeze=False)
    for column, (kind, joints) in enumerate(kinds.items()):
        torque, voltage = axes[:, column]
        torque.set_title(kind, fontsize="medium")
        for variant, result in results.items():
            _lines(torque, voltage, variant, result, joints, robot)
        _frame(torque, robot.actuators.torque_max[joints].max())
        _frame(voltage, robot.actuators.bus_voltage[joints].max())
        voltage.set_xlabel("time [s]")
    for result in results.values():
        _phases(axes, result.plan)
    axes[0, 0].set_ylabel("torque [N·m]")
    axes[1, 0].set_ylabel("voltage [V]")
    figure.align_ylabels()
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(handles), frameon=False, fontsize="small")
    figures.save(figure, file, _RESOLUTION)


def _joint_kinds(robot: Robot) -> dict[str, list[int]]:
    """Return the joints of each kind: those whose names differ in the limb before the first underscore only."""
    kinds: dict[str, list[int]] = {}
    for joint, name in enumerate(robot.joint_names):
        limb, _, kind = name.partition("_")
        kinds.setdefault(kind or limb, []).append(joint)
    return kinds


def _lines(
    torque: Axes, voltage: Axes, variant: Variant, result: PlanningResult, joints: list[int], robot: Robot
) -> None:
    plan, use = result.plan, result.actuator_use
    middle = 0.5 * (plan.time[:-1] + plan.time[1:])
    shown = middle < plan.take_off_time
    values = (use.torque, robot.actuators.voltage(use.torque, use.speed))
    for axes, value in zip((torque, voltage), values, strict=True):
        for i, joint in enumerate(joints):
            label = variant.value if i == 0 else None
            axes.plot(middle[shown], value[shown, joint], color=COLOURS[variant], linewidth=1.0, label=label)


def _frame(axes: Axes, limit: float) -> None:
    """Draw the limits, grey beyond them."""
    reach = max(_BEYOND * limit, *np.abs(axes.get_ylim()))
    for sign in (-1, 1):
        axes.axhline(sign * limit, color="black", linewidth=0.8, label="limit" if sign > 0 else None)
        axes.axhspan(sign * limit, sign * reach, color="0.93", linewidth=0.0, zorder=0)
    axes.axhline(0.0, color="0.85", linewidth=0.6, zorder=0)
    axes.set_ylim(-reach, reach)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize="small")


def _phases(axes: np.ndarray, plan: Plan) -> None:
    """Mark when a contact ends, and end the axes with the take-off."""
    changes = np.flatnonzero(np.any(np.diff(plan.contact.astype(int), axis=0), axis=1)) + 1
    for one in axes.ravel():
        one.set_xlim(0.0, plan.take_off_time)
        for time in plan.time[changes]:
            one.axvline(time, color="0.6", linewidth=0.6, linestyle=":", zorder=0)
