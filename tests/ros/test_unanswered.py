"""The plan that waits for a controller's answer, between the planning thread and the node's own."""

import threading
from types import SimpleNamespace

from aerial_msgs.msg import MotionResult
from aerial_planner.ros.unanswered import UnansweredPlan

PATIENCE = 10.0  # [s]
BLOCKED = 0.2  # for which a thread that waits for a lock is given the chance not to [s]


def answer(request_id, outcome=MotionResult.STARTED):
    return MotionResult(request_id=request_id, outcome=outcome)


def test_a_plan_is_kept_until_it_is_answered_or_its_time_is_over():
    waiting, plan = UnansweredPlan(), SimpleNamespace(request_id="a")
    assert waiting.at(0.0) is None
    waiting.put(plan, until=8.0)
    waiting.answered(answer("another"))
    waiting.answered(answer("a", MotionResult.PLANNED))  # the planner's own
    assert waiting.at(7.9) is plan
    assert waiting.at(8.0) is None
    waiting.answered(answer("a"))
    assert waiting.at(0.0) is None


def test_an_answer_to_the_last_plan_never_forgets_the_next_one():
    """The next plan is put while the answer is being compared with the last: the moment at which it could be lost."""
    waiting, is_put = UnansweredPlan(), threading.Event()
    following = SimpleNamespace(request_id="second")

    def put():
        waiting.put(following, until=8.0)
        is_put.set()

    planning = threading.Thread(target=put)

    class Last:
        @property
        def request_id(self):
            planning.start()
            is_put.wait(BLOCKED)
            return "first"

    waiting.put(Last(), until=8.0)
    waiting.answered(answer("first"))
    planning.join(PATIENCE)
    assert waiting.at(0.0) is following
