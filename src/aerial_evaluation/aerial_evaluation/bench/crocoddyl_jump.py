"""A jump by crocoddyl's FDDP; run as a script, by a Python that has crocoddyl: JSON on standard input and output.

Imports nothing of ours, because it runs in another environment. The problem is that of the planner as far as FDDP goes:
the same robot with its rotors' inertia, the same contacts on the same knots, the same flight in the same intervals, from
the same stance to the same landing pose. The dynamics are the whole robot's, without the planner's approximations. What a
planner demands, FDDP can only be charged for: friction, torque limits and joint ranges are quadratic barriers, and so is
the goal a cost. Left out are voltage and speed limits, the ground under lifted feet, collisions, a free flight time.
"""

from __future__ import annotations

import json
import sys
import time

import crocoddyl
import numpy as np
import pinocchio as pin

# The planner's weights, per second instead of per 0.01 s, and twice as large because crocoddyl halves squares.
_REGULARIZATION = {"orientation": 400.0, "joints": 10.0, "angular_velocity": 2.0, "joint_rates": 0.2}
_CONTROL = 0.1  # [1/(N·m)²]
_FRICTION, _TORQUE, _RANGE = 10.0, 10.0, 1e3  # barriers
_LANDING = 1e4  # of the touchdown's position and attitude
_GRAVITY = 9.81  # [m/s²]
_FOOT_GAINS = np.array([0.0, 50.0])  # Baumgarte's, of a held contact: position, velocity


def main() -> None:
    """Solve the jump that standard input describes as often as it says, and print what came of it."""
    asked = json.load(sys.stdin)
    jump = Jump(asked)
    runs = [jump.solve(asked["tolerance"], asked["max_iterations"]) for _ in range(asked["repeats"] + 1)]
    versions = {"crocoddyl": crocoddyl.__version__, "pin": pin.__version__}
    json.dump({"versions": versions, "runs": runs[1:]}, sys.stdout)  # the first one warms caches up


class Jump:
    """The optimal control problem.

    Args:
        asked: see ``peer.problem``.
    """

    def __init__(self, asked: dict) -> None:
        self.asked = asked
        self.model = pin.buildModelFromXML(asked["urdf"], pin.JointModelFreeFlyer())
        self.model.armature = np.concatenate([np.zeros(6), asked["armature"]])
        self.state = crocoddyl.StateMultibody(self.model)
        self.actuation = crocoddyl.ActuationModelFloatingBase(self.state)
        self.torque_max = np.array(asked["torque_max"])
        self.x_0 = np.concatenate([asked["q_start"], np.zeros(self.model.nv)])
        self.contact = np.array(asked["contact"], dtype=bool)  # (N, n_c)
        self.frames = [self.model.getFrameId(name) for name in asked["contact_frames"]]
        self.problem = self._problem()

    def solve(self, tolerance: float, max_iterations: int) -> dict:
        """Solve from standing still, and return time, iterations and what the solution is worth."""
        solver = crocoddyl.SolverFDDP(self.problem)
        solver.th_stop = tolerance
        began, cpu_began = time.perf_counter(), time.process_time()
        x = [self.x_0] * (self.problem.T + 1)
        u = self.problem.quasiStatic(x[:-1])
        converged = solver.solve(x, u, max_iterations, False)
        elapsed, cpu_elapsed = time.perf_counter() - began, time.process_time() - cpu_began
        return {
            "solve_time_s": elapsed,
            "cpu_time_s": cpu_elapsed,
            "iterations": int(solver.iter),
            "converged": bool(converged and solver.isFeasible),
            **self._landing_error(solver.xs[-1]),
            **self._use(solver.xs, solver.us),
        }

    def _problem(self) -> crocoddyl.ShootingProblem:
        asked = self.asked
        kinds: dict[bytes, crocoddyl.ActionModelAbstract] = {}
        for row in self.contact:
            if row.tobytes() not in kinds:
                kinds[row.tobytes()] = self._knot(row, asked["dt"])
        flight = self._knot(np.zeros(len(self.frames), dtype=bool), asked["flight_time"] / asked["flight_knots"])
        knots = [kinds[row.tobytes()] for row in self.contact] + [flight] * asked["flight_knots"]
        problem = crocoddyl.ShootingProblem(self.x_0, knots, self._touchdown())
        problem.nthreads = 1  # as the planner
        return problem

    def _knot(self, loaded: np.ndarray, dt: float) -> crocoddyl.ActionModelAbstract:
        """Return an interval whose ``loaded`` contacts are held."""
        state, n_u = self.state, self.actuation.nu
        contacts = crocoddyl.ContactModelMultiple(state, n_u)
        costs = crocoddyl.CostModelSum(state, n_u)
        for i in np.flatnonzero(loaded):
            frame, name = self.frames[i], self.asked["contact_frames"][i]
            contact = crocoddyl.ContactModel3D(state, frame, np.zeros(3), pin.LOCAL_WORLD_ALIGNED, n_u, _FOOT_GAINS)
            contacts.addContact(name, contact)
            cone = crocoddyl.FrictionCone(np.eye(3), self.asked["friction"], 4, False)
            barrier = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(cone.lb, cone.ub))
            residual = crocoddyl.ResidualModelContactFrictionCone(state, frame, cone, n_u)
            costs.addCost(f"friction {name}", crocoddyl.CostModelResidual(state, barrier, residual), _FRICTION)
        self._add_regularization(costs)
        self._add_barriers(costs)
        dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(state, self.actuation, contacts, costs)
        return crocoddyl.IntegratedActionModelEuler(dynamics, dt)

    def _add_regularization(self, costs: crocoddyl.CostModelSum) -> None:
        state, n_j, w = self.state, self.model.nv - 6, _REGULARIZATION
        weights = [[0.0] * 3, [w["orientation"]] * 3, [w["joints"]] * n_j]  # where the body goes is up to the landing
        weights += [[0.0] * 3, [w["angular_velocity"]] * 3, [w["joint_rates"]] * n_j]
        near = crocoddyl.ActivationModelWeightedQuad(np.concatenate(weights))
        residual = crocoddyl.ResidualModelState(state, self.x_0, self.actuation.nu)
        costs.addCost("posture", crocoddyl.CostModelResidual(state, near, residual), 1.0)
        effort = crocoddyl.ResidualModelControl(state, self.actuation.nu)
        costs.addCost("effort", crocoddyl.CostModelResidual(state, effort), _CONTROL)

    def _add_barriers(self, costs: crocoddyl.CostModelSum) -> None:
        state, n_u = self.state, self.actuation.nu
        limit = self.asked["margin"] * self.torque_max
        bounded = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(-limit, limit))
        torque = crocoddyl.ResidualModelControl(state, n_u)
        costs.addCost("torque", crocoddyl.CostModelResidual(state, bounded, torque), _TORQUE)
        free = np.full(6, np.inf)
        low = np.concatenate([-free, self.asked["joint_min"], np.full(self.model.nv, -np.inf)])
        high = np.concatenate([free, self.asked["joint_max"], np.full(self.model.nv, np.inf)])
        bounded = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(low, high))
        pose = crocoddyl.ResidualModelState(state, state.zero(), n_u)
        costs.addCost("joint range", crocoddyl.CostModelResidual(state, bounded, pose), _RANGE)

    def _touchdown(self) -> crocoddyl.ActionModelAbstract:
        state, n_u, n_v = self.state, self.actuation.nu, self.model.nv
        costs = crocoddyl.CostModelSum(state, n_u)
        goal = np.concatenate([self.asked["q_landing"], np.zeros(n_v)])
        weights = np.concatenate([np.ones(6), np.full(n_v - 6, 1e-2), np.zeros(n_v)])
        near = crocoddyl.ActivationModelWeightedQuad(weights)
        residual = crocoddyl.ResidualModelState(state, goal, n_u)
        costs.addCost("landing", crocoddyl.CostModelResidual(state, near, residual), _LANDING)
        contacts = crocoddyl.ContactModelMultiple(state, n_u)
        dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(state, self.actuation, contacts, costs)
        return crocoddyl.IntegratedActionModelEuler(dynamics, 0.0)

    def _landing_error(self, x: np.ndarray) -> dict:
        goal, n_q = np.array(self.asked["q_landing"]), self.model.nq
        miss = pin.difference(self.model, goal, x[:n_q])
        return {
            "landing_error_m": float(np.linalg.norm(x[:3] - goal[:3])),
            "landing_tilt_deg": float(np.rad2deg(np.linalg.norm(miss[3:6]))),
        }

    def _use(self, x: list, u: list) -> dict:
        """Return the greatest torque and voltage over their limits, and by how much forces leave the pyramid."""
        torque = np.array(u)
        speed = np.array(x)[:-1, -self.actuation.nu :]
        volts = np.array(self.asked["volts_per_torque"]) * torque + np.array(self.asked["volts_per_speed"]) * speed
        slips = [self._slip(data.differential) for data in list(self.problem.runningDatas)[: len(self.contact)]]
        return {
            "peak_torque_ratio": float(np.max(np.abs(torque) / self.torque_max)),
            "peak_voltage_ratio": float(np.max(np.abs(volts) / np.array(self.asked["bus_voltage"]))),
            "friction_excess": max(slips),
        }

    def _slip(self, data: crocoddyl.DifferentialActionDataAbstract) -> float:
        """Return by how much an interval's contact forces leave the friction pyramid, as a share of the weight."""
        slips = [0.0]
        for contact in data.multibody.contacts.contacts.todict().values():
            f = contact.f.linear  # in the world's axes, as the contact is
            slips.append(float(np.abs(f[:2]).max() - self.asked["friction"] * f[2]))
        return max(slips) / (pin.computeTotalMass(self.model) * _GRAVITY)


if __name__ == "__main__":
    main()
