"""What a robot is drawn with: its URDF's shapes, or clean primitives where it has none."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.meshes import MeshError
from mobman.viewer.meshes import can_reduce, read_mesh, reduced
from mobman.viewer.shapes import Box, Colour, Cylinder, Mesh, Shape, Sphere
from mobman.viewer.urdf_looks import Look, MeshFile, looks
from mobman.viewer.wheel_marks import wheel_marks

GREY: Colour = (0.72, 0.74, 0.77, 1.0)
DARK: Colour = (0.30, 0.33, 0.37, 1.0)
_TRIANGLES = {"visual": 2500, "collision": 500}
"""Most of one mesh."""
_ALL_TRIANGLES = 50_000
"""Most of all meshes of a robot together; a page stays small, and plays without a graphics
card."""
_FEWEST = 100
_SKELETON = 0.035
"""Radius of a skeleton's rods, of the robot's extent."""


@dataclass(frozen=True, eq=False)
class Part:
    """A shape on a robot."""

    name: str
    joint: int
    """The joint that carries it, as Pinocchio counts them."""
    role: str
    """``"visual"``, ``"collision"`` or ``"mark"``."""
    placement: Array
    """In the joint's frame, shape (4, 4)."""
    shape: Shape
    colour: Colour


@dataclass(frozen=True)
class Body:
    """A robot's parts, and what could not be drawn as it should be."""

    parts: tuple[Part, ...]
    warnings: tuple[str, ...]


def body(robot: MobileManipulator) -> Body:
    """What a robot is drawn with.

    A mesh that is missing or broken costs its shape and a warning. A joint that then carries nothing
    that can be seen is drawn by its collision geometry; if it has none either, by a skeleton of rods
    from joint to joint. Wheels whose turning would not show are marked.
    """
    problems: dict[str, str] = {}
    parts = _drawn(robot, looks(robot), problems)
    model = robot.model
    bare = set(range(1, model.njoints)) - {part.joint for part in parts if part.role == "visual"}
    bare -= {model.getJointId(name) for name in BASE_JOINTS[:2] if model.existJointName(name)}
    stand_ins = [
        replace(part, role="visual", name=f"{part.name}_shown")
        for part in parts
        if part.joint in bare and part.role == "collision"
    ]
    bare -= {part.joint for part in stand_ins}
    parts += stand_ins
    parts += _wheels(robot, bare)
    parts += _skeleton(robot, bare)
    parts += [
        Part(f"{joint}_mark_{i}", index, "mark", placement, shape, colour)
        for joint, index, marks in _marks(robot, parts)
        for i, (placement, shape, colour) in enumerate(marks)
    ]
    return Body(tuple(parts), tuple(_told(robot, problems)))


def _told(robot: MobileManipulator, problems: dict[str, str]) -> list[str]:
    if not problems:
        return []
    first = "; ".join(f"{name} {why}" for name, why in list(problems.items())[:2])
    more = f"; and {len(problems) - 2} more" if len(problems) > 2 else ""
    return [
        f"robot {robot.name!r}: {len(problems)} meshes are not drawn, but collision geometry or plain "
        f"shapes instead: {first}{more}"
    ]


def _drawn(robot: MobileManipulator, found: list[Look], problems: dict[str, str]) -> list[Part]:
    model = robot.model
    meshes: dict[tuple[Path, tuple[float, float, float]], list[Mesh]] = {}
    seen = {
        (look.shape.path, look.shape.scale)
        for look in found
        if isinstance(look.shape, MeshFile) and look.shape.path and look.use == "visual"
    }
    for look in found:
        shape = look.shape
        if not isinstance(shape, MeshFile):
            continue
        if shape.path is None:
            problems[repr(shape.name)] = shape.problem
            continue
        key = (shape.path, shape.scale)
        if key not in meshes:
            try:
                meshes[key] = read_mesh(*key, coloured=key in seen)
            except MeshError as error:
                problems[repr(shape.name)] = f"({error})"
    meshes = _reduced(meshes, seen)
    parts: list[Part] = []
    for look in found:
        frame = model.frames[model.getFrameId(look.link, pin.FrameType.BODY)]
        placement = (frame.placement * look.placement).homogeneous
        shape = look.shape
        if isinstance(shape, MeshFile):
            shapes: list[Shape] = (
                [] if shape.path is None else list(meshes.get((shape.path, shape.scale), []))
            )
        else:
            shapes = [shape]
        for one in shapes:
            own = one.colour if isinstance(one, Mesh) else None
            name = f"{look.link}_{look.use}_{len(parts)}"
            colour = look.colour or own or GREY
            parts.append(Part(name, frame.parentJoint, look.use, placement, one, colour))
    return parts


def _reduced(
    meshes: dict[tuple[Path, tuple[float, float, float]], list[Mesh]],
    seen: set[tuple[Path, tuple[float, float, float]]],
) -> dict[tuple[Path, tuple[float, float, float]], list[Mesh]]:
    """Every mesh at what can be seen of it, and all together at what a page can carry."""
    if not can_reduce():
        return meshes
    wanted = {
        key: min(
            sum(len(p.faces) for p in parts), _TRIANGLES["visual" if key in seen else "collision"]
        )
        for key, parts in meshes.items()
    }
    share = min(1.0, _ALL_TRIANGLES / max(1, sum(wanted.values())))
    result = {}
    for key, parts in meshes.items():
        total = sum(len(part.faces) for part in parts)
        keep = share * wanted[key] / total if total else 1.0
        result[key] = [
            reduced(part, max(_FEWEST, math.ceil(keep * len(part.faces)))) for part in parts
        ]
    return result


def _placements(robot: MobileManipulator) -> list[pin.SE3]:
    """Where the joints are at rest, in the world; of the joints at q = 0 of their own, by index."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.q_rest)
    return [pin.SE3(placement) for placement in data.oMi]


def _extent(robot: MobileManipulator) -> float:
    """Largest distance of joints and tip at rest (m)."""
    base = {*BASE_JOINTS[:2], "universe"}
    points = [
        placement.translation
        for name, placement in zip(robot.model.names, _placements(robot), strict=True)
        if name not in base
    ]
    points.append(robot.tip_pose(robot.q_rest).translation)
    return float(max(np.linalg.norm(a - b) for a in points for b in points)) or 1.0


def _wheels(robot: MobileManipulator, bare: set[int]) -> list[Part]:
    """Cylinders for wheels that have no shape; they leave ``bare``."""
    parts = []
    for wheel in robot.platform.wheels:
        index = robot.model.getJointId(wheel.joint)
        if index in bare:
            bare.discard(index)
            parts.append(
                Part(
                    f"{wheel.joint}_wheel",
                    index,
                    "visual",
                    _along(joint_axis(robot, index), np.zeros(3)),
                    Cylinder(wheel.radius, 0.5 * wheel.radius),
                    DARK,
                )
            )
    return parts


def _skeleton(robot: MobileManipulator, bare: set[int]) -> Iterable[Part]:
    """A ball at each bare joint and rods to the joints that it carries, and to the tip."""
    if not bare:
        return
    model = robot.model
    radius = _SKELETON * _extent(robot)
    tip = model.frames[robot.tip_frame]
    for i in sorted(bare):
        carried = [model.jointPlacements[j].translation for j in model.children[i]]
        if tip.parentJoint == i:
            carried.append(tip.placement.translation)
        at = np.eye(4)
        yield Part(f"{model.names[i]}_ball", i, "visual", at, Sphere(1.2 * radius), DARK)
        for n, end in enumerate(carried):
            length = float(np.linalg.norm(end))
            if length > radius:
                placement = _along(end / length, 0.5 * np.asarray(end))
                rod = Cylinder(radius, length)
                yield Part(f"{model.names[i]}_rod_{n}", i, "visual", placement, rod, GREY)


def _marks(
    robot: MobileManipulator, parts: list[Part]
) -> Iterable[tuple[str, int, list[tuple[Array, Box, Colour]]]]:
    for wheel in robot.platform.wheels:
        index = robot.model.getJointId(wheel.joint)
        shown = [part for part in parts if part.joint == index and part.role == "visual"]
        yield (
            wheel.joint,
            index,
            wheel_marks(
                joint_axis(robot, index),
                wheel.radius,
                [(part.placement, part.shape, part.colour) for part in shown],
            ),
        )


def joint_axis(robot: MobileManipulator, index: int) -> Array:
    """Unit vector along or about which a joint moves, in its own frame, shape (3,)."""
    column = motion_column(robot.model, index)
    part = column[3:] if np.any(column[3:]) else column[:3]
    return np.array(part / np.linalg.norm(part))


def motion_column(model: pin.Model, index: int) -> Array:
    """What a joint's rate moves, linear part first, in the joint's frame, shape (6,)."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
    return np.array(local[:, model.joints[index].idx_v])


def _along(axis: Array, centre: Array) -> Array:
    """A placement whose z axis is ``axis``, shape (4, 4)."""
    z = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z, np.asarray(axis, dtype=float)).toRotationMatrix()
    return np.array(pin.SE3(turn, np.asarray(centre, dtype=float)).homogeneous)
