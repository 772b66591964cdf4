"""The interfaces as generated: what code on both sides of a process border relies on."""

import array

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from aerial_model.errors import RefusalCode
from aerial_msgs.action import PlanMotion
from aerial_msgs.msg import ControllerStatus, GroundTruth, MotionPlan, MotionResult, MotionSelection, TerrainBox
from aerial_msgs.srv import Disturb, Reset, Step


def constants(message):
    """Names and values of a message's constants."""
    return {name: getattr(message, name) for name in dir(type(message)) if name.isupper() and name[0] != "_"}


def test_every_refusal_code_is_a_constant_and_every_constant_has_its_code():
    outcomes = {"PLANNED", "REFUSED", "STARTED", "LANDED", "FAILED", "ABORTED"}
    assert set(constants(MotionResult)) == outcomes | {"NONE"} | {code.name for code in RefusalCode}


def test_phases_are_distinct():
    phases = constants(ControllerStatus)
    assert set(phases) == {"LIE", "STAND", "TAKE_OFF", "FLIGHT", "LANDING", "STOPPED"}
    assert len(set(phases.values())) == len(phases)


def test_no_error_is_the_default_code():
    assert MotionResult().code == MotionResult.NONE
    assert PlanMotion.Result().code == MotionResult.NONE


def test_a_plan_survives_the_wire():
    plan = MotionPlan(
        motion="jump",
        time=array.array("d", [0.0, 0.1]),
        contact=[True, False],
        joint_names=["hip"],
        terrain=[TerrainBox(size=[0.9, 0.9, 0.16])],
    )
    assert deserialize_message(serialize_message(plan), MotionPlan) == plan


def test_the_action_plans_a_selection():
    goal = PlanMotion.Goal(selection=MotionSelection(motion="jump", displacement=[0.4, 0.0, 0.0]))
    assert isinstance(goal.selection, MotionSelection)
    assert isinstance(PlanMotion.Result().plan, MotionPlan)
    assert set(PlanMotion.Feedback.get_fields_and_field_types()) == {"stage", "iteration", "residual"}


@pytest.mark.parametrize("service", [Reset, Step, Disturb])
def test_a_service_says_whether_and_why_not(service):
    assert {"success", "message"} <= set(service.Response.get_fields_and_field_types())


def test_ground_truth_holds_a_standard_odometry():
    assert GroundTruth.get_fields_and_field_types()["odometry"] == "nav_msgs/Odometry"
