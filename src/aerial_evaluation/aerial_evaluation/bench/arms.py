"""What arms do that no goal asks for: how far they move and how much of the angular momentum they carry, phase by phase."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from aerial_evaluation import figures
from aerial_evaluation.bench.samples import Row
from aerial_evaluation.bench.subject import Subject, usual_request
from aerial_evaluation.closed_loop import run
from aerial_evaluation.judgement.landing import judge
from aerial_evaluation.record import Run
from aerial_model.kinematics import Kinematics
from aerial_model.robot.robot import BASE_TWIST, JOINT_POSITION, JOINT_VELOCITY

LANDING = 0.6  # after touchdown that counts as the landing [s]
PARTS = {"base": "#8a8a8a", "legs": "#1f6f8b", "arms": "#c44e33"}
_AXES = ("x", "y", "z")
_SIZE, _RESOLUTION = (6.4, 5.2), 200  # [in], [1/in]


@dataclass(frozen=True, kw_only=True)
class _Course:
    """What arms did, and what they were to do, from the plan's beginning on."""

    time: np.ndarray  # (K,) since the plan began [s]
    phase: np.ndarray  # (K,) 0: take-off, 1: flight, 2: landing
    position: np.ndarray  # (K, n_a) of the arms' joints [rad]
    planned: np.ndarray  # (K, n_a) the same in the plan, its end held [rad]
    momentum: dict[str, np.ndarray]  # part → what its motion contributes to α, (K, 3) along the start heading [kg·m²/s]


def arms(subject: Subject) -> list[Row]:
    """Run each motion once in closed loop; return a row for each of its phases, and draw a figure.

    ``travel_deg`` is the sum of what the arms' joints turn by, there and back, the mean over joints. ``share`` is that of
    the arms in the angular momenta about the centre of mass that base, legs and arms contribute, ∫ |α_i| dt over their sum.

    Raises:
        ConfigurationError: if a figure cannot be written.
    """
    robot = subject.robot
    if len(robot.planned.arms) == 0:
        subject.progress(f"arms: {robot.name} has none that plans move")
        return []
    rows = []
    for motion in subject.motions:
        subject.progress(f"arms in {motion}")
        record = run(robot, usual_request(motion, robot), seed=subject.seed, planner=subject.planner)
        landed, course = judge(record).landed, _course(record)
        file = subject.folder / f"arms_{motion}.png"
        _draw(course, record, file)
        for phase, name in enumerate(("take-off", "flight", "landing")):
            rows.append(
                {
                    "motion": motion,
                    "phase": name,
                    "landed": landed,
                    **_figures(course, phase),
                    "file": str(file),
                }
            )
    return rows


def _course(record: Run) -> _Course:
    robot, plan = record.robot, record.plan
    kinematics = Kinematics(robot)
    moving = robot.planned_joints[robot.planned.arms]
    legs = np.setdiff1d(np.arange(robot.n_joints), robot.arms)
    rest = np.setdiff1d(robot.arms, moving)  # held joints go with the base
    columns = {
        "base": np.concatenate([np.arange(BASE_TWIST.stop), JOINT_VELOCITY.start + rest]),
        "legs": JOINT_VELOCITY.start + legs,
        "arms": JOINT_VELOCITY.start + moving,
    }
    begin, end = record.start_time, record.start_time + plan.landing_time + LANDING
    truths = [tick.truth for tick in record.ticks if begin <= tick.truth.time < end]
    time = np.array([truth.time for truth in truths]) - begin
    R = record.start_frame.R_SW
    momentum: dict[str, list[np.ndarray]] = {part: [] for part in columns}
    for truth in truths:
        A = kinematics.at(truth.q, truth.v).A_G
        for part, of in columns.items():
            momentum[part].append(R @ A[:3, of] @ truth.v[of])
    planned = [plan.sample(t).q[JOINT_POSITION][moving] for t in np.minimum(time, plan.landing_time)]
    return _Course(
        time=time,
        phase=np.digitize(time, [plan.take_off_time, plan.landing_time]),
        position=np.array([truth.q[JOINT_POSITION][moving] for truth in truths]),
        planned=np.array(planned),
        momentum={part: np.array(values) for part, values in momentum.items()},
    )


def _figures(course: _Course, phase: int) -> Row:
    here = course.phase == phase
    sizes = {part: float(np.linalg.norm(alpha[here], axis=1).mean()) for part, alpha in course.momentum.items()}
    position = course.position[here]
    return {
        "travel_deg": float(np.rad2deg(np.abs(np.diff(position, axis=0)).sum(axis=0).mean())),
        "off_plan_deg": float(np.rad2deg(np.abs(position - course.planned[here]).max())) if phase < 2 else None,
        "momentum": sizes,
        "share": sizes["arms"] / sum(sizes.values()),
    }


def _draw(course: _Course, record: Run, file: Path) -> None:
    """Draw the arms' angles, and the angular momenta about the axis where most of it is, into a PNG file."""
    plan, robot = record.plan, record.robot
    axis = int(np.argmax(np.sum([np.abs(alpha).sum(axis=0) for alpha in course.momentum.values()], axis=0)))
    figure = Figure(figsize=_SIZE, layout="constrained")
    angles, momenta = figure.subplots(2, 1, sharex=True)
    names = np.array(robot.planned.joint_names)[robot.planned.arms]
    for column, name in enumerate(names):
        (line,) = angles.plot(course.time, np.rad2deg(course.position[:, column]), linewidth=1.0, label=name)
        before = course.phase < 2
        angles.plot(
            course.time[before], np.rad2deg(course.planned[before, column]), ":", linewidth=1.0, color=line.get_color()
        )
    for part, colour in PARTS.items():
        momenta.plot(course.time, course.momentum[part][:, axis], color=colour, linewidth=1.0, label=part)
    momenta.plot(
        course.time, np.sum(list(course.momentum.values()), axis=0)[:, axis], color="black", linewidth=1.4, label="all"
    )
    for axes in (angles, momenta):
        for time in (plan.take_off_time, plan.landing_time):
            axes.axvline(time, color="0.8", linewidth=0.8, zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize="small")
        axes.legend(frameon=False, fontsize="x-small", ncols=2)
    angles.set_ylabel("arm joints,\nplanned dotted [°]")
    momenta.set_ylabel(f"angular momentum\nabout {_AXES[axis]} [kg·m²/s]")
    momenta.set_xlabel("time [s]; lines: lift-off, touchdown")
    figures.save(figure, file, _RESOLUTION)
