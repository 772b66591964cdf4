"""Which goals a benchmark draws, and how it finds the reach."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from aerial_evaluation.bench.goals import SHARE, Family, draw, families, find_reach
from aerial_evaluation.bench.subject import motions_of, usual_request
from aerial_model.errors import RefusalError
from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.motion.motion import known_motions, motions_folder

REACH = np.array([[-0.5, -1.0], [1.5, 1.0]])  # backward and forward ends along two axes


@pytest.fixture(scope="module")
def robot():
    return Robot.load("mini_cheetah")


def test_the_same_seed_draws_the_same_goals():
    np.testing.assert_array_equal(draw(REACH, 50, 3), draw(REACH, 50, 3))
    assert not np.array_equal(draw(REACH, 50, 3), draw(REACH, 50, 4))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_there_are_as_many_goals_as_asked_for(d, seed):
    assert draw(np.vstack([-np.ones(d), np.ones(d)]), 50, seed).shape == (50, d)


def test_goals_lie_within_the_share_of_the_reach_to_each_side():
    goals = draw(REACH, 200, 0)
    ends = np.where(goals < 0, -REACH[0], REACH[1])
    assert np.all(np.linalg.norm(goals / ends, axis=1) <= SHARE + 1e-12)


def test_goals_spread_over_all_of_it():
    goals = draw(REACH, 200, 0)
    for quadrant in ([1, 1], [1, -1], [-1, 1], [-1, -1]):
        assert np.mean(np.all(goals * quadrant > 0, axis=1)) > 0.15


class Planning:
    """Plans what lies no farther than 0.6 m ahead and 0.3 m behind."""

    def plan(self, request):
        if not -0.3 <= request.displacement[0] <= 0.6:
            refusal = RefusalError("out_of_reach", "too far")
            refusal.report = SimpleNamespace(refusal={"reason": "too far"})
            raise refusal
        report = SimpleNamespace(peak_torque_ratio=0.5, peak_voltage_ratio=0.5, peak_speed_ratio=0.5)
        return SimpleNamespace(report=report)


def test_the_reach_is_found_to_either_side():
    def ahead(goal):
        return MotionRequest(motion="jump", displacement=np.array([goal[0], 0.0, 0.0]))

    family = Family(name="jump", axes=("x",), bound=np.array([1.6]), request=ahead)
    np.testing.assert_allclose(find_reach(family, Planning()), [[-0.3], [0.6]], atol=1.6 / 2**5)


@pytest.mark.parametrize("motion", ["jump", "spin", "barrel_roll", "front_flip", "back_flip"])
def test_the_families_of_a_motion_ask_for_what_it_lets_set(robot, motion):
    for family in families(robot, motion):
        request = family.request(0.5 * family.bound)
        assert request.motion == motion
        assert np.any(request.displacement)


def test_a_roll_to_the_other_side_lands_on_the_other_side(robot):
    to_one, to_other = (family.request(np.zeros(2)) for family in families(robot, "barrel_roll"))
    assert to_one.rotation == -to_other.rotation
    np.testing.assert_allclose(to_one.displacement, to_other.displacement * [1, -1, 1])


def test_platforms_are_as_high_as_the_goal(robot):
    onto = next(family for family in families(robot, "jump") if family.axes == ("z",))
    for height in (0.2, -0.2):
        request = onto.request(np.array([height]))
        assert request.terrain.height(request.displacement[:2]) == pytest.approx(height)


def test_motions_come_from_their_files_those_that_turn_least_first(robot):
    motions = motions_of(robot)
    assert {"jump", "spin", "barrel_roll", "front_flip", "back_flip"} <= set(motions)
    assert motions.index("jump") < motions.index("spin") < motions.index("barrel_roll")


def test_motions_of_contacts_that_a_robot_does_not_have_are_none_of_its(robot, tmp_path):
    folder = tmp_path / "robot"
    (folder / "motions").mkdir(parents=True)
    own = (motions_folder() / "jump.yaml").read_text().replace("contacts: all", "contacts: [toe]")
    (folder / "motions" / "tiptoe.yaml").write_text(own)
    assert "tiptoe" in known_motions(dataclasses.replace(robot, folders=(folder,)))
    assert "tiptoe" not in motions_of(dataclasses.replace(robot, folders=(folder,)))


def test_a_motion_that_would_stay_goes_forward(robot):
    assert usual_request("jump", robot).displacement[0] > 0
    assert not np.any(usual_request("spin", robot).displacement)
