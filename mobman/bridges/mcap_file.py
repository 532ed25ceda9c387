"""MCAP: a run for Foxglove, its numbers to plot and its frames and robot in 3-D."""

from __future__ import annotations

import io
import json
import math
from typing import Any, cast

import numpy as np
import pinocchio as pin

from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.record import Record
from mobman.version import __version__
from mobman.viewer.meshes import Surface
from mobman.viewer.robot import Part, robot_parts
from mobman.viewer.scene import frames

_WORLD = "world"
_TEXTS = ("robot", "controller", "task", "scenario", "status", "message", "created")
_TYPES = {bool: "boolean", int: "integer", str: "string"}
_KINDS = {"box": "cubes", "sphere": "spheres", "cylinder": "cylinders"}
_OTHERS = ("arrows", "lines", "triangles", "texts", "models")


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
