"""Is a robot folder complete and plausible? Every finding is one sentence that says what to do.

Errors keep the robot from jumping; warnings are what a careful engineer would look at; the rest is for information.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from aerial_model.errors import AerialError
from aerial_model.robot.loading import find_folder
from aerial_model.robot.posture import crouch_depth
from aerial_model.robot.robot import JOINT_POSITION, JOINT_VELOCITY, Robot
from aerial_model.robot.urdf import resolved
from aerial_model.values.terrain import Terrain
from aerial_planner.assembly.collision import CollisionModel
from aerial_sim.conditions import PHYSICS_STEP
from aerial_sim.world.world import build
from aerial_wbic.controller import Controller

ERROR, WARNING, NOTE = "error", "warning", "note"
_LEVEL = 0.002  # [m] by which contact points may differ in height at home
_MASS = (0.3, 500.0)  # [kg] of a robot
_DENSITY = 20000.0  # [kg/m³]: no link is denser than this, taken as a ball of its inertia's size
_HOLDING = 0.5  # share of a joint's torque that standing may take
_SHALLOW = 0.15  # share of the height that legs should be able to bend
_SPEED_GAP = 0.3  # by which no-load speed and the URDF's limit may differ


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that was noticed."""

    level: str  # ``error``, ``warning`` or ``note``
    text: str


def check(name_or_path: str) -> list[Finding]:
    """Return what there is to say about a robot's folder, or about a URDF alone."""
    path = Path(name_or_path).expanduser()
    if path.is_file():
        return list(_urdf(path))
    try:
        robot = Robot.load(name_or_path)
    except AerialError as error:
        findings = [Finding(level=ERROR, text=str(error))]
        try:
            urdf = find_folder(name_or_path) / "robot.urdf"
        except AerialError:
            return findings
        return [*findings, *(_urdf(urdf) if urdf.is_file() else [])]
    return [*_urdf(robot.description.path), *_folder(robot)]


# --- the URDF alone ------------------------------------------------------------------------------------------------------


def _urdf(path: Path) -> Iterator[Finding]:
    try:
        tree = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        yield Finding(level=ERROR, text=f"{path}: not readable as XML ({error})")
        return
    if tree.tag != "robot":
        yield Finding(
            level=ERROR, text=f"{path}: expected <robot>, found <{tree.tag}>; xacro files have to be expanded first"
        )
        return
    yield from _tree(tree)
    moving = _moving_links(tree)
    for link in tree.iter("link"):
        yield from _inertia(link, moved=link.get("name") in moving)
    for joint in tree.iter("joint"):
        yield from _joint(joint)
    missing = {
        m.get("filename", "") for m in tree.iter("mesh") if not resolved(m.get("filename", ""), path.parent).is_file()
    }
    for mesh in sorted(missing):
        yield Finding(level=WARNING, text=f"mesh file {mesh} is not found: it is neither drawn nor collided with")


def _tree(tree: ElementTree.Element) -> Iterator[Finding]:
    links = [link.get("name") for link in tree.iter("link")]
    children: dict[str, str] = {}
    for joint in tree.iter("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            if joint.get("type") is not None:
                yield Finding(level=ERROR, text=f"joint '{joint.get('name')}' lacks a parent or a child")
            continue
        for end in (parent.get("link"), child.get("link")):
            if end not in links:
                yield Finding(level=ERROR, text=f"joint '{joint.get('name')}' names link '{end}', which there is not")
        if child.get("link") in children:
            yield Finding(level=ERROR, text=f"link '{child.get('link')}' has two parents: loops are not supported")
        children[child.get("link", "")] = joint.get("name", "")
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        yield Finding(level=ERROR, text=f"expected one root link, found {len(roots)}: {', '.join(map(str, roots[:5]))}")


def _moving_links(tree: ElementTree.Element) -> set[str]:
    """Return the links that a joint moves."""
    joints = [joint for joint in tree.iter("joint") if joint.get("type") not in (None, "fixed")]
    children = [child for joint in joints if (child := joint.find("child")) is not None]
    return {child.get("link", "") for child in children}


def _inertia(link: ElementTree.Element, *, moved: bool) -> Iterator[Finding]:
    name, inertial = link.get("name"), link.find("inertial")
    weight = None if inertial is None else inertial.find("mass")
    inertia = None if inertial is None else inertial.find("inertia")
    if weight is None or inertia is None:
        if moved:
            yield Finding(level=WARNING, text=f"link '{name}' moves but has no inertia of its own")
        return
    try:
        mass = float(weight.get("value", ""))
        xx, xy, xz, yy, yz, zz = (float(inertia.get(k, "0")) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    except ValueError:
        yield Finding(level=ERROR, text=f"link '{name}': mass or inertia is no number")
        return
    if mass < 0 or (mass == 0 and moved):
        yield Finding(level=ERROR, text=f"link '{name}': its mass is {mass} kg")
        return
    if mass == 0:
        return
    principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if principal[0] <= 0:
        yield Finding(
            level=ERROR if moved else WARNING,
            text=f"link '{name}': its inertia is not positive definite (least {principal[0]:.2g} kg·m²)",
        )
    elif principal[0] + principal[1] < principal[2] * (1 - 1e-6):
        text = f"link '{name}': no body has this inertia: {principal[0]:.3g} + {principal[1]:.3g} < {principal[2]:.3g} kg·m² (triangle inequality)"
        yield Finding(level=WARNING, text=text)
    else:
        size = np.sqrt(5 * principal.mean() / (2 * mass))  # radius of a ball with that inertia
        if mass / (4 / 3 * np.pi * size**3) > _DENSITY:
            yield Finding(
                level=WARNING,
                text=f"link '{name}': {mass:.3g} kg with the inertia of a ball of {200 * size:.1f} cm is denser than gold",
            )


def _joint(joint: ElementTree.Element) -> Iterator[Finding]:
    name, kind = joint.get("name"), joint.get("type")
    if kind in (None, "fixed"):
        return
    if kind not in ("revolute", "continuous", "prismatic"):
        yield Finding(
            level=ERROR, text=f"joint '{name}' is {kind}; joints that move have to be revolute, continuous or prismatic"
        )
        return
    if joint.find("mimic") is not None:
        yield Finding(
            level=WARNING, text=f"joint '{name}' mimics another: here it is a joint of its own; list it in fixed_joints"
        )
    axis = joint.find("axis")
    xyz = np.array((axis.get("xyz", "1 0 0") if axis is not None else "1 0 0").split(), dtype=float)
    if not np.isclose(np.linalg.norm(xyz), 1.0, atol=1e-3):
        yield Finding(level=ERROR, text=f"joint '{name}': its axis has length {np.linalg.norm(xyz):.3g}, expected 1")
    limit = joint.find("limit")
    if limit is None and kind != "continuous":
        yield Finding(level=ERROR, text=f"joint '{name}' has no limit")
        return
    values = (
        {key: float(limit.get(key, "0")) for key in ("lower", "upper", "effort", "velocity")}
        if limit is not None
        else {}
    )
    if kind != "continuous" and values["lower"] >= values["upper"]:
        yield Finding(level=ERROR, text=f"joint '{name}': its range {values['lower']} … {values['upper']} is empty")
    for key, unit in (("effort", "N·m"), ("velocity", "rad/s")):
        if not 0 < values.get(key, 0.0) < 1e4:
            yield Finding(
                level=WARNING,
                text=f"joint '{name}': {key} limit {values.get(key, 0.0):g} {unit} says nothing about its motor",
            )


# --- the folder ----------------------------------------------------------------------------------------------------------


def _folder(robot: Robot) -> Iterator[Finding]:
    yield Finding(level=NOTE, text=_summary(robot))
    if not _MASS[0] <= robot.mass <= _MASS[1]:
        yield Finding(level=ERROR, text=f"its mass is {robot.mass:.3g} kg, expected {_MASS[0]} … {_MASS[1]} kg")
    guesses = len(re.findall("GUESS", (robot.folder / "robot.yaml").read_text(encoding="utf-8")))
    if guesses:
        yield Finding(
            level=NOTE, text=f"robot.yaml has {guesses} lines marked GUESS: confirm them and take the mark away"
        )
    yield from _pose(robot)
    yield from _motors(robot)
    yield from _models(robot)


def _summary(robot: Robot) -> str:
    q = robot.standing_configuration()
    height = pin.centerOfMass(robot.model, robot.model.createData(), q)[2]
    return (
        f"{robot.name}: {robot.mass:.2f} kg, {robot.n_joints} joints ({len(robot.arms)} of arms), {robot.n_contacts} contact "
        f"points, centre of mass {height:.3f} m high; gains and weights are the reference robot's for {robot.scale.mass:.2f} "
        f"times its mass and {robot.scale.length:.2f} times its height"
    )


def _pose(robot: Robot) -> Iterator[Finding]:
    low, high = robot.model.lowerPositionLimit[JOINT_POSITION], robot.model.upperPositionLimit[JOINT_POSITION]
    for pose, q_j in robot.poses.items():
        for j in np.flatnonzero((q_j < low) | (q_j > high)):
            text = f"pose '{pose}' has {robot.joint_names[j]} at {q_j[j]:.3f} rad, outside its stops {low[j]:.3f} … {high[j]:.3f}"
            yield Finding(level=ERROR, text=text)
    q = robot.standing_configuration()
    points = robot.contact_positions(q)
    radii = np.array([point.radius for point in robot.contact_points])
    soles = points[:, 2] - radii
    for i in np.flatnonzero(soles > _LEVEL):
        text = f"contact point '{robot.contact_points[i].name}' is {1000 * soles[i]:.0f} mm off the ground at home"
        yield Finding(level=ERROR, text=f"{text}: change poses: home, or leave the point out")
    com = pin.centerOfMass(robot.model, robot.model.createData(), q)
    spread = np.ptp(points[:, :2], axis=0) / 2
    if robot.n_contacts < 3 or spread.min() < 0.01:
        text = "its contact points lie on a line: it can be planned for, but nothing holds it upright across that line"
        yield Finding(level=WARNING, text=text)
    elif np.any(np.abs(com[:2]) > 0.8 * spread):
        text = f"at home the centre of mass is {com[0]:+.3f}, {com[1]:+.3f} m from the middle of its support"
        yield Finding(level=ERROR, text=f"{text}, which reaches ±{spread[0]:.3f}, ±{spread[1]:.3f} m: it falls over")
    depth = crouch_depth(robot, robot.poses["home"])
    if depth < _SHALLOW * com[2]:
        text = f"from home its legs can bend by {depth:.3f} m only, {100 * depth / com[2]:.0f} % of the height"
        yield Finding(level=WARNING, text=f"{text}: take-off and landing are short of way")


def _motors(robot: Robot) -> Iterator[Finding]:
    law, model = robot.actuators, robot.model
    q = robot.standing_configuration()
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    torque = pin.computeGeneralizedGravity(model, data, q)
    J = np.vstack([pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[:3] for f in robot.contact_frames])
    force = np.linalg.lstsq(J[:, :6].T, torque[:6], rcond=None)[0]
    holding = np.abs((torque - J.T @ force)[JOINT_VELOCITY]) / law.torque_max
    for j in np.flatnonzero(holding > _HOLDING):
        text = f"{robot.joint_names[j]} needs {100 * holding[j]:.0f} % of its torque just to stand"
        yield Finding(level=WARNING, text=f"{text}: is torque_max right?")
    effort, speed = model.effortLimit[JOINT_VELOCITY], model.velocityLimit[JOINT_VELOCITY]
    for k, name in enumerate(robot.joint_names):
        if 0 < effort[k] < 1e4 and abs(law.torque_max[k] / effort[k] - 1) > _SPEED_GAP:
            yield Finding(
                level=WARNING, text=f"{name}: torque_max {law.torque_max[k]:g} N·m, but the URDF says {effort[k]:g}"
            )
        if 0 < speed[k] < 1e3 and abs(law.no_load_speed[k] / speed[k] - 1) > _SPEED_GAP:
            text = f"{name}: without load it turns at {law.no_load_speed[k]:.1f} rad/s, but the URDF says {speed[k]:g}"
            yield Finding(level=WARNING, text=f"{text}: look at back_emf_constant, gear_ratio and bus_voltage")


def _models(robot: Robot) -> Iterator[Finding]:
    """Build what the nodes build."""
    for what, build_it in (
        ("the simulator", lambda: build(robot, Terrain(), PHYSICS_STEP)),
        ("the collision check", lambda: CollisionModel(robot)),
        ("the controller", lambda: Controller(robot)),
    ):
        try:
            build_it()
        except (AerialError, ValueError, RuntimeError) as error:
            yield Finding(level=ERROR, text=f"{what} cannot use it: {error}")
