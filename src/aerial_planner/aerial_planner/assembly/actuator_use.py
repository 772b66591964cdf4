"""What a plan asks of the actuators: exact motor torques by inverse dynamics, and their share of the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from aerial_model.robot.robot import GRAVITY, JOINT_VELOCITY, Robot
from aerial_model.values.plan import Plan

_SAME_TIME = 1e-9  # by which times that are meant to be equal differ [s]
_STICTION_SPEED = 0.1  # smoothing of Coulomb friction in exact torques [rad/s]


@dataclass(frozen=True, kw_only=True)
class ActuatorUse:
    """Exact motor torques of a plan between its knots, and what they take of the limits."""

    torque: np.ndarray  # (K-1, n) motor torque, losses and rotor inertia included [N·m]
    speed: np.ndarray  # (K-1, n) [rad/s]
    torque_ratio: np.ndarray  # (K-1, n) of the limit
    voltage_ratio: np.ndarray  # (K-1, n)
    speed_ratio: np.ndarray  # (K-1, n)
    flying: np.ndarray  # (K-1,) bool
    base_wrench_error: float  # largest force the plan's accelerations would need from nowhere, as a share of the weight

    @property
    def in_take_off(self) -> np.ndarray:
        """Greatest torque or voltage of each joint over its limit while contacts push ``(n,)``."""
        return self._worst[~self.flying].max(axis=0)

    @property
    def at_lift_off(self) -> np.ndarray:
        """Greatest of torque and voltage of each joint over its limit as the flight begins ``(n,)``."""
        return self._worst[self.flying][0]

    @property
    def in_flight(self) -> np.ndarray:
        """Greatest torque or voltage of each joint over its limit in flight ``(n,)``."""
        return self._worst[self.flying].max(axis=0)

    @property
    def _worst(self) -> np.ndarray:
        return np.maximum(self.torque_ratio, self.voltage_ratio)


def actuator_use(plan: Plan, robot: Robot) -> ActuatorUse:
    """Return the exact torques of a plan: inverse dynamics with exact Jacobians at mid-interval, plus losses."""
    law = robot.actuators
    v, tau = _generalized_forces(plan, robot)
    speed = v[:, JOINT_VELOCITY]
    torque = tau[:, JOINT_VELOCITY] + law.friction(speed, _STICTION_SPEED)
    gap = float(np.linalg.norm(tau[:, :3], axis=1).max())
    return ActuatorUse(
        torque=torque,
        speed=speed,
        torque_ratio=law.torque_ratio(torque),
        voltage_ratio=law.voltage_ratio(torque, speed),
        speed_ratio=law.speed_ratio(speed),
        flying=plan.time[:-1] >= plan.take_off_time - _SAME_TIME,
        base_wrench_error=gap / (robot.mass * GRAVITY),
    )


def _generalized_forces(plan: Plan, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return v and M v̇ + h − Jᵀ f ``(K-1, nv)`` at the middle of each interval of a plan."""
    data = robot.model.createData()
    dt = np.diff(plan.time)
    v, a = 0.5 * (plan.v[:-1] + plan.v[1:]), np.diff(plan.v, axis=0) / dt[:, None]
    tau = np.empty_like(v)
    for k in range(len(dt)):
        q = pin.interpolate(robot.model, plan.q[k], plan.q[k + 1], 0.5)
        tau[k] = pin.rnea(robot.model, data, q, v[k], a[k])
        if plan.contact[k].any():
            pin.computeJointJacobians(robot.model, data, q)
        for i in np.flatnonzero(plan.contact[k]):
            J = pin.getFrameJacobian(robot.model, data, robot.contact_frames[i], pin.LOCAL_WORLD_ALIGNED)[:3]
            tau[k] -= J.T @ plan.force[k, i]
    return v, tau
