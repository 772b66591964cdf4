"""Plans a jump with and without optimized timing and a roll, and prints which functions Numba compiled meanwhile."""

from __future__ import annotations

import sys

from numba.core.dispatcher import Dispatcher

from aerial_model.robot.robot import Robot
from aerial_model.values.request import MotionRequest
from aerial_planner.planner import Planner


def versions() -> dict[str, int]:
    """Return how many versions of each compiled function of ours there are."""
    modules = [module for name, module in sys.modules.items() if name.startswith("aerial_")]
    functions = {f for module in modules for f in vars(module).values() if isinstance(f, Dispatcher)}
    return {f"{f.__module__}.{f.__name__}": len(f.signatures) for f in functions}


def main() -> None:
    """Warm up, as the planner's node does, and plan."""
    planner = Planner(Robot.load("mini_cheetah"))
    requests = [
        MotionRequest(motion="jump", yaw=0.1),
        MotionRequest(motion="jump", yaw=0.1, optimize_timing=True),
        MotionRequest(motion="barrel_roll"),
    ]
    planner.warm_up(requests[0])
    before = versions()
    for request in requests:
        planner.plan(request)
    after = versions()
    print("compiled for a plan:", ", ".join(name for name in after if after[name] != before[name]) or "nothing")


if __name__ == "__main__":
    main()
