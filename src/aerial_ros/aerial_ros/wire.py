"""The control loop's two messages, read from and written to the bytes that DDS carries.

A message object costs rclpy a Python number for every entry, twice. At 500 Hz that is a tenth of what a command may take,
so ``state`` and ``joint_command`` are subscribed and published raw: a message of fixed size is one NumPy record.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message

from aerial_model.robot.robot import Robot
from aerial_model.values.command import Command
from aerial_model.values.measurement import Measurement
from aerial_msgs.msg import JointCommand, RobotState
from aerial_ros.messages import NANO, seconds_and_nanoseconds

_ENCAPSULATION = b"\x00\x01\x00\x00"  # plain CDR, little-endian, no options (DDS-RTPS 2.3, table 10.3)
_NUMBERS = {"boolean": "?", "int32": "<i4", "uint32": "<u4", "uint64": "<u8", "double": "<f8"}
_STAMP = "builtin_interfaces/Time"

_STATE_VECTORS = ("orientation", "angular_velocity", "linear_acceleration")
_STATE_ROWS = ("joint_position", "joint_velocity", "joint_torque")
_COMMAND_ROWS = ("torque", "position", "velocity", "stiffness", "damping")


class Layout:
    """Where the fields of a message lie whose sequences all have one entry a joint.

    Args:
        message_type: of stamps, numbers, arrays and sequences of numbers.
        n: number of joints.
    """

    def __init__(self, message_type: type, n: int) -> None:
        self._type, self._n = message_type, n
        self._names: list[str] = []
        self._formats: list[np.dtype] = []
        self._offsets: list[int] = []
        self._sequences: list[str] = []
        for name, kind in message_type.get_fields_and_field_types().items():
            self._place(name, kind)
        fields = {"names": self._names, "formats": self._formats, "offsets": self._offsets}
        self._dtype = np.dtype(fields)
        self._blank = np.zeros(1, self._dtype)
        for name in self._sequences:
            self._blank[_length(name)] = n

    def blank(self) -> np.void:
        """Return a record to be filled: a field is an item, a stamp ``stamp`` is ``stamp.sec`` and ``stamp.nanosec``."""
        return self._blank.copy()[0]

    def write(self, record: np.void) -> bytes:
        """Return the message that holds a record."""
        return _ENCAPSULATION + record.tobytes()

    def read(self, data: bytes) -> np.void:
        """Return the record that a message holds; its arrays are writable, and nobody else's.

        Raises:
            ValueError: naming the sequence whose length does not fit, or if the bytes hold no message.
        """
        if data[:2] == _ENCAPSULATION[:2] and len(data) >= len(_ENCAPSULATION) + self._dtype.itemsize:
            # four bytes more put every number at a multiple of its size
            record = np.frombuffer(bytearray(4) + data, self._dtype, count=1, offset=4 + len(_ENCAPSULATION))[0]
            if all(record[_length(name)] == self._n for name in self._sequences):
                return record
        try:
            message = deserialize_message(data, self._type)
        except RuntimeError:
            raise ValueError(f"expected a {self._type.__name__}, found {len(data)} bytes that hold none") from None
        return self._record(message)

    def _record(self, message: Any) -> np.void:
        """Return the record of a message that came in another encoding, if its lengths fit."""
        record = self.blank()
        for name, kind in self._type.get_fields_and_field_types().items():
            value = getattr(message, name)
            if kind == _STAMP:
                record[f"{name}.sec"], record[f"{name}.nanosec"] = value.sec, value.nanosec
            elif name in self._sequences and len(value) != self._n:
                raise ValueError(f"field {name}: expected {self._n} numbers, one a joint, found {len(value)}")
            else:
                record[name] = value
        return record

    def _place(self, name: str, kind: str) -> None:
        if kind == _STAMP:
            self._place(f"{name}.sec", "int32")
            self._place(f"{name}.nanosec", "uint32")
        elif kind.startswith("sequence<"):
            self._sequences.append(name)
            self._place(_length(name), "uint32")
            self._put(name, _NUMBERS[kind[len("sequence<") : -1]], self._n)
        elif kind.endswith("]"):
            number, _, count = kind[:-1].partition("[")
            self._put(name, _NUMBERS[number], int(count))
        else:
            self._put(name, _NUMBERS[kind])

    def _put(self, name: str, number: str, *shape: int) -> None:
        """Place a field where CDR does: at the next multiple of its number's size."""
        dtype = np.dtype((number, shape))
        end = self._offsets[-1] + self._formats[-1].itemsize if self._offsets else 0
        self._names.append(name)
        self._formats.append(dtype)
        self._offsets.append(-(-end // dtype.base.itemsize) * dtype.base.itemsize)


class StateWire:
    """Measurements of a robot as ``RobotState`` on the wire."""

    def __init__(self, robot: Robot) -> None:
        self._layout = Layout(RobotState, robot.n_joints)

    def write(self, measurement: Measurement) -> bytes:
        """Return the message that carries a measurement."""
        record = self._layout.blank()
        _set_stamp(record, "stamp", measurement.time)
        record["sequence"] = measurement.sequence
        for name in (*_STATE_VECTORS, *_STATE_ROWS):
            record[name] = getattr(measurement, name)
        if measurement.localization is not None:
            record["has_localization"], record["localization"] = True, measurement.localization
        return self._layout.write(record)

    def read(self, data: bytes) -> Measurement:
        """Return the measurement a message carries.

        Raises:
            ValueError: if a row does not have one entry a joint.
        """
        record = self._layout.read(data)
        return Measurement(
            time=_stamp(record, "stamp"),
            sequence=int(record["sequence"]),
            localization=record["localization"] if record["has_localization"] else None,
            **{name: record[name] for name in (*_STATE_VECTORS, *_STATE_ROWS)},
        )


class CommandWire:
    """Commands to a robot as ``JointCommand`` on the wire."""

    def __init__(self, robot: Robot) -> None:
        self._layout = Layout(JointCommand, robot.n_joints)

    def write(self, command: Command) -> bytes:
        """Return the message that carries a command; its stamp is that of the state it answers."""
        record = self._layout.blank()
        _set_stamp(record, "stamp", command.state_time)
        _set_stamp(record, "state_stamp", command.state_time)
        record["state_sequence"] = command.state_sequence
        for name in _COMMAND_ROWS:
            record[name] = getattr(command, name)
        return self._layout.write(record)

    def read(self, data: bytes) -> Command:
        """Return the command a message carries.

        Raises:
            ValueError: if a row does not have one finite number a joint.
        """
        record = self._layout.read(data)
        rows = {name: record[name] for name in _COMMAND_ROWS}
        if not np.isfinite(np.concatenate(list(rows.values()))).all():
            for name, row in rows.items():
                if not np.isfinite(row).all():
                    raise ValueError(f"field {name}: expected finite numbers, found {row.tolist()}")
        return Command(state_time=_stamp(record, "state_stamp"), state_sequence=int(record["state_sequence"]), **rows)


def _length(name: str) -> str:
    return f"{name}.length"


def _set_stamp(record: np.void, name: str, time: float) -> None:
    record[f"{name}.sec"], record[f"{name}.nanosec"] = seconds_and_nanoseconds(time)


def _stamp(record: np.void, name: str) -> float:
    return int(record[f"{name}.sec"]) + int(record[f"{name}.nanosec"]) / NANO
