"""Ticks of a whole-body controller by TSID; run as a script, by a Python that has tsid: JSON on standard input and output.

Imports nothing of ours, because it runs in another environment. Each tick asks for what the controller's asks for: feet that
stay, then the centre of mass, the base's attitude and, faintly, a posture; forces in the friction pyramid, torques within
their limits; by eiquadprog, TSID's fastest.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import pinocchio as pin
import tsid

_FORCE = 1e-5  # weights of the costs
_COM, _ATTITUDE, _POSTURE = 1.0, 1.0, 1e-3
_FORCE_MAX = 1e4  # [N]
_PERIOD = 0.002  # [s]


def main() -> None:
    """Answer the ticks that standard input describes, and print how long each took."""
    asked = json.load(sys.stdin)
    controller = TsidController(asked)
    for k in range(min(50, len(asked["q"]))):
        controller.tick(k)
    times, solved = [], 0
    for k in range(len(asked["q"])):
        began = time.thread_time()
        solved += controller.tick(k)
        times.append(time.thread_time() - began)
    versions = {"tsid": tsid.__version__ if hasattr(tsid, "__version__") else "1.10.0", "pin": pin.__version__}
    json.dump({"versions": versions, "times_s": times, "solved": solved}, sys.stdout)


class TsidController:
    """TSID's formulation of the tick.

    Args:
        asked: see ``tsid_peer.problem``.
    """

    def __init__(self, asked: dict) -> None:
        arrays = ("q", "v", "com", "orientation", "angular", "joints")
        self._q, self._v, self._com, self._orientation, self._angular, self._joints = (
            np.array(asked[name]) for name in arrays
        )
        model = pin.buildModelFromXML(asked["urdf"], pin.JointModelFreeFlyer())
        model.armature = np.concatenate([np.zeros(6), asked["armature"]])
        self._robot = robot = tsid.RobotWrapper(model, False)
        self._formulation = formulation = tsid.InverseDynamicsFormulationAccForce("tick", robot, False)
        formulation.computeProblemData(0.0, self._q[0], self._v[0])
        self._kept: list[object] = []  # alive: the formulation only points to them
        self._add_contacts(asked, model)
        self._add_tasks(asked, model)
        self._solver = tsid.SolverHQuadProgFast("qp")
        self._solver.resize(formulation.nVar, formulation.nEq, formulation.nIn)
        self._com_sample = tsid.TrajectorySample(3)
        self._attitude_sample = tsid.TrajectorySample(12, 6)
        self._posture_sample = tsid.TrajectorySample(robot.na)

    def _add_contacts(self, asked: dict, model: pin.Model) -> None:
        """Hold every contact point where it is, with forces in the friction pyramid."""
        robot, formulation = self._robot, self._formulation
        for name in asked["contact_frames"]:
            contact = tsid.ContactPoint(
                name, robot, name, np.array([0.0, 0.0, 1.0]), asked["friction"], 0.0, _FORCE_MAX
            )
            contact.setKp(np.zeros(3))
            contact.setKd(np.full(3, asked["damping"]))
            contact.useLocalFrame(False)
            contact.setReference(robot.framePosition(formulation.data(), model.getFrameId(name)))
            formulation.addRigidContact(contact, _FORCE)
            self._kept.append(contact)

    def _add_tasks(self, asked: dict, model: pin.Model) -> None:
        """Ask for centre of mass, attitude and posture, within the torques' limits."""
        robot, formulation = self._robot, self._formulation
        gains = np.full(3, asked["stiffness"]), np.full(3, asked["damping"])
        self._com_task = tsid.TaskComEquality("com", robot)
        self._com_task.setKp(gains[0])
        self._com_task.setKd(gains[1])
        formulation.addMotionTask(self._com_task, _COM, 1, 0.0)
        base = model.frames[2].name  # 0: universe, 1: the floating joint
        self._attitude_task = tsid.TaskSE3Equality("attitude", robot, base)
        self._attitude_task.setKp(np.tile(gains[0], 2))
        self._attitude_task.setKd(np.tile(gains[1], 2))
        self._attitude_task.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
        self._attitude_task.useLocalFrame(False)
        formulation.addMotionTask(self._attitude_task, _ATTITUDE, 1, 0.0)
        self._posture_task = tsid.TaskJointPosture("posture", robot)
        n = robot.na
        self._posture_task.setKp(np.full(n, asked["stiffness"]))
        self._posture_task.setKd(np.full(n, asked["damping"]))
        formulation.addMotionTask(self._posture_task, _POSTURE, 1, 0.0)
        limit = np.array(asked["torque_max"])
        bounds = tsid.TaskActuationBounds("torque", robot)
        bounds.setBounds(-limit, limit)
        formulation.addActuationTask(bounds, 1.0, 0, 0.0)
        self._kept.append(bounds)

    def tick(self, k: int) -> bool:
        """Answer a tick; return whether its program was solved."""
        com, attitude, posture = self._com_sample, self._attitude_sample, self._posture_sample
        com.value(self._com[k, :3])
        com.derivative(self._com[k, 3:6])
        com.second_derivative(self._com[k, 6:9])
        self._com_task.setReference(com)
        R = pin.Quaternion(self._orientation[k]).matrix()
        attitude.value(np.concatenate([np.zeros(3), R.ravel(order="F")]))
        attitude.derivative(np.concatenate([np.zeros(3), self._angular[k, :3]]))
        attitude.second_derivative(np.concatenate([np.zeros(3), self._angular[k, 3:]]))
        self._attitude_task.setReference(attitude)
        posture.value(self._joints[k])
        self._posture_task.setReference(posture)
        data = self._formulation.computeProblemData(_PERIOD * k, self._q[k], self._v[k])
        solution = self._solver.solve(data)
        if solution.status != 0:
            return False
        self._formulation.getActuatorForces(solution)
        return True


if __name__ == "__main__":
    main()
