"""The simulated robot: commands in, measurements out, the actuator law between, MuJoCo below.

One ``step`` is one control period. Within it the motor boards close their own loop at every physics step: set-point to requested torque, the actuator law to delivered torque, MuJoCo to motion. Equal seeds and equal
commands give equal measurements to the last bit.
"""

from __future__ import annotations

import dataclasses
from collections import deque

import mujoco
import numpy as np

from aerial_model.errors import ConfigurationError
from aerial_model.numerics import rotation
from aerial_model.numerics.components import matrix_of
from aerial_model.numerics.jit import compiled
from aerial_model.robot.robot import (
    BASE_ANGULAR,
    BASE_LINEAR,
    BASE_ORIENTATION,
    BASE_POSITION,
    JOINT_POSITION,
    JOINT_VELOCITY,
    Robot,
)
from aerial_model.timing import CONTROL_PERIOD
from aerial_model.values.command import Command
from aerial_model.values.frame import StartFrame
from aerial_model.values.measurement import Measurement
from aerial_model.values.terrain import Terrain
from aerial_sim.conditions import Conditions
from aerial_sim.ground_truth import GroundTruth
from aerial_sim.robot_side.motor_board import MotorBoards
from aerial_sim.robot_side.sensors import SensorNoise, Sensors
from aerial_sim.world.contacts import ContactSensing, links_inside_boxes
from aerial_sim.world.placement import GROUND_SHIFT_MAX, ground_shift
from aerial_sim.world.world import World, build

FLAT = Terrain()
AS_EXPECTED = Conditions()
_WHOLE_STATE = mujoco.mjtState.mjSTATE_INTEGRATION  # all that the next step depends on
START_OFFSET = np.radians(1.0)  # largest error of the joints' starting positions with noise [rad]


class Simulation:
    """A robot in its world; W has z up and the floor at the terrain's floor.

    Args:
        robot: whose model, actuators and sensors are simulated.
        terrain: expressed in W.
        noise: ``"nominal"`` or ``"off"``; ``"off"`` also starts exactly in the home pose, heading along x.
        seed: of noise, biases, starting joint offsets and heading.
        control_dt: period of commands and measurements, a multiple of the physics step [s].
        conditions: of battery, motor boards, robot and ground, from the start on, and MuJoCo's step.

    Raises:
        ConfigurationError: for an unknown noise, periods that do not fit, a URDF that MuJoCo cannot use, or a terrain
            that runs through the robot.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        terrain: Terrain = FLAT,
        noise: str = "nominal",
        seed: int = 0,
        control_dt: float = CONTROL_PERIOD,
        conditions: Conditions = AS_EXPECTED,
    ) -> None:
        physics_dt = conditions.physics_step
        steps = round(control_dt / physics_dt)
        if steps < 1 or not np.isclose(steps * physics_dt, control_dt, rtol=1e-9, atol=0.0):
            raise ConfigurationError(f"control period {control_dt} s is no multiple of the physics step {physics_dt} s")
        self.robot = robot
        self.control_dt = control_dt
        self._physics_dt = physics_dt
        self._steps = steps
        self._noise = SensorNoise.of(robot, noise)
        self._start_offset = 0.0 if noise == "off" else START_OFFSET
        self._start_heading = 0.0 if noise == "off" else np.pi
        self._conditions = conditions
        self._latency_steps = round(conditions.latency / physics_dt)
        law = dataclasses.replace(robot.actuators, bus_voltage=conditions.battery * robot.actuators.bus_voltage)
        self._motor_boards = MotorBoards(law, steps, conditions.battery_resistance)
        self._world: World = build(robot, terrain, physics_dt)
        self._data = mujoco.MjData(self._world.model)
        self._contacts = ContactSensing(self._world)
        self.reset(seed)
        inside = links_inside_boxes(self._world, self._data)
        if inside:
            raise ConfigurationError(f"the terrain would run through the robot where it starts ({', '.join(inside)})")

    def reset(self, seed: int) -> Measurement:
        """Put the robot in its home pose, its lowest foot on the ground, at time 0, and draw everything anew.

        Disturbances end; the terrain stays.
        """
        random = np.random.default_rng(seed)
        self._sensors = Sensors(self._noise, self.robot.actuators, random)
        q = self.robot.standing_configuration()
        q[JOINT_POSITION] += random.uniform(-self._start_offset, self._start_offset, self.robot.n_joints)
        turn = rotation.about_z(random.uniform(-self._start_heading, self._start_heading))
        q[BASE_POSITION] = rotation.matrix(turn) @ q[BASE_POSITION]
        q[BASE_ORIENTATION] = turn
        points = self.robot.contact_positions(q)
        radii = np.array([point.radius for point in self.robot.contact_points])
        q[2] += np.max(self.terrain.height(points) - (points[:, 2] - radii))
        self._origin = StartFrame.of(self.robot, q).origin  # of the outside localization: as of an estimator begun here
        mujoco.mj_resetData(self._world.model, self._data)
        conditions = self._conditions
        added_mass = (conditions.mass - 1.0) * self.robot.mass
        self.disturb(added_mass=added_mass, friction_coefficient=conditions.friction, ground_rise=0.0)
        self.set_state(q, np.zeros(self.robot.model.nv))
        self._ticks = 0
        self._push_until = 0.0
        self._losses = np.random.default_rng([seed, 1])  # apart from the sensors': they stay as they are without losses
        self._pending: deque[tuple[int, Command]] = deque()  # commands under way, with the physics step they arrive at
        self._in_force: Command | None = None
        self._motor_boards.clear()
        self._contacts.clear()
        self._contacts.collect(self._data)
        self._measurement = self._measured(-self._world.model.opt.gravity)
        return self._measurement

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._ticks * self.control_dt

    @property
    def terrain(self) -> Terrain:
        """The terrain, in W."""
        return self._world.terrain

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model, for pictures and tests; replaced by ``set_terrain``."""
        return self._world.model

    def step(self, command: Command) -> Measurement:
        """Advance by one control period under ``command`` and return what the sensors then say."""
        world, model, data = self._world, self._world.model, self._data
        self._contacts.clear()
        velocity_0 = data.qvel[BASE_LINEAR].copy()
        if self.time >= self._push_until:
            data.xfrc_applied[world.trunk] = 0.0
        self._send(command)
        for k in range(self._steps):
            in_force = self._arrived(self._ticks * self._steps + k)
            data.ctrl[:] = self._motor_boards.torque(
                k, in_force, data.qpos[world.joint_qpos], data.qvel[world.joint_dof]
            )
            mujoco.mj_step(model, data)
            self._contacts.collect(data)
        self._ticks += 1
        mean_acceleration = (data.qvel[BASE_LINEAR] - velocity_0) / self.control_dt
        self._measurement = self._measured(mean_acceleration - model.opt.gravity)
        return self._measurement

    def _send(self, command: Command) -> None:
        """Put a command on its way to the motor boards; the first is there at once: they have held the robot until now."""
        if self._in_force is None:
            self._in_force = command
        elif self._conditions.lost_commands == 0 or self._losses.random() >= self._conditions.lost_commands:
            self._pending.append((self._ticks * self._steps + self._latency_steps, command))

    def _arrived(self, step: int) -> Command:
        """Return the newest command that has arrived by physics step ``step``; one has been there since ``_send``."""
        while self._pending and self._pending[0][0] <= step:
            self._in_force = self._pending.popleft()[1]
        assert self._in_force is not None
        return self._in_force

    def measure(self) -> Measurement:
        """Return the last measurement again."""
        return self._measurement

    def set_terrain(self, terrain: Terrain) -> None:
        """Replace the terrain (in W) around the robot; its state, the time and all disturbances stay.

        Raises:
            ConfigurationError: if the terrain would run through the robot or take the ground from under its feet;
                nothing changes then.
        """
        shift = ground_shift(self.robot, self.state()[0], self.terrain, terrain)
        if abs(shift) > GROUND_SHIFT_MAX:
            change = "rise" if shift > 0 else "sink"
            raise ConfigurationError(f"the ground under the robot's feet would {change} by {abs(shift):.3f} m")
        world = build(self.robot, terrain, self._physics_dt)
        data = mujoco.MjData(world.model)
        self._apply_disturbances(world)
        state = np.empty(mujoco.mj_stateSize(self._world.model, _WHOLE_STATE))
        mujoco.mj_getState(self._world.model, self._data, state, _WHOLE_STATE)
        mujoco.mj_setState(world.model, data, state, _WHOLE_STATE)
        mujoco.mj_forward(world.model, data)
        inside = set(links_inside_boxes(world, data)) - set(links_inside_boxes(self._world, self._data))
        if inside:
            raise ConfigurationError(f"the terrain would run through the robot ({', '.join(sorted(inside))})")
        self._world, self._data, self._contacts = world, data, ContactSensing(world)
        self._contacts.collect(self._data)

    def disturb(
        self,
        force: np.ndarray | None = None,
        duration: float = 0.0,
        *,
        added_mass: float | None = None,
        friction_coefficient: float | None = None,
        ground_rise: float | None = None,
    ) -> None:
        """Push the trunk, load it, or change the ground; what is not given stays as it is.

        Args:
            force: ``(3,)`` [N] in W at the trunk's centre of mass.
            duration: how long it acts, from now, in whole control periods [s].
            added_mass: fixed to the trunk's centre of mass from now on, replacing what was added before [kg].
            friction_coefficient: of the ground from now on.
            ground_rise: of floor and boxes over where the terrain has them, from now on [m].

        Raises:
            ConfigurationError: if the trunk would have no mass left; nothing changes then.
        """
        trunk_mass = self._world.trunk_mass
        if added_mass is not None and trunk_mass + added_mass <= 0:
            raise ConfigurationError(
                f"added mass: {added_mass:.2f} kg would leave nothing of the trunk's {trunk_mass:.2f} kg"
            )
        if force is not None:
            self._data.xfrc_applied[self._world.trunk, :3] = force
            self._push_until = self.time + duration
        if added_mass is not None:
            self._added_mass = added_mass
        if friction_coefficient is not None:
            self._friction_coefficient = friction_coefficient
        if ground_rise is not None:
            self._ground_rise = ground_rise
        self._apply_disturbances(self._world)

    def ground_truth(self) -> GroundTruth:
        """Return what is really so, contacts and torques over the last control period included."""
        q, v = self.state()
        other_links = self._contacts.other_links
        return GroundTruth(
            time=self.time,
            q=q,
            v=v,
            contact=self._contacts.points,
            force=self._contacts.forces(self._data),
            other_contacts=other_links,
            trunk_contact=self._world.trunk_name in other_links,
            requested_torque=self._motor_boards.requested_torque,
            delivered_torque=self._motor_boards.delivered_torque,
            peak_torque_ratio=self._motor_boards.peak_torque_ratio,
            peak_voltage_ratio=self._motor_boards.peak_voltage_ratio,
        )

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the true q ``(nq,)`` and v ``(nv,)`` in Pinocchio's order, base twist in B."""
        return _state(self._data.qpos, self._data.qvel, self._world.joint_qpos, self._world.joint_dof)

    def set_state(self, q: np.ndarray, v: np.ndarray) -> None:
        """Put the robot at q ``(nq,)`` and v ``(nv,)`` in Pinocchio's order; time goes on."""
        data = self._data
        data.qpos[:] = self._world.qpos(q)
        data.qvel[BASE_LINEAR] = self._R_WB() @ v[BASE_LINEAR]
        data.qvel[BASE_ANGULAR] = v[BASE_ANGULAR]
        data.qvel[self._world.joint_dof] = v[JOINT_VELOCITY]
        mujoco.mj_forward(self._world.model, data)

    def _measured(self, specific_force: np.ndarray) -> Measurement:
        """Return the sensors' reading of the present; ``specific_force`` ``(3,)`` [m/s²] at the base origin, in W.

        The accelerometer reports the mean over the last period, as an inertial unit that filters below the sampling
        rate does, so that its integral is the true change of velocity, impacts included.
        """
        q, v = self.state()
        torque = self._motor_boards.delivered_torque
        return Measurement(
            time=self.time,
            orientation=self._sensors.orientation(q[BASE_ORIENTATION]),
            angular_velocity=self._sensors.angular_velocity(v[BASE_ANGULAR]),
            linear_acceleration=self._sensors.linear_acceleration(self._R_WB().T @ specific_force),
            joint_position=self._sensors.joint_position(q[JOINT_POSITION], torque),
            joint_velocity=self._sensors.joint_velocity(v[JOINT_VELOCITY]),
            joint_torque=torque,
            sequence=self._ticks,
            localization=self._sensors.localization(self.time, q[BASE_POSITION] - self._origin),
        )

    def _R_WB(self) -> np.ndarray:  # noqa: N802
        """Attitude of the base ``(3, 3)``."""
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, self._data.qpos[BASE_ORIENTATION])
        return R.reshape(3, 3)

    def _apply_disturbances(self, world: World) -> None:
        """Give a world's model the added mass and the ground's friction and height asked for."""
        model = world.model
        model.geom_friction[world.ground_geoms, 0] = self._friction_coefficient
        model.geom_pos[world.ground_geoms, 2] = world.ground_height + self._ground_rise
        model.body_mass[world.trunk] = world.trunk_mass + self._added_mass
        mujoco.mj_setConst(model, mujoco.MjData(model))


@compiled
def _state(
    qpos: np.ndarray, qvel: np.ndarray, joint_qpos: np.ndarray, joint_dof: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return q and v in Pinocchio's order. MuJoCo has a quaternion's w first, and the base's linear velocity in W."""
    n = len(joint_qpos)
    q, v = np.empty(7 + n), np.empty(6 + n)
    q[:3] = qpos[:3]
    q[3], q[4], q[5], q[6] = qpos[4], qpos[5], qpos[6], qpos[3]
    rows = matrix_of((q[3], q[4], q[5], q[6]))
    for axis in range(3):
        v[axis] = rows[0][axis] * qvel[0] + rows[1][axis] * qvel[1] + rows[2][axis] * qvel[2]
        v[3 + axis] = qvel[3 + axis]
    for j in range(n):
        q[7 + j] = qpos[joint_qpos[j]]
        v[6 + j] = qvel[joint_dof[j]]
    return q, v
