"""A robot's URDF: where it lies, its text with the total mass that was asked for, and where its meshes are."""

from __future__ import annotations

import math
import os
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aerial_model.config import closest
from aerial_model.errors import ConfigurationError

URDF_NAME = "robot.urdf"
_PACKAGE = "package://"
_TURNS = 4 * math.pi  # stops of a joint that has none [rad]
_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True, kw_only=True)
class Description:
    """What the models are built from."""

    path: Path  # of the file
    text: str  # its content, with the root link as heavy as the total mass asks, and mesh files by absolute path

    @staticmethod
    def read(
        named: object,
        folders: tuple[Path, ...],
        *,
        where: str,
        total_mass: float | None = None,
        fixed_joints: Sequence[str] = (),
    ) -> Description:
        """Return the description of a robot.

        Args:
            named: path, relative to the robot's folder, or ``package://name/path``; None: the folder's ``robot.urdf``.
            folders: the robot's own, then those it extends: the first that has the file gives it.
            where: for error messages.
            total_mass: that the root link's mass and inertia are scaled for [kg]; None: as the file says.
            fixed_joints: joints that are held at zero, as if they were none: hands, heads.

        Raises:
            ConfigurationError: if there is no such file or no such root link, or it is no XML.
        """
        path = _found(URDF_NAME if named is None else str(named), folders, where)
        try:
            tree = ElementTree.fromstring(path.read_text(encoding="utf-8"))
        except (ElementTree.ParseError, UnicodeDecodeError) as error:
            raise ConfigurationError(f"{path}: not a URDF ({error})") from None
        if tree.tag != "robot" or tree.find("link") is None:
            raise ConfigurationError(f"{path}: not a URDF: expected a <robot> with links, found <{tree.tag}>")
        if total_mass is not None:
            _set_total_mass(tree, total_mass, where)
        _fix_joints(tree, fixed_joints, where)
        _limit_continuous_joints(tree)
        for mesh in tree.iter("mesh"):
            mesh.set("filename", str(resolved(mesh.get("filename", ""), path.parent)))
        return Description(path=path, text=ElementTree.tostring(tree, encoding="unicode"))


def resolved(name: str, folder: Path) -> Path:
    """Return the file that a URDF names; for a package that is not found, the path it would have in ``folder``."""
    if name.startswith(_PACKAGE):
        rest = name.removeprefix(_PACKAGE)
        for root in _package_roots(folder):
            if (root / rest).exists():
                return root / rest
        return folder / rest
    return folder / name.removeprefix("file://")


def root_link(tree: ElementTree.Element) -> str:
    """Return the name of the link that is nobody's child."""
    children = {child.get("link") for child in tree.iterfind("joint/child")}
    return next(name for name in (link.get("name", "") for link in tree.iter("link")) if name not in children)


def _package_roots(folder: Path) -> list[Path]:
    """Return the folders in which packages may lie: ROS's, pip's, and those above the file."""
    paths = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    paths += [Path(p) / "share" for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    paths += [Path(p) / "cmeel.prefix" / "share" for p in sys.path if p]  # wheels made with cmeel
    return [*paths, *folder.parents]


def _found(name: str, folders: tuple[Path, ...], where: str) -> Path:
    candidates = [resolved(name, folder) for folder in folders]
    for path in candidates:
        if path.is_file():
            return path
    raise ConfigurationError(f"{where}: urdf: there is no file {candidates[0]}")


def _fix_joints(tree: ElementTree.Element, names: Sequence[str], where: str) -> None:
    joints = {joint.get("name", ""): joint for joint in tree.iter("joint")}
    for name in names:
        if name not in joints:
            raise ConfigurationError(
                f"{where}: fixed_joints: the URDF has no joint '{name}'{closest(str(name), joints)}"
            )
        joints[name].set("type", "fixed")


def _limit_continuous_joints(tree: ElementTree.Element) -> None:
    """Give joints that turn without end stops two turns away, so that one number is their position."""
    for joint in tree.iter("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
            limit.set("lower", repr(-_TURNS))
            limit.set("upper", repr(_TURNS))
            for name in ("effort", "velocity"):
                limit.set(name, limit.get(name, "0"))


def _set_total_mass(tree: ElementTree.Element, total_mass: float, where: str) -> None:
    """Scale mass and inertia of the root link: the same shape of another density."""
    masses = {
        link.get("name", ""): (element, float(element.get("value", "0")))
        for link in tree.iter("link")
        for element in link.iterfind("inertial/mass")
    }
    root = root_link(tree)
    mass_of_root = masses[root][1] if root in masses else 0.0
    others = sum(mass for _, mass in masses.values()) - mass_of_root
    if not mass_of_root or total_mass <= others:
        raise ConfigurationError(
            f"{where}: total_mass: {total_mass} kg leave nothing for link '{root}'; all others weigh {others:.3f} kg"
        )
    ratio = (total_mass - others) / mass_of_root
    masses[root][0].set("value", repr(mass_of_root * ratio))
    for inertia in tree.iterfind(f"link[@name='{root}']/inertial/inertia"):
        for name in _INERTIA:
            inertia.set(name, repr(float(inertia.get(name, "0")) * ratio))
