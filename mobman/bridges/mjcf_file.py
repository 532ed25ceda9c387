"""MuJoCo's XML: the robot of the plant ``mujoco`` as one file, with its shapes, limits and motors."""

from __future__ import annotations

import importlib
import importlib.util
import math
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from mobman.errors import MobmanError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.contact import MuJoCo
from mobman.simulation.mjcf import BASE, feet_of, mjcf, numbers, principal, set_tyres
from mobman.viewer.meshes import Surface
from mobman.viewer.robot import Part, robot_parts

_STEP, _SAME = 1e-3, 1e-9  # s, kg m^2
_LIGHTEST = 1e-12  # kg, kg m^2: the compiler refuses bodies without mass


def mjcf_content(robot: MobileManipulator) -> tuple[bytes, tuple[str, ...]]:
    """The content of a file, and what is not in it as it is in the robot.

    Inertias are Pinocchio's; meshes are in the file itself, so that it names no other. Joints have their
    limits, and each entry of z a motor with its torque limit, where joints alone move by it. The key
    ``rest`` is ``q_rest``, with the base's frame on the ground. Ground and tyres are those that the
    plant ``mujoco`` has by default.

    Raises:
        MobmanError: If MuJoCo, which checks the file, is not installed or refuses the robot.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise UsageError("MuJoCo's XML needs MuJoCo; install it: pip install 'mobman[mujoco]'")
    mujoco = importlib.import_module("mujoco")
    ground, feet = MuJoCo(), feet_of(robot, scrub=True)
    root = ET.fromstring(mjcf(robot, feet, ground, _STEP, np.array(robot.model.gravity.linear)))
    root.set("model", robot.name)
    root.insert(0, ET.Element("asset"))
    bodies = {str(body.get("name")): body for body in root.iter("body")}
    base = robot.platform.base_joints
    if base:
        bodies[base[-1]] = bodies.pop(BASE)
    remarks = _masses_and_limits(robot, bodies)
    if turning := ", ".join(foot.name for foot in feet if foot.directed):
        remarks.append(
            f"{turning}: XML cannot say friction in a direction that turns, as of rollers"
        )
    remarks += _motors(robot, root, bodies)
    parts, problems = robot_parts(robot)
    carriers = {"universe": next(root.iter("worldbody")), **bodies}
    for i, part in enumerate(parts):
        if part.role != "collision" and (name := str(robot.model.names[part.joint])) in carriers:
            _add_shape(root, carriers[name], part, f"shape_{i}")
    try:
        model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise MobmanError(f"MuJoCo refuses the robot {robot.name!r}: {error}") from error
    if feet:  # stiffness and damping follow from the masses on them
        set_tyres(model, pin.computeTotalMass(robot.model), feet, ground)
        next(root.iter("option")).set("impratio", repr(float(model.opt.impratio)))
        for i, pair in enumerate(root.iter("pair")):
            pair.set("solref", numbers(model.pair_solref[i]))
            pair.set("solreffriction", numbers(model.pair_solreffriction[i]))
    qpos, rest = model.qpos0.copy(), dict(zip(robot.joint_names, robot.q_rest, strict=True))
    for name in bodies.keys() - set(base):
        qpos[model.joint(name).qposadr[0]] = rest[name]
    if base:
        x, y, theta = (rest[name] for name in base)
        at = model.joint(BASE).qposadr[0]
        qpos[at : at + 7] = x, y, 0.0, math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", name="rest", qpos=numbers(qpos))
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8"), (*remarks, *problems)


def _masses_and_limits(robot: MobileManipulator, bodies: dict[str, ET.Element]) -> list[str]:
    """Put in inertias, which MuJoCo would refuse where they are no body's, and ranges; say changes."""
    remarks = []
    for name, body in bodies.items():
        inertia = robot.model.inertias[robot.model.getJointId(name)]
        moments, axes = principal(inertia)
        a, b, c = np.maximum(moments, _LIGHTEST)  # they rise
        if (excess := c - a - b) > 0.0:
            if excess > _SAME:
                remarks.append(f"the inertia of {name} is that of no body; two moments are larger")
            a, b = a + excess, b + excess
        own = {"mass": repr(max(float(inertia.mass), _LIGHTEST)), "pos": numbers(inertia.lever)}
        own |= {"diaginertia": numbers((a, b, c)), "quat": numbers(axes)}
        next(body.iter("inertial")).attrib |= own
    for name, lower, upper in zip(robot.joint_names, *robot.limits[:2], strict=True):
        if name in bodies and np.isfinite([lower, upper]).all() and lower < upper:
            next(bodies[name].iter("joint")).set("range", numbers((lower, upper)))
    return remarks


def _motors(robot: MobileManipulator, root: ET.Element, bodies: dict[str, ET.Element]) -> list[str]:
    """A motor for each entry of z, by the joints that its torque acts on."""
    tendons, actuators = ET.SubElement(root, "tendon"), ET.SubElement(root, "actuator")
    B, remarks = robot.actuation(robot.q_rest), []
    for name, column, limit in zip(robot.velocity_names, B.T, robot.limits.torque, strict=True):
        driven = {robot.joint_names[i]: float(column[i]) for i in np.flatnonzero(column)}
        if not driven.keys() <= bodies.keys() - set(robot.platform.base_joints):
            remarks.append(f"{name} has no motor: it acts on the platform's pose")
            continue
        tendon = ET.SubElement(tendons, "fixed", name=name)
        for joint, share in driven.items():
            ET.SubElement(tendon, "joint", joint=joint, coef=repr(share))
        motor = ET.SubElement(actuators, "motor", name=name, tendon=name)
        if math.isfinite(limit):
            motor.set("ctrlrange", numbers((-limit, limit)))
    return remarks


def _add_shape(root: ET.Element, body: ET.Element, part: Part, name: str) -> None:
    """A shape as it is drawn; it touches nothing and weighs nothing."""
    shape, place = part.shape, part.placement
    if isinstance(shape, Surface):
        own = {"type": "mesh", "mesh": name}
        mesh = {"vertex": numbers(shape.vertices.ravel()), "inertia": "shell"}  # it may be open
        mesh["face"] = " ".join(map(str, shape.faces.ravel()))
        ET.SubElement(next(root.iter("asset")), "mesh", {"name": name, **mesh})
    else:
        x, y, z = 0.5 * np.array(shape.size)
        sizes = {"box": (x, y, z), "sphere": (x,), "cylinder": (x, z)}
        own = {"type": shape.type, "size": numbers(sizes[shape.type])}
    turn = np.roll(pin.Quaternion(place.rotation).coeffs(), 1)
    own |= {"rgba": numbers(part.colour), "pos": numbers(place.translation), "quat": numbers(turn)}
    untouched = {"contype": "0", "conaffinity": "0", "group": "2", "mass": "0"}
    ET.SubElement(body, "geom", {**untouched, **own})
