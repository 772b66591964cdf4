"""From a plan and measurements to joint torques, 500 times a second."""

from typing import TYPE_CHECKING

from aerial_model.lazy import reexport

if TYPE_CHECKING:
    from aerial_wbic.controller import Controller, ControllerStatus
    from aerial_wbic.gains import ControllerGains
    from aerial_wbic.trace import TickTrace
else:
    __getattr__, __dir__ = reexport(
        __name__,
        {
            "controller": ["Controller", "ControllerStatus"],
            "gains": ["ControllerGains"],
            "trace": ["TickTrace"],
        },
    )

__all__ = [
    "Controller",
    "ControllerGains",
    "ControllerStatus",
    "TickTrace",
]
