"""From somebody's URDF to a draft of ``robot.yaml``: what the URDF says, what follows from it, and what had to be guessed.

Guessed are the contact points (the lowest ends of the limbs), the home pose (legs bent under the body) and the motor
constants (from torque and speed limits, in the proportions of the Mini Cheetah's); each is marked as a guess.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from aerial_model.errors import ConfigurationError
from aerial_model.robot.shapes import lowest, spanning_points
from aerial_model.robot.urdf import Description

RADIUS = 0.004  # of contact spheres: small, so that rolling moves a contact by millimetres [m]
BUS_VOLTAGE = 48.0  # [V]
GEAR_RATIO = 6.0
_RESISTIVE = 0.3  # share of the voltage that full torque takes: it is there up to 70 % of the no-load speed
_CONSTANTS = 0.75  # torque constant over back-EMF constant
_ARMATURE = 6e-6  # reflected rotor inertia over the square of the greatest torque [kg·m²/(N·m)²]
_DAMPING, _FRICTION = 6e-4, 0.01  # over the greatest torque [s/rad], [-]
_USUAL_TORQUE = 4.0  # N·m per kg of robot and metre of leg, where the URDF has no limit
_IMPLAUSIBLE = 20.0  # times the usual torque
_USUAL_SPEED = 25.0  # [rad/s], where the URDF has no limit
_LOW = 0.15  # of the leg length: ends of limbs within this of the lowest stand on the ground
_SAME = 0.005  # [m] that spheres of one sole may differ in height
_ROUND = 1.5  # greatest over least extent of a ball
_FLATNESS = 1.0  # height of a foot over its length, at most
_FLAT = 0.02  # [m] that the corners of a sole are apart at least
_CROUCH = {True: 0.9, False: 0.7}  # leg length at home over that of the straight leg, of a biped and of others
_FOLD, _FOLD_BIPED = 0.6, 0.7  # leg length tucked over that at home
_ASTRIDE = 0.1  # leg lengths by which the feet of a biped that lands stand wider than at home
_ARM = 0.15  # of the robot's mass, which an arm weighs at most
_RANGES = 0.05  # [rad] that poses keep from stops


@dataclass(frozen=True, kw_only=True)
class Draft:
    """The text of ``robot.yaml``, and what in it was guessed: to be confirmed by whoever knows the robot."""

    text: str
    guesses: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class _Limb:
    """A limb that stands on the ground: from the body to the link that carries the contact points."""

    link: int  # Pinocchio joint whose link it is
    joints: tuple[int, ...]  # Pinocchio joints from the body to there
    points: tuple[tuple[str, np.ndarray], ...]  # URDF link and centre of the sphere in it [m]
    radius: float  # [m]


def draft(urdf: Path, name: str, fixed_joints: Sequence[str] = ()) -> Draft:
    """Return the draft for a URDF.

    Args:
        urdf: the file.
        name: of the robot.
        fixed_joints: that are to be held at zero.

    Raises:
        ConfigurationError: if it is no URDF of a robot with legs.
    """
    description = Description.read(urdf, (urdf.parent,), where=str(urdf), fixed_joints=fixed_joints)
    try:
        model = pin.buildModelFromXML(description.text, pin.JointModelFreeFlyer())
        shapes = pin.buildGeomFromUrdfString(model, description.text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise ConfigurationError(f"{urdf}: not a URDF that Pinocchio can read ({error})") from None
    if model.njoints < 4:
        raise ConfigurationError(
            f"{urdf}: a robot that jumps has legs; this one has {model.njoints - 2} joints that move"
        )
    return _Drafter(model, shapes, urdf, name, fixed_joints).draft()


class _Drafter:
    def __init__(
        self, model: pin.Model, shapes: pin.GeometryModel, urdf: Path, name: str, fixed_joints: Sequence[str]
    ) -> None:
        self._model, self._shapes, self._urdf, self._name = model, shapes, urdf, name
        self._fixed = tuple(fixed_joints)
        self._guesses: list[str] = []
        self._low = model.lowerPositionLimit[7:] + _RANGES
        self._high = model.upperPositionLimit[7:] - _RANGES
        self._data = model.createData()
        self._limbs = self._find_limbs()

    def draft(self) -> Draft:
        model = self._model
        names = [str(n) for n in model.names[2:]]
        home = self._standing(_CROUCH[self._is_biped])
        tuck = self._standing(_CROUCH[self._is_biped] * (_FOLD if not self._is_biped else _FOLD_BIPED), home)
        landing = self._standing(0.5 + 0.5 * _CROUCH[True], home, _ASTRIDE) if self._is_biped else home
        self._guesses.append("poses: legs bent under the body; look at them")
        kinds = self._kinds()
        lines = [
            f"# Drafted from {self._urdf.name}. Units: SI, radians. What is marked GUESS wants confirmation.",
            f"name: {self._name}",
            f"urdf: {self._urdf}",
        ]
        if self._fixed:
            lines.append(f"fixed_joints: [{', '.join(self._fixed)}]")
        lines += ["", "contact_points: # GUESS: the lowest ends of the limbs"]
        for point, frame, offset, radius in self._points(home):
            at = "" if not np.any(offset) else f", offset: [{', '.join(_number(x, 4) for x in offset)}]"
            lines.append(f"  - {{name: {point}, frame: {frame}, radius: {radius:.4g}{at}}}")
        lines += [
            "",
            f"bus_voltage: {BUS_VOLTAGE} # [V] GUESS",
            "actuators: # GUESS: constants that give the URDF's limits",
        ]
        for kind, (joints, torque, speed, damping, friction) in kinds.items():
            lines += _actuator(kind, [names[j] for j in joints], torque, speed, damping, friction)
        lines += ["", "poses: # GUESS"]
        for pose, q in (("home", home), ("landing", landing), ("tuck", tuck)):
            lines.append(f"  {pose}: {{{', '.join(f'{n}: {x:.3f}' for n, x in zip(names, q, strict=True))}}}")
        frozen = [names[j] for j in self._frozen()]
        lines += [
            "",
            f"frozen_joints: [{', '.join(frozen)}] # legs' joints that turn about other axes than the lateral one",
        ]
        held = [names[j] for j in self._held()]
        if held:
            lines.append(
                f"held_joints: [{', '.join(held)}] # GUESS: all above the legs but arms that swing fore and aft"
            )
            self._guesses.append(
                "held_joints: plans leave the trunk's joints at home, and those of the arms but the first"
            )
        return Draft(text="\n".join(lines) + "\n", guesses=tuple(self._guesses))

    @property
    def _is_biped(self) -> bool:
        return len(self._limbs) == 2

    # --- contact points ----------------------------------------------------------------------------------------------

    def _find_limbs(self) -> list[_Limb]:
        """Return the limbs whose ends are the lowest with all joints at zero, or as near as their stops allow."""
        model, data = self._model, self._data
        q = pin.neutral(model)
        pin.framesForwardKinematics(model, data, q)
        ends = [j for j in range(2, model.njoints) if not len(model.children[j])]
        candidates = {j: self._end_points(j) for j in ends}
        heights = {
            j: min(self._world(frame, offset)[2] for frame, offset in points) for j, points in candidates.items()
        }
        floor = min(heights.values())
        self._leg = -floor if floor < 0 else 1.0  # from the base down [m]
        chosen = [j for j in ends if heights[j] < floor + _LOW * self._leg]
        if len(chosen) < 2 and len(ends) > 1:
            raise ConfigurationError(
                f"{self._urdf}: fewer than two limbs reach the ground with all joints at zero: no legs to guess"
            )
        self._guesses.append(
            f"contact points: on {', '.join(model.names[j] for j in chosen)}, the lowest ends of limbs"
        )
        limbs = []
        for j in chosen:
            points = candidates[j]
            radius = self._radii.get(j, RADIUS)
            names = tuple((model.frames[frame].name, offset) for frame, offset in points)
            limbs.append(_Limb(link=j, joints=tuple(list(model.supports[j])[2:]), points=names, radius=radius))
        return limbs

    def _end_points(self, joint: int) -> list[tuple[int, np.ndarray]]:
        """Return frame and offset of the points a limb's last link would stand on."""
        model = self._model
        self._radii = getattr(self, "_radii", {})
        shapes = [s for s in self._shapes.geometryObjects if s.parentJoint == joint]
        spheres = [s for s in shapes if isinstance(s.geometry, coal.Sphere)]
        if spheres:
            heights = [self._world_placement(s)[2] - s.geometry.radius for s in spheres]
            low = [s for s, z in zip(spheres, heights, strict=True) if z < min(heights) + _SAME]
            self._radii[joint] = float(low[0].geometry.radius)
            return [self._offset_in(s.parentFrame, s.placement.translation) for s in low]
        low = min(shapes, key=lambda s: lowest(s, self._data.oMi[joint]), default=None)
        cloud = np.zeros((0, 3)) if low is None else spanning_points(low)
        if len(cloud):
            extent = np.ptp(cloud, axis=0)
            if extent.max() < _ROUND * extent.min():  # a ball, drawn as a mesh
                self._radii[joint] = float(extent.max() / 2)
                return [self._offset_in(low.parentFrame, (cloud.max(axis=0) + cloud.min(axis=0)) / 2)]
            corners = self._sole(low, cloud)
            if corners is not None:
                return corners
        frames = [i for i, f in enumerate(model.frames) if f.parentJoint == joint and f.type == pin.FrameType.BODY]
        tip = min(frames, key=lambda i: self._data.oMf[i].translation[2])
        return [(tip, np.zeros(3))]

    def _sole(self, shape: pin.GeometryObject, cloud: np.ndarray) -> list[tuple[int, np.ndarray]] | None:
        """Return the corners of the rectangle on which a shape stands; None for what is hardly a sole."""
        joint = shape.parentJoint
        placement = self._data.oMi[joint]
        points = cloud @ placement.rotation.T + placement.translation
        if np.ptp(points[:, 2]) > _FLATNESS * np.ptp(points[:, :2], axis=0).max():
            return None  # a shank, not a foot
        bottom = points[points[:, 2] < points[:, 2].min() + _FLAT]
        low, high = bottom.min(axis=0), bottom.max(axis=0)
        z = points[:, 2].min() + RADIUS
        xs = (high[0], low[0]) if high[0] - low[0] > _FLAT else ((high[0] + low[0]) / 2,)
        ys = (low[1], high[1]) if high[1] - low[1] > _FLAT else ((high[1] + low[1]) / 2,)
        self._radii[joint] = RADIUS
        inset = RADIUS
        corners = []
        for x, y in itertools.product(xs, ys):
            x += inset * np.sign((xs[0] + xs[-1]) / 2 - x)
            y += inset * np.sign((ys[0] + ys[-1]) / 2 - y)
            local = placement.rotation.T @ (np.array([x, y, z]) - placement.translation)
            corners.append(self._offset_in(shape.parentFrame, local))
        return corners

    def _offset_in(self, frame: int, in_joint: np.ndarray) -> tuple[int, np.ndarray]:
        placement = self._model.frames[frame].placement
        return frame, placement.rotation.T @ (np.asarray(in_joint) - placement.translation)

    def _world(self, frame: int, offset: np.ndarray) -> np.ndarray:
        placement = self._data.oMf[frame]
        return placement.translation + placement.rotation @ offset

    def _world_placement(self, shape: pin.GeometryObject) -> np.ndarray:
        return self._data.oMi[shape.parentJoint].act(shape.placement).translation

    def _points(self, home: np.ndarray) -> list[tuple[str, str, np.ndarray, float]]:
        """Return name, URDF link, offset and radius of the contact points; of a ball, its lowest point at home."""
        model, data = self._model, self._data
        q = pin.neutral(model)
        q[7:] = home
        pin.framesForwardKinematics(model, data, q)
        result = []
        for limb in self._limbs:
            many = len(limb.points) > 1
            for k, (frame, offset) in enumerate(limb.points):
                name = re.sub(r"_?(link|foot|sole)$", "", frame) or frame
                R = data.oMf[model.getFrameId(frame)].rotation
                offset = offset - R.T @ [0.0, 0.0, limb.radius - min(RADIUS, limb.radius)]
                offset = np.where(np.abs(offset) < 1e-6, 0.0, offset)
                result.append((f"{name}_{k + 1}" if many else name, frame, offset, min(RADIUS, limb.radius)))
        return result

    # --- poses ---------------------------------------------------------------------------------------------------------

    def _standing(self, share: float, guess: np.ndarray | None = None, wider: float = 0.0) -> np.ndarray:
        """Return joint positions ``(n,)`` with each leg bent to a ``share`` of its straight length, feet flat below it."""
        zero = np.clip(np.zeros(len(self._low)), self._low, self._high)
        best = zero.copy() if guess is None else guess.copy()
        for limb in self._limbs:
            starts = [best] if guess is not None else self._bends(limb, best)
            solved = [self._placed(limb, start, share, wider) for start in starts]
            best = min(solved, key=lambda item: item[1])[0]
        return best

    def _bends(self, limb: _Limb, q_j: np.ndarray) -> list[np.ndarray]:
        """Return starting points with the leg bent either way."""
        lateral = [j for j in limb.joints if abs(self._axis(j)[1]) > 0.7]
        starts = []
        for sense in (1.0, -1.0):
            start = q_j.copy()
            pattern = (-0.5, 1.0, -0.5) if len(lateral) > 2 else (-0.7, 1.4)
            for j, angle in zip(lateral[-3:] if len(lateral) > 2 else lateral, pattern, strict=False):
                start[self._index(j)] = sense * angle * np.sign(self._axis(j)[1])
            starts.append(np.clip(start, self._low, self._high))
        return starts

    def _placed(self, limb: _Limb, start: np.ndarray, share: float, wider: float) -> tuple[np.ndarray, float]:
        """Return the pose with this limb's points where they should be, and the cost: misses, then how far knees are ahead."""
        model, data = self._model, self._data
        pin.framesForwardKinematics(model, data, pin.neutral(model))
        hip = data.oMi[limb.joints[0]].translation.copy()
        frames = [model.getFrameId(name) for name, _ in limb.points]
        flat = np.array([self._world(f, o) for f, (_, o) in zip(frames, limb.points, strict=True)])
        centre = flat.mean(axis=0)
        length = hip[2] - centre[2]
        side = np.sign(centre[1]) if abs(centre[1]) > 1e-3 else 0.0
        target = flat + [0.0, side * wider * length, (1 - share) * length]
        indices = [self._index(j) for j in limb.joints]
        q = pin.neutral(model)
        q[7:] = start
        for _ in range(200):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            error, rows = [], []
            for f, (_, o), wanted in zip(frames, limb.points, target, strict=True):
                error.append(wanted - self._world(f, o))
                J = pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)
                arm = data.oMf[f].rotation @ o
                rows.append((J[:3] - pin.skew(arm) @ J[3:])[:, 6:][:, indices])
            J, e = np.vstack(rows), np.concatenate(error)
            step = np.linalg.solve(J.T @ J + 1e-5 * np.eye(len(indices)), J.T @ e)
            q[7:][indices] = np.clip(q[7:][indices] + np.clip(step, -0.2, 0.2), self._low[indices], self._high[indices])
        pin.forwardKinematics(model, data, q)
        miss = float(np.max(np.linalg.norm(np.reshape(e, (-1, 3)), axis=1)))
        knees = [data.oMi[j].translation[0] - (hip[0] + centre[0]) / 2 for j in limb.joints]
        ahead = max(knees, key=abs)
        preferred = ahead if not self._is_biped else -ahead  # quadrupeds' knees behind, bipeds' ahead
        return q[7:].copy(), round(miss, 3) * 1e3 + preferred

    # --- actuators -----------------------------------------------------------------------------------------------------

    def _kinds(self) -> dict[str, tuple[list[int], float, float, float, float]]:
        """Return kinds of actuators: joints with the same limits → joints, torque, speed, damping, friction."""
        model = self._model
        usual = _USUAL_TORQUE * pin.computeTotalMass(model) * self._leg
        groups: dict[tuple[float, ...], list[int]] = {}
        for j in range(len(self._low)):
            torque, speed = model.effortLimit[6 + j], model.velocityLimit[6 + j]
            if not 0 < torque < _IMPLAUSIBLE * usual:
                text = f"{model.names[2 + j]}: {torque:g} N·m in the URDF is no motor's limit"
                self._guesses.append(f"{text}; {usual:.1f} N·m from mass and leg length")
                torque = usual
            if not 0 < speed < 1e3:
                self._guesses.append(f"{model.names[2 + j]}: no speed limit in the URDF; {_USUAL_SPEED:.0f} rad/s")
                speed = _USUAL_SPEED
            damping = model.damping[6 + j] or _DAMPING * torque
            friction = model.friction[6 + j] or _FRICTION * torque
            groups.setdefault((round(float(torque), 4), round(float(speed), 4), damping, friction), []).append(j)
        self._guesses.append("actuators: motor constants, rotor inertia from torque and speed limits")
        return {f"kind_{k + 1}": (joints, *key) for k, (key, joints) in enumerate(groups.items())}

    def _frozen(self) -> list[int]:
        """Return the indices of the legs' joints that turn about other axes than the lateral one."""
        joints = {j for limb in self._limbs for j in limb.joints if abs(self._axis(j)[1]) < 0.7}
        return sorted(self._index(j) for j in joints)

    def _held(self) -> list[int]:
        """Return the indices of the joints that plans leave alone: of limbs that do not stand, all but what swings an arm.

        An arm is light and hangs, and the first of its joints that turns about the lateral axis swings all of it.
        """
        model = self._model
        standing = {j for limb in self._limbs for j in limb.joints}
        others = [j for j in range(2, model.njoints) if j not in standing]
        light = _ARM * pin.computeTotalMass(model)
        swings: set[int] = set()
        for j in others:  # parents come first
            pin.centerOfMass(model, self._data, pin.neutral(model))
            hangs = self._data.oMi[j].act(self._data.com[j])[2] < self._data.oMi[j].translation[2]
            lateral = abs(self._axis(j)[1]) > 0.7
            if lateral and hangs and self._data.mass[j] < light and not swings & set(model.supports[j]):
                swings.add(j)
        return [self._index(j) for j in others if j not in swings]

    def _axis(self, joint: int) -> np.ndarray:
        """Return a joint's axis ``(3,)`` in the base with all joints at zero."""
        model = self._model
        data = model.joints[joint].createData()
        model.joints[joint].calc(data, np.zeros(1), np.zeros(1))
        subspace = np.asarray(data.S).reshape(6)
        pin.forwardKinematics(model, self._data, pin.neutral(model))
        return self._data.oMi[joint].rotation @ (subspace[3:] if np.any(subspace[3:]) else subspace[:3])

    def _index(self, joint: int) -> int:
        return self._model.joints[joint].idx_v - 6


def _number(value: float, digits: int = 3) -> str:
    """Return a number with so many digits as YAML reads it: an exponent needs a point before it."""
    text = f"{value:.{digits}g}"
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _actuator(kind: str, joints: list[str], torque: float, speed: float, damping: float, friction: float) -> list[str]:
    """Return the lines of one kind: constants that give ``speed`` without load and ``torque`` up to 70 % of it."""
    back_emf = BUS_VOLTAGE / (GEAR_RATIO * speed)
    constant = _CONSTANTS * back_emf
    resistance = _RESISTIVE * BUS_VOLTAGE * GEAR_RATIO * constant / torque
    return [
        f"  {kind}:",
        f"    joints: [{', '.join(joints)}]",
        f"    gear_ratio: {GEAR_RATIO} # GUESS",
        f"    torque_max: {torque:.6g} # [N·m]",
        f"    torque_constant: {constant:.4g} # [N·m/A] GUESS",
        f"    back_emf_constant: {back_emf:.6g} # [V·s/rad] no load: {speed:.4g} rad/s",
        f"    resistance: {resistance:.4g} # [Ω] GUESS: full torque up to 70 % of that",
        f"    rotor_inertia: {_number(_ARMATURE * torque**2 / GEAR_RATIO**2)} # [kg·m²] GUESS",
        f"    damping: {_number(damping)} # [N·m·s/rad]",
        f"    dry_friction: {_number(friction)} # [N·m]",
    ]
