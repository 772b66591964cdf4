"""The MuJoCo model of a robot on a terrain, built from the robot's folder, so that it agrees with Pinocchio's.

What is chosen here, and why:

* The URDF gives bodies, inertias, joints and shapes; ``robot.yaml`` gives armature, damping, dry friction and contact
  points. Torque limits are not MuJoCo's business: the motor boards apply the one actuator law before the torque gets here.
* Contact is as stiff as the step allows (time constant of two steps, impedance 0.95 … 0.99): a standing robot sinks
  in by micrometres. The elliptic friction cone with ``impratio`` 100 keeps a loaded foot from creeping. Joint stops and
  dry friction are equally stiff: MuJoCo's default lets a joint held by dry friction creep at 0.03 rad/s.
* ``implicitfast`` treats joint damping implicitly; with a 0.5 ms step a flip with swinging legs keeps its
  angular momentum to 0.3 %, a test.
* The robot's links collide with the world and with one another, except neighbours in the tree (MuJoCo's own rule) and
  those that meet in the home pose. Collision meshes are their convex hulls.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import coal
import mujoco
import numpy as np
import pinocchio as pin

from aerial_model.errors import ConfigurationError
from aerial_model.numerics.rotation import about_z
from aerial_model.robot.robot import BASE_ORIENTATION, BASE_POSITION, JOINT_POSITION, Robot
from aerial_model.robot.shapes import standing_shapes
from aerial_model.values.terrain import Terrain

FRICTION_COEFFICIENT = 0.7  # of the world; planner and controller count on less, see robot.yaml
IMPEDANCE = (0.95, 0.99, 0.001, 0.5, 2.0)  # MuJoCo's solimp of ground, stops and dry friction
IMPEDANCE_RATIO = 100.0  # friction over normal stiffness
STEPS_PER_TIME_CONSTANT = 2.0  # the stiffest contact MuJoCo keeps stable
SOLVER_TOLERANCE = 1e-10
XYZW = [4, 5, 6, 3]  # the base quaternion in qpos, where MuJoCo has w first
_MESHES = (".stl", ".obj", ".msh")  # that MuJoCo reads
LEAST_INERTIA = 1e-9  # [kg·m²]
WORLD_BODY = 0  # MuJoCo's id of the body all terrain belongs to
ROBOT_SHAPE_GROUP = 3  # MuJoCo draws groups 0 to 2 unless told otherwise
ROBOT_LOOKS_GROUP = 2
FLOOR_COLOUR = (0.94, 0.94, 0.93, 1.0)
BOX_COLOUR = (0.42, 0.56, 0.68, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """A compiled model, and where the robot's quantities lie in it; arrays in the robot's own order."""

    model: mujoco.MjModel
    terrain: Terrain
    joint_qpos: np.ndarray  # (n,) index into qpos
    joint_dof: np.ndarray  # (n,) index into qvel
    contact_geoms: np.ndarray  # (n_c,) id of each contact point's sphere
    trunk: int  # id of the robot's root body
    trunk_name: str
    trunk_mass: float  # as built, without what is added later [kg]
    ground_geoms: np.ndarray  # ids of the floor and, after it, of the boxes
    ground_height: np.ndarray  # height of each of them as built [m]

    def qpos(self, q: np.ndarray) -> np.ndarray:
        """Return MuJoCo's qpos ``(nq,)`` of a configuration q ``(nq,)`` in Pinocchio's order."""
        qpos = np.empty_like(q)
        qpos[BASE_POSITION] = q[BASE_POSITION]
        qpos[XYZW] = q[BASE_ORIENTATION]
        qpos[self.joint_qpos] = q[JOINT_POSITION]
        return qpos


def build(robot: Robot, terrain: Terrain, physics_dt: float) -> World:
    """Return the world of ``robot`` on ``terrain`` (expressed in W), to be stepped by ``physics_dt`` [s].

    Raises:
        ConfigurationError: if MuJoCo cannot make a model of the robot's URDF.
    """
    try:
        spec = mujoco.MjSpec.from_string(_urdf_with_looks(robot))
        _add_hulls(spec, robot)
        _let_pass(spec, robot)
        root = spec.worldbody.first_body()
        root.add_freejoint(name="root")
        _set_options(spec, physics_dt)
        _set_joints(spec, robot, physics_dt)
        _set_shapes(spec)
        contact_names = _add_contact_points(spec, robot)
        ground_names = _add_ground(spec, terrain, physics_dt)
        trunk_name = root.name
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise ConfigurationError(
            f"{robot.description.path}: MuJoCo cannot use it ({' '.join(str(error).split())})"
        ) from None
    ground_geoms = np.array([model.geom(name).id for name in ground_names])
    trunk = model.body(trunk_name).id
    return World(
        model=model,
        terrain=terrain,
        joint_qpos=np.array([model.joint(name).qposadr[0] for name in robot.joint_names]),
        joint_dof=np.array([model.joint(name).dofadr[0] for name in robot.joint_names]),
        contact_geoms=np.array([model.geom(name).id for name in contact_names]),
        trunk=trunk,
        trunk_name=trunk_name,
        trunk_mass=float(model.body_mass[trunk]),
        ground_geoms=ground_geoms,
        ground_height=model.geom_pos[ground_geoms, 2].copy(),
    )


def _urdf_with_looks(robot: Robot) -> str:
    """Return the URDF's text, told to keep its visual shapes and to weld fixed links onto their parents."""
    tree = ElementTree.fromstring(robot.description.text)
    standing = standing_shapes(robot.model, _shapes(robot), robot.standing_configuration())
    for link in tree.iter("link"):
        for i, shape in enumerate(link.findall("collision")):
            if f"{link.get('name')}_{i}" in standing:
                link.remove(shape)  # the contact points stand for it
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            mesh = shape.find("geometry/mesh")
            if mesh is not None and (shape.tag == "collision" or not _readable(mesh.get("filename", ""))):
                link.remove(shape)  # collision meshes come back as hulls
        _make_positive(link.find("inertial/inertia"))
    settings = {
        "discardvisual": "false",
        "fusestatic": "true",
        "meshdir": str(robot.folder),
        "strippath": "false",
        "balanceinertia": "true",
    }
    ElementTree.SubElement(ElementTree.SubElement(tree, "mujoco"), "compiler", settings)
    return ElementTree.tostring(tree, encoding="unicode")


def _make_positive(inertia: ElementTree.Element | None) -> None:
    """Give a link that is as good as without inertia a tiny one: MuJoCo takes no other."""
    if inertia is None:
        return
    xx, xy, xz, yy, yz, zz = (float(inertia.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    if np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0] > 0:
        return
    for name, value in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), (xx, 0, 0, yy, 0, zz), strict=True):
        inertia.set(name, repr(max(value, LEAST_INERTIA) if name[1] == name[2] else 0.0))


def _readable(mesh: str) -> bool:
    path = Path(mesh)
    return path.suffix.lower() in _MESHES and path.is_file()


def _shapes(robot: Robot) -> pin.GeometryModel:
    return pin.buildGeomFromUrdfString(robot.model, robot.description.text, pin.GeometryType.COLLISION)


def _add_hulls(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Add the convex hulls of collision meshes, whatever their format: coal reads more of them than MuJoCo does."""
    geometry = _shapes(robot)
    standing = standing_shapes(robot.model, geometry, robot.standing_configuration())
    for i, item in enumerate(geometry.geometryObjects):
        if item.name in standing or not isinstance(item.geometry, coal.BVHModelBase):
            continue
        body = spec.body(robot.model.frames[item.parentFrame].name)
        placement = robot.model.frames[item.parentFrame].placement.inverse() * item.placement
        x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
        vertices = np.array([item.geometry.vertices(k) for k in range(item.geometry.num_vertices)])
        spec.add_mesh(name=f"hull {i}", uservert=vertices.astype(np.float32).ravel())
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"hull {i}",
            pos=placement.translation,
            quat=[w, x, y, z],
            mass=0,
        )


def _let_pass(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Exclude contacts between links whose shapes meet at home already: they are drawn too large, or fold."""
    geometry = _shapes(robot)
    geometry.addAllCollisionPairs()
    model, data, results = robot.model, robot.model.createData(), pin.GeometryData(geometry)
    pin.computeCollisions(model, data, geometry, results, robot.standing_configuration(), False)
    root = spec.worldbody.first_body()
    bodies = {1: root.name} | {j: spec.joint(str(model.names[j])).parent.name for j in range(2, model.njoints)}
    met = set()
    for pair, result in zip(geometry.collisionPairs, results.collisionResults, strict=True):
        a, b = (geometry.geometryObjects[k].parentJoint for k in (pair.first, pair.second))
        if result.isCollision() and a != b:
            met.add((bodies[min(a, b)], bodies[max(a, b)]))
    for first, second in sorted(met):
        spec.add_exclude(bodyname1=first, bodyname2=second)


def _set_options(spec: mujoco.MjSpec, physics_dt: float) -> None:
    spec.option.timestep = physics_dt
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = IMPEDANCE_RATIO
    spec.option.tolerance = SOLVER_TOLERANCE


def _set_joints(spec: mujoco.MjSpec, robot: Robot, physics_dt: float) -> None:
    law = robot.actuators
    for i, name in enumerate(robot.joint_names):
        joint = spec.joint(name)
        joint.armature = law.armature[i]
        joint.damping[0] = law.damping[i]
        joint.frictionloss = law.dry_friction[i]
        joint.solref_friction = joint.solref_limit = _stiffest(physics_dt)
        joint.solimp_friction = joint.solimp_limit = IMPEDANCE
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_motor()


def _stiffest(physics_dt: float) -> list[float]:
    """Return MuJoCo's solref (time constant [s], damping ratio) of the stiffest constraint that is stable."""
    return [STEPS_PER_TIME_CONSTANT * physics_dt, 1.0]


def _set_shapes(spec: mujoco.MjSpec) -> None:
    for geom in spec.geoms:
        geom.mass = 0.0  # a link's is what its <inertial> says; MuJoCo would give one to links without
        collides = geom.contype != 0
        geom.group = ROBOT_SHAPE_GROUP if collides else ROBOT_LOOKS_GROUP


def _add_contact_points(spec: mujoco.MjSpec, robot: Robot) -> list[str]:
    names = []
    for point in robot.contact_points:
        names.append(f"contact {point.name}")
        spec.body(point.frame).add_geom(
            name=names[-1],
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=point.offset,
            size=[point.radius, 0, 0],
            group=ROBOT_SHAPE_GROUP,
            mass=0,
        )
    return names


def _add_ground(spec: mujoco.MjSpec, terrain: Terrain, physics_dt: float) -> list[str]:
    surface = {
        "condim": 3,
        "priority": 1,  # the ground's parameters hold, whatever the robot's shapes say
        "friction": [FRICTION_COEFFICIENT, 0.0, 0.0],
        "solref": _stiffest(physics_dt),
        "solimp": IMPEDANCE,
    }
    names = ["floor"]
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[0, 0, terrain.floor],
        size=[0, 0, 1],  # infinite
        rgba=FLOOR_COLOUR,
        **surface,
    )
    for i, box in enumerate(terrain.boxes):
        x, y, z, w = about_z(box.yaw)
        names.append(f"box {i}")
        spec.worldbody.add_geom(
            name=names[-1],
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=box.centre,
            quat=[w, x, y, z],
            size=box.size / 2,
            rgba=BOX_COLOUR,
            **surface,
        )
    return names
