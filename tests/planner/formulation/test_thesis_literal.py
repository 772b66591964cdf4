"""The reduced formulation against the thesis's own, variable by variable."""

import numpy as np
import pytest

from aerial_model.values.request import MotionRequest
from aerial_planner.formulation.kino_dynamic import KinoDynamic
from aerial_planner.formulation.limits import Variant
from aerial_planner.formulation.srbm import SingleRigidBody
from aerial_planner.formulation.thesis_literal import LiteralProblem
from aerial_planner.kinematics.base_frame import base_frame_model
from aerial_planner.kinematics.inverse_kinematics import InverseKinematics
from aerial_planner.motion.motion import load_motion
from aerial_planner.motion.schedule import contact_schedule
from aerial_planner.motion.start import Start
from aerial_planner.ocp.options import SolverOptions
from aerial_planner.reference.body import body_reference
from aerial_planner.settings import PlannerSettings

from ..conftest import jump

VIOLATION = 1e-4  # SI units
COST = 1e-3  # relative


@pytest.fixture(
    scope="module",
    params=[
        (jump(0.4, 0.0), Variant.AAKD_STAR),
        (MotionRequest(motion="spin"), Variant.AAKD),
        (jump(0.0, 0.2), Variant.KD),
    ],
    ids=["forward jump AAKD*", "spin AAKD", "left jump KD"],
)
def both(request, robot):
    wanted, variant = request.param
    settings, model = PlannerSettings(), base_frame_model(robot)
    ik = InverseKinematics(robot, model)
    schedule = contact_schedule(wanted, load_motion(wanted.motion, robot), robot, settings.dt, settings.flight_knots)
    reference = body_reference(schedule, Start.standing(robot), robot, model, ik, settings)
    guess, _ = SingleRigidBody(robot, model, ik, settings, SolverOptions()).solve(schedule, reference)
    stage = KinoDynamic(robot, model, settings, variant, SolverOptions())
    reduced = stage.solve(schedule, reference, guess)
    literal_problem = LiteralProblem(robot, model, settings, variant, schedule, reference, guess)
    return stage, schedule, reference, guess, reduced, literal_problem, literal_problem.solve()


def test_from_the_same_start_both_reach_the_same_cost(both):
    *_, (_, reduced), _, literal = both
    assert literal.converged
    assert reduced.cost == pytest.approx(literal.cost, rel=COST)


def test_both_reach_the_same_trajectory(both):
    *_, (reduced, _), _, literal = both
    np.testing.assert_allclose(reduced.com, literal.trajectory.com, atol=1e-3)
    np.testing.assert_allclose(reduced.joint_position, literal.trajectory.joint_position, atol=1e-2)


def test_the_reduced_solution_satisfies_the_literal_constraints(both):
    *_, (reduced, _), problem, _ = both
    assert problem.violation(reduced) < VIOLATION


def test_the_literal_solution_satisfies_the_reduced_constraints(both):
    stage, schedule, reference, guess, *_, literal = both
    assert stage.violation(schedule, reference, literal.trajectory, guess) < VIOLATION
