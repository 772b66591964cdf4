"""The thesis's own formulation, solved by its own solver, next to ours on the same problem in the same run."""

from __future__ import annotations

from aerial_evaluation.bench.samples import Row, measure, percentiles, summary
from aerial_evaluation.bench.subject import Subject, usual_request, usual_schedule
from aerial_evaluation.statistics import Distribution
from aerial_planner.formulation.limits import Variant
from aerial_planner.formulation.srbm import SingleRigidBody
from aerial_planner.formulation.thesis_literal import LiteralProblem, LiteralSolution
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.start import Start
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.reference.body import body_reference

REPEATS = 3  # at most: it is slow


def literal(subject: Subject) -> list[Row]:
    """Return one row per motion: AAKD* from the single-rigid-body optimum, thesis-literal with IPOPT/MUMPS, and ours.

    ``speed_ratio`` is the literal solve alone over all that a user waits for ours, checks included.
    """
    rows = []
    for motion in subject.motions:
        request = usual_request(motion, subject.robot)
        subject.planner.warm_up(request)
        measure(subject.planner, request)
        theirs, ours = [], []
        repeats = min(REPEATS, subject.repeats)
        for repeat in range(repeats):
            subject.progress(f"thesis-literal {motion}: {repeat + 1} of {repeats}")
            theirs.append(_solve(subject, motion))
            ours.append(measure(subject.planner, request))
        solve = Distribution.of(solution.solve_time for solution in theirs if solution.converged)
        reduced = summary(ours)
        ratio = None if solve is None or reduced.total_time is None else solve.p50 / reduced.total_time.p50
        rows.append({"motion": motion, **_figures(theirs), "reduced": reduced.to_json(), "speed_ratio": ratio})
    return rows


def _figures(solutions: list[LiteralSolution]) -> Row:
    converged = [solution for solution in solutions if solution.converged]
    return {
        "trials": len(solutions),
        "converged": len(converged),
        "construction_time_s": percentiles(solution.construction_time for solution in solutions),
        "solve_time_s": percentiles(solution.solve_time for solution in converged),
        "unconverged_time_s": percentiles(s.solve_time for s in solutions if not s.converged),
        "iterations": percentiles(solution.iterations for solution in solutions),
    }


def _solve(subject: Subject, motion: str) -> LiteralSolution:
    """Return the literal solution of the motion's usual request, built anew as the thesis's is."""
    robot, settings = subject.robot.planned, subject.planner.settings
    model = base_frame_model(robot)
    ik = InverseKinematics(robot, model)
    schedule = usual_schedule(motion, robot, settings)
    reference = body_reference(schedule, Start.standing(robot), robot, model, ik, settings)
    guess, _ = SingleRigidBody(robot, model, ik, settings, SolverOptions()).solve(schedule, reference)
    return LiteralProblem(robot, model, settings, Variant.AAKD_STAR, schedule, reference, guess).solve()
