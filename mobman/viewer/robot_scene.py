"""A robot as the page needs it: the tree of its joints, what they carry, and its limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.viewer.body_parts import Body, body, motion_column
from mobman.viewer.encoding import rows
from mobman.viewer.shapes import Shape

_UNBOUNDED = 1e3
"""Limits beyond this are none (m, rad)."""
_REACH = 3.0
"""How far a slider moves the platform to either side (m)."""
_TURN = 2.0 * np.pi


class Geometries:
    """The shapes of a scene, each once however many parts have it."""

    def __init__(self) -> None:
        self.described: list[dict[str, Any]] = []
        self._places: dict[int, int] = {}
        self._kept: list[Shape] = []  # so that no other shape gets the identity of one of them

    def place(self, shape: Shape) -> int:
        """Where the shape is in the list."""
        if id(shape) not in self._places:
            self._places[id(shape)] = len(self.described)
            self._kept.append(shape)
            self.described.append(shape.described())
        return self._places[id(shape)]


def robot_scene(
    robot: MobileManipulator, geometries: Geometries
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """A robot for the page, and what could not be drawn as it should be.

    Placements are matrices of shape (4, 4), row by row, in the frame of the joint named beside them;
    joint 0 is the world.
    """
    drawn: Body = body(robot)
    model = robot.model
    tip = model.frames[robot.tip_frame]
    content = {
        "name": robot.name,
        "joints": [_joint(robot, i) for i in range(1, model.njoints)],
        "parts": [
            {
                "name": part.name,
                "joint": int(part.joint),
                "role": part.role,
                "placement": rows(part.placement),
                "shape": geometries.place(part.shape),
                "colour": list(part.colour),
            }
            for part in drawn.parts
        ],
        "frames": [
            {
                "name": frame.name,
                "joint": int(frame.parentJoint),
                "placement": rows(frame.placement.homogeneous),
            }
            for frame in model.frames
            if frame.type == pin.FrameType.BODY
        ],
        "masses": [
            {"joint": i, "mass": float(inertia.mass), "centre": rows(inertia.lever)}
            for i, inertia in enumerate(model.inertias)
            if i and inertia.mass > 0.0
        ],
        "tip": {
            "name": robot.tip,
            "joint": int(tip.parentJoint),
            "placement": rows(tip.placement.homogeneous),
        },
        "wheels": [wheel._asdict() for wheel in robot.platform.wheels],
        "rest": rows(robot.q_rest),
    }
    return content, drawn.warnings


def _joint(robot: MobileManipulator, index: int) -> dict[str, Any]:
    model = robot.model
    name = str(model.names[index])
    column = motion_column(model, index)
    turns = bool(np.any(column[3:]))
    q = int(model.joints[index].idx_q)
    lower, upper = _range(robot, name, q, turns)
    return {
        "name": name,
        "parent": int(model.parents[index]),
        "placement": rows(model.jointPlacements[index].homogeneous),
        "axis": rows(column[3:] if turns else column[:3]),
        "turns": turns,
        "q": q,
        "lower": lower,
        "upper": upper,
        "base": name in BASE_JOINTS,
    }


def _range(robot: MobileManipulator, name: str, q: int, turns: bool) -> tuple[float, float]:
    """What a slider moves the joint between: its limits, or a span about rest where it has none."""
    rest = float(robot.q_rest[q])
    lower, upper = float(robot.limits.lower[q]), float(robot.limits.upper[q])
    span = np.pi if name == "base_theta" else _TURN if turns else _REACH
    return (
        lower if abs(lower) < _UNBOUNDED else rest - span,
        upper if abs(upper) < _UNBOUNDED else rest + span,
    )


def platform_point(robot: MobileManipulator, q: Array) -> Array:
    """Where the platform's reference point is on the ground (m), shape (N, 3), for q of shape
    (N, nq)."""
    points = np.zeros((len(q), 3))
    for column, name in enumerate(BASE_JOINTS[:2]):
        if name in robot.joint_names:
            points[:, column] = q[:, robot.joint_names.index(name)]
    return points
