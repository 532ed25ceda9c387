"""A robot for the page: the tree of its joints, the shapes that they carry, and their ranges.

Shapes are those of its URDFs, or plain ones where it has none.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.model.build import assemble
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.platforms.body import BASE_LINK
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.meshes import mesh_paths
from mobman.robots.urdf.shapes import placement, scalar, vector
from mobman.robots.urdf.validate import shape_of
from mobman.simulation.limits import BEYOND
from mobman.viewer.meshes import Colour, MeshKey, Surface, hollowed, read_meshes

_GREY: Colour = (0.72, 0.74, 0.77, 1.0)
_DARK: Colour = (0.30, 0.33, 0.37, 1.0)
_LIGHT_MARK: Colour = (0.95, 0.95, 0.96, 1.0)
_DARK_MARK: Colour = (0.12, 0.12, 0.14, 1.0)
_SPOKES = 3
_PROUD = 0.01  # Height of a spoke over the wheel's face, of the radius
_ALIGNED = 1e-3
_CLEARANCE = 0.15  # Room about a wheel in its well, of its radius
_MOMENTS = ("xx", "xy", "xz", "yy", "yz", "zz")
_THIN_WALL = 0.5  # Thickness of a wall beside a well that is left out, of the wheel's radius
_THINNEST = 0.005  # Thickness of a plain body whose inertia says less (m)
_LIGHTEST = 300.0
"""Least density of a plain body (kg/m^3): inertias that are much too large are common."""
_ROD = 0.025  # Radius of a skeleton's rods, of the robot's size
_UNBOUNDED = 1e3  # Limits beyond this are none (m, rad)
_REACH = 3.0  # Range of a slider to either side, for what has no limits (m)


@dataclass(frozen=True)
class Primitive:
    """A box, a sphere, or a cylinder along z, about its origin."""

    type: Literal["box", "sphere", "cylinder"]
    size: tuple[float, float, float]  # Along x, y and z (m)

    @property
    def points(self) -> Array:
        """Corners of the box around it (m), shape (8, 3)."""
        return 0.5 * np.array(self.size) * list(product((-1.0, 1.0), repeat=3))

    def described(self) -> dict[str, Any]:
        """The shape for the page."""
        return {"type": self.type, "size": list(self.size)}


def cylinder(radius: float, length: float) -> Primitive:
    """A cylinder along z."""
    return Primitive("cylinder", (2.0 * radius, 2.0 * radius, length))


def sphere(radius: float) -> Primitive:
    """A ball."""
    return Primitive("sphere", (2.0 * radius, 2.0 * radius, 2.0 * radius))


@dataclass(frozen=True, eq=False)
class Part:
    """A shape on a robot."""

    name: str
    joint: int  # The joint that carries it, as Pinocchio counts them
    role: Literal["visual", "collision", "mark"]
    placement: pin.SE3  # In the joint's frame
    shape: Primitive | Surface
    colour: Colour
    link: str = ""  # The link that it is of; empty where it is of none


def robot_scene(
    robot: MobileManipulator, shapes: list[Primitive | Surface]
) -> tuple[dict[str, Any], list[str]]:
    """Describe a robot for the page, and what could not be drawn as it should be; its shapes are added
    to those of the scene, each once. Placements are matrices of shape (4, 4), row by row, in the frame
    of the joint named with them; joint 0 is the world."""
    parts, warnings = robot_parts(robot)
    model = robot.model
    shapes += dict.fromkeys(part.shape for part in parts if part.shape not in shapes)
    places = {shape: i for i, shape in enumerate(shapes)}

    def placed(name: str, joint: int, where: pin.SE3, **rest: Any) -> dict[str, Any]:
        rows = where.homogeneous.ravel().tolist()
        return {"name": name, "joint": int(joint), "placement": rows, **rest}

    described = []
    for part in parts:
        look = {"role": part.role, "shape": places[part.shape], "colour": list(part.colour)}
        described.append(placed(part.name, part.joint, part.placement, **look))
    tip = model.frames[robot.tip_frame]
    return {
        "name": robot.name,
        "joints": [_joint(robot, i) for i in range(1, model.njoints)],
        "parts": described,
        "frames": [
            placed(frame.name, frame.parentJoint, frame.placement)
            for frame in model.frames
            if frame.type == pin.FrameType.BODY
        ],
        "masses": [
            {"joint": i, "mass": float(inertia.mass), "centre": inertia.lever.tolist()}
            for i, inertia in enumerate(model.inertias)
            if i and inertia.mass > 0.0
        ],
        "tip": placed(tip.name, tip.parentJoint, tip.placement),
        "wheels": [wheel._asdict() for wheel in robot.platform.wheels],
        "rest": robot.q_rest.tolist(),
    }, warnings


def _joint(robot: MobileManipulator, index: int) -> dict[str, Any]:
    model = robot.model
    name, q = str(model.names[index]), int(model.joints[index].idx_q)
    axis, turns = _axis(model, index)
    # a slider's range: the limits, or a span about rest where there are none
    rest, lower, upper = (float(v[q]) for v in (robot.q_rest, *robot.limits[:2]))
    span = math.pi if name == "base_theta" else 2.0 * math.pi if turns else _REACH
    return {
        "name": name,
        "parent": int(model.parents[index]),
        "placement": model.jointPlacements[index].homogeneous.ravel().tolist(),
        "axis": axis.tolist(),
        "turns": turns,
        "q": q,
        "lower": lower if abs(lower) < _UNBOUNDED else rest - span,
        "upper": upper if abs(upper) < _UNBOUNDED else rest + span,
        # where there are limits, with what counts as beyond
        "limits": [x if math.isfinite(x) else None for x in (lower - BEYOND, upper + BEYOND)],
    }


def _axis(model: pin.Model, index: int) -> tuple[Array, bool]:
    """A joint's axis in its own frame, a unit vector of shape (3,), and whether it turns about it."""
    column = np.array(model.createData().joints[index].S).reshape(6)
    turns = bool(np.any(column[3:]))
    return (column[3:] if turns else column[:3]), turns


def robot_points(robot: MobileManipulator, q: Array) -> Array:
    """Points that show how much room a robot takes at q, and on the ground (m), shape (N, 3)."""
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    drives = BASE_JOINTS[0] in robot.joint_names
    elsewhere = {"universe", *BASE_JOINTS[:2]} if drives else set()
    points = [
        np.array(placement.translation)
        for frame, placement in zip(model.frames, data.oMf, strict=True)
        if frame.type == pin.FrameType.BODY and model.names[frame.parentJoint] not in elsewhere
    ]
    return np.array([*points, *(point * [1.0, 1.0, 0.0] for point in points)])


def robot_parts(robot: MobileManipulator) -> tuple[list[Part], list[str]]:
    """Find the shapes that a robot is drawn with, and what could not be drawn as it should be.

    A mesh that is missing or broken costs its shape and a warning. A link that then has nothing that
    can be seen, and a joint that carries nothing, is drawn by its collision geometry; if it has none
    either, a wheel is a cylinder, a link the box of its mass and inertia, and a joint without links a
    skeleton of rods from joint to joint. Wheels whose turning would not show are marked; a body that
    the description gives as a box has wells for them.
    """
    parts, problems, lost = _urdf_parts(robot)
    model = robot.model
    base = {model.getJointId(name) for name in BASE_JOINTS[:2] if model.existJointName(name)}

    def unseen() -> tuple[set[int], dict[str, ET.Element]]:
        shown = [part for part in parts if part.role == "visual"]
        joints = set(range(1, model.njoints)) - base - {part.joint for part in shown}
        links = {part.link for part in shown}
        return joints, {name: link for name, link in lost.items() if name not in links}

    bare, hidden = unseen()
    parts += [
        replace(part, role="visual", name=f"{part.name}_shown")
        for part in parts
        if (part.joint in bare or part.link in hidden) and part.role == "collision"
    ]
    parts += list(_wheels(robot, unseen()[0]))
    parts += list(_boxes(robot, unseen()[1]))
    parts += list(_skeleton(robot, unseen()[0]))
    if "body" in robot.spec.platform.parameters:
        parts = [_with_wells(robot, part, parts) for part in parts]
    parts += list(_marks(robot, parts))
    if not problems:
        return parts, []
    first = "; ".join(f"{name} {why}" for name, why in list(problems.items())[:2])
    more = f"; and {len(problems) - 2} more" if len(problems) > 2 else ""
    return parts, [
        f"robot {robot.name!r}: {len(problems)} meshes are not drawn, but collision geometry or plain "
        f"shapes instead: {first}{more}"
    ]


def _urdf_parts(
    robot: MobileManipulator,
) -> tuple[list[Part], dict[str, str], dict[str, ET.Element]]:
    """The shapes that a robot's URDFs give its links; why some are missing, by the mesh's name; and the
    links that had them as visuals."""
    model = robot.model
    problems: dict[str, str] = {}
    lost: dict[str, ET.Element] = {}
    looks: list[tuple[ET.Element, ET.Element, ET.Element, MeshKey | None]] = []
    names: dict[MeshKey, str] = {}
    wanted: dict[MeshKey, bool] = {}  # those that are drawn at once
    for link in assemble(robot.spec, robot.urdf, mesh_paths).robot.iter("link"):
        name = str(link.get("name"))
        for look in [*link.findall("visual"), *link.findall("collision")]:
            shape, key, visual = shape_of(look), None, look.tag == "visual"
            if shape is None:
                continue
            if shape.tag == "mesh":
                filename = shape.get("filename", "").strip()
                if (path := shape.get("path")) is None:
                    problems[repr(filename)] = shape.get("problem", "")
                    lost |= {name: link} if visual else {}
                    continue
                x, y, z = vector(shape, "scale", (1.0, 1.0, 1.0)).tolist()
                key = (Path(path), (x, y, z))
                names[key], wanted[key] = filename, visual or wanted.get(key, False)
            looks.append((link, look, shape, key))
    surfaces, unread = read_meshes(wanted)
    problems |= {repr(names[key]): f"({why})" for key, why in unread.items()}
    parts: list[Part] = []
    for link, look, shape, key in looks:
        name = str(link.get("name"))
        role: Literal["visual", "collision"] = "visual" if look.tag == "visual" else "collision"
        frame = model.frames[model.getFrameId(name, pin.FrameType.BODY)]
        place = frame.placement * pin.SE3(*placement(look))
        own = look.find("material/color")
        if key in unread and role == "visual":
            lost[name] = link
        for one in _primitive(shape) if key is None else surfaces.get(key, []):
            colour = one.colour if isinstance(one, Surface) else None
            if own is not None:
                r, g, b, a = map(float, own.get("rgba", "").split())
                colour = (r, g, b, a)
            called = f"{name}_{role}_{len(parts)}"
            parts.append(Part(called, frame.parentJoint, role, place, one, colour or _GREY, name))
    return parts, problems, lost


def _primitive(element: ET.Element) -> Sequence[Primitive | Surface]:
    """The shape of an element; none for a kind that is not drawn."""
    if element.tag == "box":
        x, y, z = vector(element, "size").tolist()
        return [Primitive("box", (x, y, z))]
    if element.tag == "cylinder":
        return [cylinder(scalar(element, "radius"), scalar(element, "length"))]
    return [sphere(scalar(element, "radius"))] if element.tag == "sphere" else []


def _wheels(robot: MobileManipulator, bare: set[int]) -> Iterator[Part]:
    """Cylinders for wheels that have no shape."""
    for wheel in robot.platform.wheels:
        index = robot.model.getJointId(wheel.joint)
        if index in bare:
            place = _along(_axis(robot.model, index)[0])
            shape = cylinder(wheel.radius, 0.5 * wheel.radius)
            yield Part(f"{wheel.joint}_wheel", index, "visual", place, shape, _DARK)


def _boxes(robot: MobileManipulator, links: Mapping[str, ET.Element]) -> Iterator[Part]:
    """The homogeneous box of each link's mass and inertia, never too light; none for wheels."""
    wheels = {robot.model.getJointId(wheel.joint) for wheel in robot.platform.wheels}
    for name, link in links.items():
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        inertial = link.find("inertial")
        if inertial is None or frame.parentJoint in wheels:
            continue
        mass, about = scalar(inertial.find("mass"), "value"), inertial.find("inertia")
        xx, xy, xz, yy, yz, zz = (scalar(about, "i" + at) for at in _MOMENTS)
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if mass <= 0.0:
            continue
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        squares = 6.0 * (moments.sum() - 2.0 * moments) / mass
        size = np.sqrt(np.maximum(squares, _THINNEST**2))
        x, y, z = (size * min(1.0, np.cbrt(mass / _LIGHTEST / size.prod()))).tolist()
        place = frame.placement * pin.SE3(*placement(inertial)) * pin.SE3(axes, np.zeros(3))
        shape = Primitive("box", (x, y, z))
        yield Part(f"{name}_body", frame.parentJoint, "visual", place, shape, _GREY, name)


def _with_wells(robot: MobileManipulator, part: Part, parts: list[Part]) -> Part:
    """The body, if this is it, with wells for the wheels that it would hide; they are open outwards."""
    if part.link != BASE_LINK or part.role != "visual" or not isinstance(part.shape, Primitive):
        return part
    model, data, box = robot.model, robot.model.createData(), part.shape.points[[0, -1]]
    pin.forwardKinematics(model, data, robot.q_rest)
    body = data.oMi[part.joint] * part.placement
    wells = []
    for wheel in robot.platform.wheels:
        index = model.getJointId(wheel.joint)
        place = body.actInv(data.oMi[index])
        axle = np.abs(place.rotation @ _axis(model, index)[0])
        points = [
            body.actInv(data.oMi[index] * one.placement).act(point)
            for one in parts
            if one.joint == index and one.role == "visual"
            for point in one.shape.points
        ]
        if not points:
            continue
        reach = np.abs(np.array(points) - place.translation).max(axis=0)
        if model.parents[index] != part.joint:  # it is steered
            reach[:2] = np.linalg.norm(reach[:2])
        reach += _CLEARANCE * wheel.radius
        well = np.array([place.translation - reach, place.translation + reach])
        well[0, 2] = -np.inf
        out = int(np.argmax(axle[:2]))
        if side := np.sign(place.translation[out]):
            well[int(side > 0), out] = side * np.inf
        for side in (0, 1):  # no thin walls
            thin = np.abs(well[side, :2] - box[side, :2]) < _THIN_WALL * wheel.radius
            well[side, :2][thin] = (-np.inf, np.inf)[side]
        wells.append(well)
    return replace(part, shape=hollowed(box, wells)) if wells else part


def _skeleton(robot: MobileManipulator, bare: set[int]) -> Iterator[Part]:
    """A ball at each bare joint and rods to the joints that it carries, and to the tip."""
    model = robot.model
    radius = _ROD * float(np.linalg.norm(np.ptp(robot_points(robot, robot.q_rest), axis=0)))
    tip = model.frames[robot.tip_frame]
    for i in sorted(bare):
        carried = [model.jointPlacements[j].translation for j in model.children[i]]
        if tip.parentJoint == i:
            carried.append(tip.placement.translation)
        ball = sphere(1.2 * radius)
        yield Part(f"{model.names[i]}_ball", i, "visual", pin.SE3.Identity(), ball, _DARK)
        for n, end in enumerate(carried):
            length = float(np.linalg.norm(end))
            if length > radius:
                rod, place = cylinder(radius, length), _along(end / length, 0.5 * end)
                yield Part(f"{model.names[i]}_rod_{n}", i, "visual", place, rod, _GREY)


def _marks(robot: MobileManipulator, parts: list[Part]) -> Iterator[Part]:
    """Spokes on wheels that look the same from every side, so that they can be seen to turn."""
    for wheel in robot.platform.wheels:
        index = robot.model.getJointId(wheel.joint)
        axis, _ = _axis(robot.model, index)
        shown = [part for part in parts if part.joint == index and part.role == "visual"]
        if not shown or not all(_is_round(axis, part) for part in shown):
            continue
        along = np.concatenate(
            [
                (part.shape.points @ part.placement.rotation.T + part.placement.translation) @ axis
                for part in shown
            ]
        )
        dark = np.mean([part.colour[:3] for part in shown]) < 0.5
        hub = _along(axis, 0.5 * (along.min() + along.max()) * axis)
        # right through the wheel: it shows on both faces
        r = wheel.radius
        box = Primitive("box", (0.8 * r, 0.12 * r, float(np.ptp(along)) + 2.0 * _PROUD * r))
        for i in range(_SPOKES):
            turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 2.0 * math.pi * i / _SPOKES), np.zeros(3))
            out = pin.SE3(np.eye(3), np.array([0.45 * r, 0.0, 0.0]))
            colour = _LIGHT_MARK if dark else _DARK_MARK
            yield Part(f"{wheel.joint}_mark_{i}", index, "mark", hub * turn * out, box, colour)


def _is_round(axis: Array, part: Part) -> bool:
    """Tell whether a part looks the same when it turns about the axis, or may do so."""
    if isinstance(part.shape, Surface):
        return True  # most wheels' meshes are round, in one colour
    centre = part.placement.translation
    centred = bool(np.linalg.norm(centre - (centre @ axis) * axis) <= _ALIGNED)
    along = abs(float(part.placement.rotation[:, 2] @ axis)) >= 1.0 - _ALIGNED
    return centred and (part.shape.type == "sphere" or (part.shape.type == "cylinder" and along))


def _along(axis: Array, centre: Array | None = None) -> pin.SE3:
    """A placement whose z axis is ``axis``."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.asarray(axis, dtype=float))
    return pin.SE3(turn.toRotationMatrix(), np.zeros(3) if centre is None else np.array(centre))
