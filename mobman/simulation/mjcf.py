"""Robots as MuJoCo models on the ground: bodies, inertias, wheels, supports and couplings."""

from __future__ import annotations

import importlib
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.pieces import Piece
from mobman.toml_model import Strict

BASE, TIP = "mobman/base", "mobman/tip"
"""Names of the base's body and free joint, and of the site at the tip."""
_SKATE = 0.05  # m, radius of a foot that stands for a constraint
_RIGID = {"solref": "0.002 1", "solimp": "0.9999 0.9999 0.001 0.5 2"}  # gears, followers
_ROLLING = 1e-4  # friction of a roller about its own axis, over that along it
_ORIGIN = np.zeros(3)
LEAST_FRICTION = 1e-5
"""The least that MuJoCo takes."""
_EMPTY = (
    '<mujoco model="robot"><compiler angle="radian"/><option integrator="Euler" cone="elliptic" '
    'solver="Newton" iterations="100" tolerance="1e-12"><flag autoreset="disable" island="disable"/>'
    "</option><worldbody/><contact/><equality/></mujoco>"
)


class Patch(Strict):
    """A round patch of other friction."""

    ahead: float = 0.0
    """Distance from where the platform starts, along its heading (m)."""
    left: float = 0.0
    """The same to the left (m)."""
    radius: float = Field(gt=0)
    """m."""
    friction: float = Field(ge=0)


class Ridge(Strict):
    """A ridge across the way."""

    ahead: float
    """Distance from where the platform starts, along its heading (m)."""
    angle: float = 0.0
    """Angle between the heading there and the direction in which the ridge is crossed (rad)."""
    height: float = Field(gt=0)
    """m."""
    width: float = Field(0.1, gt=0)
    """On the ground (m)."""


class Ground(Piece):
    """Ground and tyres."""

    friction: float = Field(0.8, ge=0)
    """Coulomb's coefficient of tyre and ground."""
    deflection: float = Field(1e-4, gt=0)
    """Compression of the tyres under the static load (m): their stiffness is load over deflection."""
    damping: float = Field(1.0, gt=0)
    """Damping ratio of the tyres: 1 is critical for the whole mass on them."""
    impedance: float = Field(0.95, gt=0, lt=1)
    """MuJoCo's d of the contacts: that share of what a sudden force would do is taken up at once, as by
    an inertance beside the spring; 0 leaves spring and damper alone."""
    creep: float = Field(1e-4, gt=0)
    """Slip per friction over the static load (m/s)."""
    supports: float = Field(0.2, gt=0)
    """Stiffness of the supports of a platform on one axle over that of its wheels: the softer, the more
    of the load is on the wheels."""
    slope: float = Field(0.0, gt=-1.2, lt=1.2)
    """Slope of the ground (rad); the task is in its axes, and the controller knows nothing of it."""
    uphill: float = 0.0
    """Direction in which it rises, from the world's x axis (rad)."""
    patches: list[Patch] = Field([], max_length=100)
    """Ground of other friction; the first that a wheel is on counts."""
    bumps: list[Ridge] = Field([], max_length=100)
    """Ridges."""
    scrub: bool = False
    """Wheels of skid-steered platforms have friction sideways, too, and where they are; the effective
    track is then what the ground makes of it."""
    velocity: Literal["pose", "wheels"] = "pose"
    """What tells z: the rates of the platform's pose, or those of its wheels, which slip; each tells
    what the other leaves open."""
    step: float = Field(2.5e-4, ge=1e-6, le=1e-3)
    """Longest integration step (s)."""


class Foot(NamedTuple):
    """A sphere that touches the ground."""

    name: str
    joint: str
    """The joint that moves the body that has it; that of the base by the base's last joint."""
    centre: Array
    """In the frame of that joint (m), shape (3,); so is the radius (m)."""
    radius: float
    friction: bool
    """False for a support, which slides freely."""
    axis: Array
    """Axis of the wheel in the joint's frame; or, where the foot does not turn, the direction in which
    it has friction; shape (3,)."""
    roller: float | None = None
    """Angle of the direction in which it has friction, from that in which it rolls (rad), anticlockwise
    seen from above; None if it has friction in all directions."""

    @property
    def directed(self) -> bool:
        """True if it has friction in one direction only."""
        return self.friction and self.roller is not None


# Feet -------------------------------------------------------------------------------------------------


def feet_of(robot: MobileManipulator, scrub: bool = False) -> list[Foot]:
    """Feet of a robot at ``q_rest``: its wheels, then those that must be added.

    Wheels are spheres: they touch the ground in one point. Those of a skid-steered platform have
    friction along their rolling direction, where the effective track says, and so slip sideways without
    resistance; unless they ``scrub``. Where no wheel resists motion sideways, each constraint on the
    pose alone gets a foot with friction in the direction that it forbids. Wheels on one axle get two
    supports that slide freely, before and behind it; a platform without wheels gets four.

    Raises:
        SpecError: If a platform without wheels has constraints on other coordinates than its pose.
    """
    platform, model = robot.platform, robot.model
    if not platform.base_joints:
        return []
    level = robot.q_rest.copy()
    level[robot.platform_index[:3]] = 0.0
    data = model.createData()
    centre = pin.centerOfMass(model, data, level)
    constraints = robot.constraint_matrix(level)[: robot.k - len(robot.followers)]
    feet = []
    for wheel in platform.wheels:
        i = model.getJointId(wheel.joint)
        axis, roller, place = unit_twist(model, i)[3:], wheel.roller, np.zeros(3)
        if platform.skids and not scrub:
            roller = 0.0
            place = _beside(robot, wheel.joint, constraints, data.oMi[i], axis) * axis
        feet.append(Foot(wheel.joint, wheel.joint, place, wheel.radius, True, axis, roller))
    wheels = list(feet)
    if all(foot.directed for foot in feet):
        feet += _skates(robot, constraints, bool(feet))
    if not wheels:
        base, least = platform.base_joints[-1], 0.5 * float(centre[2])
        return [*feet, *_supports(base, np.eye(3), np.zeros(2), centre, 4, least)]
    places = np.array([data.oMi[model.getJointId(one.joint)].translation[:2] for one in wheels])
    middle, track = places.mean(axis=0), float(np.linalg.norm(places[-1] - places[0]))
    if np.linalg.matrix_rank(places - middle, tol=1e-2) > 1:
        return feet
    carrier = model.parents[model.getJointId(wheels[0].joint)]
    x, y = (places[-1] - places[0]) / track
    axes = np.array([[y, x, 0.0], [-x, y, 0.0], [0.0, 0.0, 1.0]])
    found = _supports(model.names[carrier], axes, middle, centre, 2, 0.5 * track)
    frame = data.oMi[carrier]
    return [*feet, *(one._replace(centre=np.array(frame.actInv(one.centre))) for one in found)]


def _beside(
    robot: MobileManipulator, wheel: str, constraints: Array, frame: pin.SE3, axis: Array
) -> float:
    """Distance along its axis at which a wheel's constraint puts the point that rolls (m)."""
    row = constraints[np.flatnonzero(constraints[:, robot.joint_names.index(wheel)])[0]]
    x, y, turning = row[robot.platform_index[:3]]
    place, along = frame.translation, frame.rotation @ axis
    # (place + s along) x (x, y) = turning
    return float((turning - place[0] * y + place[1] * x) / (along[0] * y - along[1] * x))


def _supports(
    joint: str, axes: Array, middle: Array, centre: Array, count: int, least: float
) -> list[Foot]:
    """Supports around a point, along the columns of ``axes``, twice as far as the centre of mass is."""
    reach = max(least, 2.0 * float(np.linalg.norm(centre[:2] - middle)))
    radius, found = 0.25 * reach, []
    for i in range(count):
        place = np.array([*middle, radius]) + (-1.0) ** i * reach * axes[:, i // 2]
        found.append(Foot(f"mobman/support_{i}", joint, place, radius, False, axes[:, 0]))
    return found


def _skates(robot: MobileManipulator, constraints: Array, wheels: bool) -> list[Foot]:
    """A foot for each constraint on the pose alone, where and how it forbids motion."""
    pose, base, found = robot.platform_index[:3], robot.platform.base_joints[-1], []
    for i, row in enumerate(constraints):
        x, y, turning = row[pose]
        size = math.hypot(x, y)
        if np.delete(row, pose).any() or not size:
            if wheels:
                continue
            raise SpecError(
                f"robot {robot.name!r}: its platform has constraints on joints and names no wheels, "
                "which is what the ground acts on; name them in the platform's 'wheels'"
            )
        place = np.array([*(turning / size**2 * np.array([y, -x])), _SKATE])
        direction = np.array([x, y, 0.0]) / size
        found.append(Foot(f"mobman/skate_{i}", base, place, _SKATE, True, direction, 0.0))
    return found


def unit_twist(model: pin.Model, joint: int) -> Array:
    """A joint's unit twist in its own frame: linear, then angular, shape (6,)."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq))
    return np.array(data.S, dtype=float).reshape(6)


# XML --------------------------------------------------------------------------------------------------


def mjcf(
    robot: MobileManipulator,
    feet: Sequence[Foot],
    ground: Ground,
    step: float,
    gravity: Array,
    start: Array = _ORIGIN,
) -> str:
    """The robot and the ground as MJCF; inertias are set by :func:`make_model`.

    The base's body has the platform's frame, whose origin is on the ground. Joints and bodies have the
    names of the robot's joints; those that the description adds without a body have none. Integration
    step (s), gravity (m/s^2), shape (3,), and the pose at which the platform starts (m, m, rad), shape
    (3,).
    """
    root = ET.fromstring(_EMPTY)
    parts = (next(root.iter(tag)) for tag in ("option", "worldbody", "contact", "equality"))
    option, world, contact, equality = parts
    option.attrib |= {"timestep": repr(step), "gravity": numbers(gravity)}
    _shape(world, "ground", type="plane", size="0 0 1")
    obstacles = ["ground"]
    for i, bump in enumerate(ground.bumps):
        obstacles.append(f"mobman/bump_{i}")
        _ridge(world, obstacles[-1], bump, start)
    model, base = robot.model, robot.platform.base_joints
    bodies: dict[str, ET.Element] = {"universe": world}
    if base:
        bodies[base[-1]] = body = ET.SubElement(world, "body", name=BASE)
        ET.SubElement(body, "freejoint", name=BASE)
        _mass(body)
    for i in range(1, model.njoints):
        name = model.names[i]
        if name not in base and name not in robot.platform.virtual_joints:
            bodies[name] = body = jointed_body(bodies[model.names[model.parents[i]]], model, i)
            _mass(body)
    tip = model.frames[robot.tip_frame]
    carrier, place = bodies[model.names[tip.parentJoint]], numbers(tip.placement.translation)
    ET.SubElement(carrier, "site", name=TIP, pos=place)
    for foot in feet:
        size, centre = repr(float(foot.radius)), numbers(foot.centre)
        _shape(bodies[foot.joint], foot.name, type="sphere", size=size, pos=centre)
        for obstacle in obstacles:
            _pair(contact, obstacle, foot, ground)
    for one in robot.followers:
        _coupling(equality, one.joint, one.of, one.ratio, one.offset)
    for gear in robot.platform.geared:
        _coupling(equality, gear.joint, gear.of, gear.ratio, 0.0)
    return ET.tostring(root, encoding="unicode")


def _shape(body: ET.Element, name: str, **attributes: str) -> None:
    """A shape that touches only what a pair says."""
    ET.SubElement(body, "geom", {"name": name, "contype": "0", "conaffinity": "0", **attributes})


def spot(start: Array, ahead: float, left: float) -> Array:
    """The point so far ahead of a start (m, m, rad), shape (3,), and left of it (m), shape (2,)."""
    c, s = math.cos(start[2]), math.sin(start[2])
    return np.asarray(start[:2] + np.array([c * ahead - s * left, s * ahead + c * left]))


def _ridge(world: ET.Element, name: str, bump: Ridge, start: Array) -> None:
    """A cylinder with round ends, so far in the ground that it has the bump's height and width."""
    radius = (bump.height**2 + 0.25 * bump.width**2) / (2.0 * bump.height)
    direction = float(start[2]) + bump.angle
    along = np.array([-math.sin(direction), math.cos(direction), 0.0])
    axis = np.array([*spot(start, bump.ahead, 0.0), bump.height - radius])
    ends = numbers([*(axis - 50.0 * along), *(axis + 50.0 * along)])
    _shape(world, name, type="capsule", fromto=ends, size=repr(radius))


def _pair(contact: ET.Element, obstacle: str, foot: Foot, ground: Ground) -> None:
    """A contact; :func:`set_tyres` puts in its stiffness and damping."""
    friction = max(ground.friction, LEAST_FRICTION)
    across = _ROLLING * friction if foot.directed else friction
    pair = {"name": f"{obstacle} {foot.name}", "geom1": obstacle, "geom2": foot.name}
    pair |= {"condim": "3" if foot.friction else "1", "solref": "-1 -1"}
    pair["friction"] = numbers([friction, across, 0.0, 0.0, 0.0])
    pair["solimp"] = numbers([ground.impedance, ground.impedance, 0.001, 0.5, 2.0])
    ET.SubElement(contact, "pair", pair)


def _coupling(equality: ET.Element, joint: str, of: str, ratio: float, offset: float) -> None:
    polynomial = numbers([offset, ratio, 0.0, 0.0, 0.0])
    between = {"joint1": joint, "joint2": of, "polycoef": polynomial}
    ET.SubElement(equality, "joint", {**between, **_RIGID})


def jointed_body(parent: ET.Element, model: pin.Model, joint: int) -> ET.Element:
    """A body with its joint, at the joint's placement, without a mass yet."""
    name, placement = model.names[joint], model.jointPlacements[joint]
    turn = np.roll(pin.Quaternion(placement.rotation).coeffs(), 1)  # from x, y, z, w
    place = {"pos": numbers(placement.translation), "quat": numbers(turn)}
    body = ET.SubElement(parent, "body", {"name": name, **place})
    motion = unit_twist(model, joint)
    kind, direction = ("slide", motion[:3]) if np.any(motion[:3]) else ("hinge", motion[3:])
    armature = repr(float(model.armature[model.joints[joint].idx_v]))
    ET.SubElement(body, "joint", name=name, type=kind, axis=numbers(direction), armature=armature)
    return body


def _mass(body: ET.Element) -> None:
    """A mass that the compiler accepts; :func:`make_model` puts the true one in its place."""
    ET.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")


def numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


# The model --------------------------------------------------------------------------------------------


def make_model(robot: MobileManipulator, xml: str) -> tuple[Any, Any]:
    """MuJoCo's model and state of what :func:`mjcf` wrote, with the robot's masses and inertias.

    They are set after compiling, so that they are the robot's to the last digit or two: the compiler
    balances what violates the triangle inequality, and refuses bodies without mass.
    """
    mj = importlib.import_module("mujoco")
    model = mj.MjModel.from_xml_string(xml)
    base = robot.platform.base_joints
    for i in range(1, robot.model.njoints):
        name, inertia = robot.model.names[i], robot.model.inertias[i]
        if name in robot.platform.virtual_joints or name in base[:-1]:
            continue
        body = model.body(BASE if name in base else name).id
        moments, axes = principal(inertia)
        model.body_mass[body], model.body_inertia[body] = inertia.mass, moments
        model.body_ipos[body], model.body_iquat[body] = inertia.lever, axes
    data = mj.MjData(model)
    mj.mj_setConst(model, data)
    return model, data


def set_tyres(model: Any, mass: float, feet: Sequence[Foot], ground: Ground) -> None:
    """Set stiffness and damping of the contacts, and how friction creeps.

    A contact's force is f = (a_ref - a)/R with a_ref = -D v/d - S r/d, MuJoCo's d and R = (1 - d)/d A
    for the contact's inverse inertia A, which MuJoCo estimates from constants: a spring of stiffness K =
    S/((1 - d) A), a damper, and an inertance 1/R. K carries the static load at the deflection. Friction
    has the same without the spring, with R over impratio; its velocity decays in two steps. The model is
    MuJoCo's, the mass (kg) the robot's, which stands on the feet.
    """
    g, d = float(np.linalg.norm(model.opt.gravity)), ground.impedance
    share = np.array([1.0 if foot.friction else ground.supports for foot in feet])
    load = mass * g / share.sum()
    ids = [model.geom(foot.name).id for foot in feet]
    inverse = np.array([model.body_invweight0[model.geom_bodyid[i], 0] for i in ids])
    stiffness = share * load / ground.deflection * (1.0 - d) * inverse
    # friction / creep = load / creep = (D / d) impratio / R
    needed = load / ground.creep * d * ((1.0 - d) / d * inverse)
    rough, fastest = np.array([foot.friction for foot in feet]), 0.5 * d / model.opt.timestep
    model.opt.impratio = float(needed[rough].max(initial=0.0)) / fastest if rough.any() else 1.0
    for k, s, creep in zip(ids, stiffness, needed / model.opt.impratio, strict=True):
        pairs = np.flatnonzero(model.pair_geom2 == k)
        model.pair_solref[pairs] = -s, -2.0 * ground.damping * math.sqrt(s)
        model.pair_solreffriction[pairs] = -1.0, -creep


def principal(inertia: pin.Inertia) -> tuple[Array, Array]:
    """Principal moments (kg m^2), shape (3,), and the axes as a unit quaternion (w, x, y, z)."""
    moments, axes = np.linalg.eigh(inertia.inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    return moments, np.roll(pin.Quaternion(axes).normalized().coeffs(), 1)
