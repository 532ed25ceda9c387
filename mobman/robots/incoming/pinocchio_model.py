"""A model of Pinocchio as a URDF: its joints, inertias and frames."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.urdf.compose import add_dynamics, add_inertial, place_joint, text_of

_BASES = ("JointModelFreeFlyer", "JointModelPlanar")


def urdf_of(model: pin.Model) -> str:
    """The URDF of a model: its joints and links have the model's names.

    A joint's link is the first body frame at the joint, or else is named after it; the other body and
    operational frames are links that are fixed to it. A free-flyer or planar joint at the root is left
    out, since the platform takes its place.

    Raises:
        SpecError: If a joint is neither a revolute nor a prismatic one.
    """
    names = [str(name) for name in model.names]
    robot = ET.Element("robot", name=str(model.name) or "robot")
    links = _links(model, names)
    taken, data = set(links), model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for name, inertia in zip(links, model.inertias, strict=True):
        link = ET.SubElement(robot, "link", name=name)
        if inertia.mass > 0.0:
            add_inertial(link, inertia.mass, pin.SE3(np.eye(3), inertia.lever), inertia.inertia)
    for i in range(1, model.njoints):
        parent, kind = int(model.parents[i]), model.joints[i].shortname()
        ends, place = (links[parent], links[i]), model.jointPlacements[i]
        if kind in _BASES and parent == 0:
            place_joint(robot, names[i], "fixed", *ends, place)
        else:
            column = pin.getJointJacobian(model, data, i, pin.ReferenceFrame.LOCAL)
            moves, axis = _motion(model, np.reshape(column, (6, -1))[:, model.joints[i].idx_v], i)
            joint = place_joint(robot, names[i], moves, *ends, place)
            _add_limits(joint, model, i, moves, axis)
    for frame in model.frames:
        own = str(frame.name)
        if frame.type in (pin.FrameType.BODY, pin.FrameType.OP_FRAME) and own not in taken:
            taken.add(own)
            ET.SubElement(robot, "link", name=own)
            at = links[int(frame.parentJoint)]
            place_joint(robot, f"{own}_fixed", "fixed", at, own, frame.placement)
    return ET.tostring(robot, encoding="unicode")


def _links(model: pin.Model, names: Sequence[str]) -> list[str]:
    """A link's name for each joint, the universe first."""
    found: list[str] = []
    bodies = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    for i, name in enumerate(names):
        at_joint = [
            str(frame.name)
            for frame in bodies
            if int(frame.parentJoint) == i
            and frame.placement.isIdentity(1e-12)
            and frame.name not in found
        ]
        own = at_joint[0] if at_joint else ("base" if i == 0 else f"{name}_link")
        while own in found:
            own += "_"
        found.append(own)
    return found


def _motion(model: pin.Model, column: Array, i: int) -> tuple[str, Array]:
    """The type of a joint in a URDF, and its axis, from its columns of the Jacobian in its own frame."""
    joint = model.joints[i]
    if joint.nv == 1:
        linear, angular = column[:3], column[3:]
        if not np.any(angular):
            return "prismatic", linear
        if not np.any(linear):
            return ("continuous" if joint.nq == 2 else "revolute"), angular
    raise SpecError(
        f"joint {model.names[i]!r} of the model is a {joint.shortname()}; allowed: revolute and "
        "prismatic joints, and a free-flyer or planar one at the root"
    )


def _add_limits(joint: ET.Element, model: pin.Model, i: int, kind: str, axis: Array) -> None:
    q, v = model.joints[i].idx_q, model.joints[i].idx_v
    ET.SubElement(joint, "axis", xyz=text_of(axis))
    limits = {"effort": model.effortLimit[v], "velocity": model.velocityLimit[v]}
    if kind != "continuous":
        limits |= {"lower": model.lowerPositionLimit[q], "upper": model.upperPositionLimit[q]}
    # what is as large as the largest numbers is no limit
    ends = {key: np.copysign(np.inf, x) if abs(x) > 1e15 else x for key, x in limits.items()}
    ET.SubElement(joint, "limit", {key: repr(float(value)) for key, value in ends.items()})
    add_dynamics(joint, float(model.damping[v]), float(model.friction[v]))
