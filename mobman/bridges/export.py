"""Files for other tools: CSV, MCAP (a run for Foxglove), and MuJoCo's XML (the robot of the plant
``mujoco`` with its shapes, limits and motors)."""

from __future__ import annotations

import importlib
import importlib.util
import io
import json
import math
import os
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, cast

import numpy as np
import pinocchio as pin

from mobman.errors import MobmanError, UsageError
from mobman.files import as_path, write_all
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.contact import MuJoCo
from mobman.simulation.mjcf import BASE, feet_of, mjcf, numbers, principal, set_tyres
from mobman.simulation.record import Record, load_record
from mobman.version import __version__
from mobman.viewer.meshes import Surface
from mobman.viewer.robot import Part, robot_parts
from mobman.viewer.scene import frames, robot_of_run

SUFFIXES = (".csv", ".mcap", ".xml")
_WORLD = "world"
_TEXTS = ("robot", "controller", "task", "scenario", "status", "message", "created")
_TYPES = {bool: "boolean", int: "integer", str: "string"}
_KINDS = {"box": "cubes", "sphere": "spheres", "cylinder": "cylinders"}
_OTHERS = ("arrows", "lines", "triangles", "texts", "models")
_STEP, _SAME = 1e-3, 1e-9  # s, kg m^2
_LIGHTEST = 1e-12  # kg, kg m^2: the compiler refuses bodies without mass


def export(what: Record | MobileManipulator | str | os.PathLike[str], path: Any) -> tuple[str, ...]:
    """Write a run as CSV (``.csv``) or MCAP (``.mcap``), or a robot as MuJoCo's XML (``.xml``).

    >>> import mobman as mm
    >>> from mobman.bridges.export import export
    >>> record = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05)
    >>> export(record, "run.csv")
    ()

    Args:
        what: A record or its file, or for MuJoCo a robot by name, file or object; of a record its robot.
        path: The file; one that is there is replaced. What is not in it as it should be is returned.

    Raises:
        MobmanError: If the suffix is another, what it needs is not installed, the record or the robot
            cannot be read, or the file cannot be written.
    """
    file = as_path("path", path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError(f"cannot export to {file.name}: allowed: {', '.join(SUFFIXES)}")
    folder = None
    if isinstance(what, (str, os.PathLike)):
        given = Path(what)
        if given.suffix.lower() in (".h5", ".hdf5"):
            what, folder = load_record(given), given.absolute().parent
        elif suffix == ".xml":
            what = load_robot(what)
    record = what if isinstance(what, Record) else None
    robot = what if isinstance(what, MobileManipulator) else None
    problem, remarks = f"{what!r}", tuple[str, ...]()
    if record is None and suffix != ".xml":
        raise UsageError(f"{what!r} is no record, which a {suffix} file is made of")
    if record is not None and suffix != ".csv":
        robot, problem = robot_of_run(record, folder)
    if record is not None and suffix == ".csv":
        content = csv_content(record)
    elif record is not None and suffix == ".mcap":
        content, remarks = mcap_content(record, robot)
        remarks += (f"the robot is left out: {problem}",) if robot is None else ()
    elif robot is not None:
        content, remarks = mjcf_content(robot)
    else:
        raise MobmanError(f"there is no robot to write: {problem}")
    write_all({file: content})
    return remarks


def csv_content(record: Record) -> bytes:
    """The content of a file with a row a sample, and columns as :meth:`mobman.Record.to_pandas` names
    them, with units: ``t [s]``, ``torque/alpha_1 [N m or N]``. Numbers come back to the last bit."""
    frame = record.to_pandas()
    units = {name: f"{name} [{unit}]" for name, (_, unit) in frame.attrs["places"].items()}
    text = frame.rename(columns=units).to_csv(index_label="t [s]", lineterminator="\n")
    return bytes(text.encode())


# MCAP -------------------------------------------------------------------------------------------------


def mcap_content(record: Record, robot: MobileManipulator | None) -> tuple[bytes, tuple[str, ...]]:
    """The content of an MCAP file, and what could not be drawn in it.

    Every sample is a message of each of the topics ``/q``, ``/z``, ``/torque``, ``/error/task``, ...
    (the places in the record's file), with ``t`` (s) and each component that is finite. About 60 times a
    second there are the joints' frames (``/tf``), and the poses of tip and base (``/tip/pose``,
    ``/base/pose``); once, the robot's shapes (``/scene``). Log times are those of the run, from 0.

    Without a robot there are the numbers alone. UsageError if the library is not installed.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise UsageError("MCAP needs a library; install it: pip install 'mobman[mcap]'") from error
    output, channels = io.BytesIO(), dict[str, int]()
    writer = Writer(output)
    writer.start(library=f"mobman {__version__}")
    texts = {name: str(getattr(record, name)) for name in _TEXTS}
    writer.add_metadata("mobman", {**texts, "metrics": json.dumps(record.metrics)})

    def write(topic: str, schema: str, t: float, message: Any, like: Any = None) -> None:
        if topic not in channels:
            described = json.dumps({"title": schema, **_schema(like or message)}).encode()
            kind = writer.register_schema(schema, "jsonschema", described)
            channels[topic] = writer.register_channel(topic, "json", kind)
        data, time = json.dumps(message, allow_nan=False).encode(), round(t * 1e9)
        writer.add_message(channels[topic], time, data, time)

    frame = record.to_pandas()
    groups: dict[str, dict[str, list[float]]] = {}
    for column, (place, _) in frame.attrs["places"].items():
        name = column[len(place) + 1 :] or "value"
        groups.setdefault(place, {})[name] = frame[column].tolist()
    warnings: list[str] = []
    if robot is not None:
        parts, warnings = robot_parts(robot)
        entities = [_entity(part, robot.model) for part in parts if part.role != "collision"]
        scene = {"deletions": [], "entities": entities}
        write("/scene", "foxglove.SceneUpdate", float(record.t[0]), scene)
    shown = set(frames(record.t).tolist())
    for k, t in enumerate(record.t.tolist()):
        for place, columns in groups.items():
            row = {name: x for name, own in columns.items() if math.isfinite(x := own[k])}
            like = {"t": t, **dict.fromkeys(columns, 0.0)}
            write(f"/{place}", f"mobman.{place}", t, {"t": t, **row}, like)
        if robot is None or k not in shown:
            continue
        poses = {"tip": robot.tip_pose(record.q[k])}
        joints = dict(zip(robot.model.names, robot.data.oMi, strict=True))
        transforms = []
        for name, place in list(joints.items())[1:]:  # the first is the universe
            pose = _pose(place)
            ends = {"timestamp": _time(t), "parent_frame_id": _WORLD, "child_frame_id": str(name)}
            moved = {"translation": pose["position"], "rotation": pose["orientation"]}
            transforms.append({**ends, **moved})
        write("/tf", "foxglove.FrameTransforms", t, {"transforms": transforms})
        if base := robot.platform.base_joints:
            poses["base"] = joints[base[-1]]
        for name, pose in poses.items():
            posed = {"timestamp": _time(t), "frame_id": _WORLD, "pose": _pose(pose)}
            write(f"/{name}/pose", "foxglove.PoseInFrame", t, posed)
    cast(Any, writer).finish()
    return output.getvalue(), tuple(warnings)


def _entity(part: Part, model: pin.Model) -> dict[str, Any]:
    """A shape of the robot, which moves with its joint's frame."""
    shape, kind = part.shape, "triangles"
    more: dict[str, Any] = {"pose": _pose(part.placement), "color": _named("rgba", part.colour)}
    if isinstance(shape, Surface):
        colours = shape.vertex_colours
        shades = np.zeros((0, 3)) if colours is None else colours[:, :3] / 255.0
        more["colors"] = [_named("rgba", (*shade, 1.0)) for shade in shades]
        more["points"] = [_named("xyz", vertex) for vertex in shape.vertices]
        more["indices"] = shape.faces.ravel().tolist()
    else:
        kind, more["size"] = _KINDS[shape.type], _named("xyz", shape.size)
        more |= {"bottom_scale": 1.0, "top_scale": 1.0} if kind == "cylinders" else {}
    frame = str(model.names[part.joint]) if part.joint else _WORLD
    head = {"timestamp": _time(0.0), "frame_id": frame, "id": part.name, "lifetime": _time(0.0)}
    kinds: dict[str, Any] = {one: [] for one in (*_KINDS.values(), *_OTHERS)}
    return {**head, "frame_locked": True, "metadata": [], **kinds, kind: [more]}


def _schema(value: Any) -> dict[str, Any]:
    """The JSON schema of a value."""
    if isinstance(value, dict):
        return {"type": "object", "properties": {key: _schema(part) for key, part in value.items()}}
    if isinstance(value, list):
        return {"type": "array", "items": _schema(value[0]) if value else {}}
    return {"type": _TYPES.get(type(value), "number")}


def _time(t: float) -> dict[str, int]:
    return dict(zip(("sec", "nsec"), divmod(round(t * 1e9), 10**9), strict=True))


def _named(letters: str, values: Any) -> dict[str, float]:
    return dict(zip(letters, map(float, values), strict=True))


def _pose(place: pin.SE3) -> dict[str, Any]:
    turn = _named("xyzw", pin.Quaternion(place.rotation).coeffs())
    return {"position": _named("xyz", place.translation), "orientation": turn}


# MuJoCo's XML -----------------------------------------------------------------------------------------


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
    if some := ", ".join(foot.name for foot in feet if foot.directed):
        remarks.append(f"{some}: XML cannot say friction in a direction that turns, as of rollers")
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
