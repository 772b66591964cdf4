"""A recording of a run: messages as they came, read from and written to an MCAP bag that common ROS tools know."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer

from aerial_model.errors import AerialError
from aerial_msgs.msg import (
    ControllerStatus,
    GroundTruth,
    JointCommand,
    MotionPlan,
    MotionResult,
    MotionSelection,
    RobotState,
)

TOPICS: Mapping[str, type] = {
    "state": RobotState,
    "joint_command": JointCommand,
    "controller_status": ControllerStatus,
    "ground_truth": GroundTruth,
    "odometry": Odometry,
    "motion_selection": MotionSelection,
    "motion_plan": MotionPlan,
    "motion_result": MotionResult,
}
_BAG_VERSION = 9
_NANO = 1e-9  # seconds in a nanosecond
_SEPARATOR = "=" * 80
# What rosbags raises over a bag that was cut off or overwritten: it reads lengths and offsets from the file itself.
_DAMAGE = (
    ReaderError,
    OSError,
    ValueError,
    KeyError,
    IndexError,
    AssertionError,
    EOFError,
    ArithmeticError,
    MemoryError,
)


class RecordingError(AerialError):
    """A folder is no recording, is damaged, or lacks what a verdict needs."""


class Recording:
    """Messages of some topics, each with its arrival time, as the bytes that came.

    Args:
        names: topic → its full name, namespace included.
        types: topic → its type.
    """

    def __init__(self, names: Mapping[str, str], types: Mapping[str, type] = TOPICS) -> None:
        self._names = dict(names)
        self._types = {topic: types[topic] for topic in names}
        self._kept: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in names}  # arrival [ns], serialized

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics that are kept, whether or not a message came."""
        return tuple(self._names)

    def keep(self, topic: str, arrival: int, data: bytes) -> None:
        """Keep a serialized message of a topic that arrived at ``arrival``, wall time [ns]."""
        self._kept[topic].append((arrival, data))

    def messages(self, topic: str) -> Iterator[Any]:
        """Yield the messages of a topic in the order they came; none of a topic that is not kept."""
        for data in self.serialized(topic):
            yield deserialize_message(data, self._types[topic])

    def serialized(self, topic: str) -> list[bytes]:
        """Return the messages of a topic as bytes, in the order they came; none of a topic that is not kept."""
        return [data for _, data in self._kept.get(topic, [])]

    def arrivals(self, topic: str) -> list[float]:
        """Return when the messages of a topic came, wall time [s]."""
        return [arrival * _NANO for arrival, _ in self._kept.get(topic, [])]

    def write(self, folder: Path) -> None:
        """Write everything kept as a bag: an MCAP file and its metadata in ``folder``, replacing what is there."""
        shutil.rmtree(folder, ignore_errors=True)
        with Writer(folder, version=_BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
            connections = {}
            for topic, kind in self._types.items():
                text, digest = definition(_type_name(kind))
                connections[topic] = bag.add_connection(
                    self._names[topic], _type_name(kind), msgdef=text, rihs01=digest
                )
            everything = [
                (arrival, topic, data) for topic, messages in self._kept.items() for arrival, data in messages
            ]
            for arrival, topic, data in sorted(everything, key=lambda entry: entry[0]):
                bag.write(connections[topic], arrival, data)

    @staticmethod
    def read(folder: Path) -> Recording:
        """Return what a bag on disk holds of ``TOPICS``: what was kept when it was written.

        Raises:
            RecordingError: if the folder is no bag of one robot, is damaged, or has messages of other definitions.
        """
        if not (folder / "metadata.yaml").is_file():
            what = "a folder without metadata.yaml" if folder.is_dir() else "no such folder"
            raise RecordingError(f"{folder}: expected a recording (a rosbag2 folder), found {what}")
        try:
            with Reader(folder) as bag:
                found = {each.topic: (each.msgtype, each.digest) for each in bag.connections}
                recording = Recording(_names(folder, found))
                topics = {name: topic for topic, name in recording._names.items()}
                for connection, arrival, data in bag.messages():
                    if connection.topic in topics:
                        recording.keep(topics[connection.topic], arrival, bytes(data))
        except _DAMAGE as error:
            raise RecordingError(f"{folder}: the recording is damaged or cut off ({_sentence(error)})") from None
        return recording


def _names(folder: Path, found: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """Return topic → full name of the topics that are ours, checked to be one robot's and of the installed types."""
    names: dict[str, str] = {}
    for name, (kind, digest) in sorted(found.items()):
        topic = name.rpartition("/")[2]
        if topic not in TOPICS or kind != _type_name(TOPICS[topic]):
            continue
        if digest and digest != definition(kind)[1]:
            raise RecordingError(f"{folder}: {name} was recorded with another definition of {kind} than is installed")
        names[topic] = name
    spaces = sorted({name.rpartition("/")[0] for name in names.values()})
    if len(spaces) > 1:
        raise RecordingError(f"{folder}: expected one robot's topics, found {' and '.join(f'{s}/…' for s in spaces)}")
    if not names:
        raise RecordingError(
            f"{folder}: expected topics such as {', '.join(TOPICS)}, found {', '.join(found) or 'none'}"
        )
    return {topic: names[topic] for topic in TOPICS if topic in names}


def definition(name: str) -> tuple[str, str]:
    """Return text and hash of a message's definition as installed, the text followed by those of the types it uses.

    Args:
        name: such as ``nav_msgs/msg/Odometry``.
    """
    description = json.loads(_installed(name, "json"))
    used = [entry["type_name"] for entry in description["type_description_msg"]["referenced_type_descriptions"]]
    texts = [_installed(name, "msg")]
    texts += [f"{_SEPARATOR}\nMSG: {other.replace('/msg/', '/')}\n{_installed(other, 'msg')}" for other in used]
    digest = next(entry["hash_string"] for entry in description["type_hashes"] if entry["type_name"] == name)
    return "\n".join(texts), digest


def _type_name(kind: type) -> str:
    return f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"


def _installed(name: str, suffix: str) -> str:
    package, kind, message = name.split("/")
    return Path(get_package_share_directory(package), kind, f"{message}.{suffix}").read_text(encoding="utf-8")


def _sentence(error: BaseException) -> str:
    """Return what an error says on one line, at least its kind."""
    return " ".join(str(error).split()) or type(error).__name__
