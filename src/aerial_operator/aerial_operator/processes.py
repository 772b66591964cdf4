"""Planner, controller and simulator as processes of ours: started as ``ros2 run`` would, watched, and ended."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from aerial_model.errors import ConfigurationError, RefusalCode, RefusalError

REALTIME_PRIORITY = 40  # of the control loop, where the system permits it: below the kernel's own threads
END_TIMEOUT = 5.0  # between the request to end and the end by force [s]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")  # of numerical libraries, one each: cores are for the loop


@dataclass(frozen=True, kw_only=True)
class NodeProgram:
    """One of the three nodes."""

    name: str  # of the node
    package: str
    executable: str
    without: str  # what it means for the others when it is gone

    @property
    def path(self) -> Path:
        """Path of the executable.

        Raises:
            ConfigurationError: if it is not installed.
        """
        try:
            path = Path(get_package_prefix(self.package)) / "lib" / self.package / self.executable
        except PackageNotFoundError:
            path = None
        if path is None or not path.is_file():
            raise ConfigurationError(
                f"there is no executable {self.executable} of package {self.package}: "
                "build the workspace and source its setup, or use ./aerial, which does both"
            )
        return path


PLANNER = NodeProgram(
    name="planner",
    package="aerial_planner",
    executable="planner_node",
    without="nothing can be planned any more; the robot keeps standing",
)
CONTROLLER = NodeProgram(
    name="wbic",
    package="aerial_wbic",
    executable="wbic_node",
    without="nobody commands the joints any more; the motor boards only damp them and the robot sinks down",
)
SIMULATOR = NodeProgram(
    name="sim",
    package="aerial_sim",
    executable="sim_node",
    without="there is no robot any more; planner and controller wait for one",
)
PROGRAMS = (SIMULATOR, CONTROLLER, PLANNER)


def parameters(robot: str, *, seed: int, noise: str, real_time: bool = True) -> dict[str, dict[str, Any]]:
    """Return the parameters of each node, by its name.

    In real time, simulator and controller get a processor each, if there are two, and come first there.
    """
    told: dict[str, dict[str, Any]] = {
        SIMULATOR.name: {"robot": robot, "seed": seed, "noise": noise, "real_time": real_time},
        CONTROLLER.name: {"robot": robot, "real_time": real_time},
        PLANNER.name: {"robot": robot},
    }
    processors = sorted(os.sched_getaffinity(0))
    if real_time and len(processors) > 1:
        for name, processor in zip((SIMULATOR.name, CONTROLLER.name), processors[-2:], strict=True):
            told[name] |= {"processor": processor, "realtime_priority": REALTIME_PRIORITY}
    return told


class NodeProcesses:
    """The three nodes, running while this context is open.

    Args:
        parameters: of each node by its name.
        log: where their output goes; standard error by default.
    """

    def __init__(self, parameters: Mapping[str, Mapping[str, Any]], log: TextIO | None = None) -> None:
        self._commands = {program: _command(program, parameters.get(program.name, {})) for program in PROGRAMS}
        self._log = log or sys.stderr
        self._processes: dict[NodeProgram, subprocess.Popen[bytes]] = {}
        self._buried: set[NodeProgram] = set()

    def __enter__(self) -> NodeProcesses:
        options: dict[str, Any] = {
            "stdin": subprocess.DEVNULL,
            "stdout": self._log,
            "stderr": self._log,
            "env": dict.fromkeys(_THREADS, "1") | os.environ,
            "start_new_session": True,  # Ctrl-C reaches us alone, and we end the nodes
        }
        for program, command in self._commands.items():
            self._processes[program] = subprocess.Popen(command, **options)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in self._processes.values():
            process.send_signal(signal.SIGTERM)
        for process in self._processes.values():
            try:
                process.wait(END_TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def newly_dead(self) -> list[tuple[NodeProgram, str]]:
        """Return the nodes that ended since this was last asked, each with one sentence on how and what that means."""
        dead = [
            (program, f"{program.executable} ended ({_ending(process.returncode)}): {program.without}")
            for program, process in self._processes.items()
            if process.poll() is not None and program not in self._buried
        ]
        self._buried |= {program for program, _ in dead}
        return dead

    def check(self) -> None:
        """Raise an error if a node has ended.

        Raises:
            RefusalError: with code INTERNAL and the sentence of ``newly_dead``.
        """
        for _, sentence in self.newly_dead():
            raise RefusalError(RefusalCode.INTERNAL, sentence)

    @property
    def alive(self) -> bool:
        """Whether any node runs."""
        return any(map(self.running, self._processes))

    def running(self, program: NodeProgram) -> bool:
        """Return whether a node runs."""
        return self._processes[program].poll() is None

    def pid(self, program: NodeProgram) -> int:
        """Return the process id of a node."""
        return self._processes[program].pid


def _command(program: NodeProgram, parameters: Mapping[str, Any]) -> Sequence[str]:
    command = [str(program.path), "--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={json.dumps(value)}"]  # JSON is YAML, which ROS reads
    return command


def _ending(status: int) -> str:
    return f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
