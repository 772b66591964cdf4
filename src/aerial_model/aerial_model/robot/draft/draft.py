"""From somebody's URDF to a draft of ``robot.yaml``: what the URDF says, what follows from it, and what had to be guessed.

Guessed are the contact points (the lowest ends of the limbs), the home pose (legs bent under the body) and the motor
constants (from torque and speed limits, in the proportions of the Mini Cheetah's); each is marked as a guess.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerial_model.robot.draft.limbs import ContactGuess, contact_points, legs_of
from aerial_model.robot.draft.mechanism import Mechanism
from aerial_model.robot.draft.motors import BUS_VOLTAGE, GEAR_RATIO, MotorKind, motor_kinds
from aerial_model.robot.draft.poses import Poses, poses_of
from aerial_model.robot.draft.roles import frozen_joints, held_joints


@dataclass(frozen=True, kw_only=True)
class Draft:
    """The text of ``robot.yaml``, and what in it was guessed: to be confirmed by whoever knows the robot."""

    text: str
    guesses: tuple[str, ...]


def draft(urdf: Path, name: str, fixed_joints: Sequence[str] = ()) -> Draft:
    """Return the draft for a URDF.

    Args:
        urdf: the file.
        name: of the robot.
        fixed_joints: that are to be held at zero.

    Raises:
        ConfigurationError: if it is no URDF of a robot with legs.
    """
    mechanism = Mechanism(urdf, fixed_joints)
    legs = legs_of(mechanism)
    poses = poses_of(mechanism, legs)
    points = contact_points(mechanism, legs, poses.home)
    kinds, replaced = motor_kinds(mechanism, legs.length)
    frozen, held = frozen_joints(mechanism, legs), held_joints(mechanism, legs)
    feet = ", ".join(str(mechanism.model.names[limb.joints[-1]]) for limb in legs.limbs)
    guesses = [
        f"contact points: on {feet}, the lowest ends of limbs",
        "poses: legs bent under the body; look at them",
        *replaced,
        "actuators: motor constants, rotor inertia from torque and speed limits",
    ]
    if held:
        guesses.append("held_joints: plans leave the trunk's joints at home, and those of the arms but the first")
    lines = [
        *_heading(urdf, name, fixed_joints),
        *_contact_lines(points),
        *_motor_lines(kinds),
        *_pose_lines(mechanism.joint_names, poses),
        *_role_lines(frozen, held),
    ]
    return Draft(text="\n".join(lines) + "\n", guesses=tuple(guesses))


def _heading(urdf: Path, name: str, fixed_joints: Sequence[str]) -> list[str]:
    lines = [
        f"# Drafted from {urdf.name}. Units: SI, radians. What is marked GUESS wants confirmation.",
        f"name: {name}",
        f"urdf: {urdf}",
    ]
    return [*lines, f"fixed_joints: [{', '.join(fixed_joints)}]"] if fixed_joints else lines


def _contact_lines(points: list[ContactGuess]) -> list[str]:
    lines = ["", "contact_points: # GUESS: the lowest ends of the limbs"]
    for point in points:
        at = f", offset: [{', '.join(_number(x, 4) for x in point.offset)}]" if np.any(point.offset) else ""
        lines.append(f"  - {{name: {point.name}, frame: {point.frame}, radius: {point.radius:.4g}{at}}}")
    return lines


def _motor_lines(kinds: Sequence[MotorKind]) -> list[str]:
    lines = [
        "",
        f"bus_voltage: {BUS_VOLTAGE} # [V] GUESS",
        "actuators: # GUESS: constants that give the URDF's limits",
    ]
    for k, kind in enumerate(kinds):
        lines += [
            f"  kind_{k + 1}:",
            f"    joints: [{', '.join(kind.joints)}]",
            f"    gear_ratio: {GEAR_RATIO} # GUESS",
            f"    torque_max: {kind.torque:.6g} # [N·m]",
            f"    torque_constant: {kind.torque_constant:.4g} # [N·m/A] GUESS",
            f"    back_emf_constant: {kind.back_emf_constant:.6g} # [V·s/rad] no load: {kind.speed:.4g} rad/s",
            f"    resistance: {kind.resistance:.4g} # [Ω] GUESS: full torque up to 70 % of that",
            f"    rotor_inertia: {_number(kind.rotor_inertia)} # [kg·m²] GUESS",
            f"    damping: {_number(kind.damping)} # [N·m·s/rad]",
            f"    dry_friction: {_number(kind.friction)} # [N·m]",
        ]
    return lines


def _pose_lines(joints: Sequence[str], poses: Poses) -> list[str]:
    lines = ["", "poses: # GUESS"]
    for name, q_j in (("home", poses.home), ("landing", poses.landing), ("tuck", poses.tuck)):
        lines.append(f"  {name}: {{{', '.join(f'{n}: {x:.3f}' for n, x in zip(joints, q_j, strict=True))}}}")
    return lines


def _role_lines(frozen: Sequence[str], held: Sequence[str]) -> list[str]:
    lines = ["", f"frozen_joints: [{', '.join(frozen)}] # legs' joints that turn about other axes than the lateral one"]
    if held:
        why = "GUESS: all above the legs but arms that swing fore and aft"
        lines.append(f"held_joints: [{', '.join(held)}] # {why}")
    return lines


def _number(value: float, digits: int = 3) -> str:
    """Return a number with so many digits as YAML reads it: an exponent needs a point before it."""
    text = f"{value:.{digits}g}"
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
