"""SDF, Gazebo's format, as a URDF: links, joints, inertias, shapes and frames of its model."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.urdf import compose
from mobman.robots.urdf.compose import place_joint, text_of
from mobman.robots.urdf.validate import SHAPES, listed, number, numbers

_MOVING = ("revolute", "continuous", "prismatic")
_NONE = 1e15  # SDF writes 1e16 for no limit
_NOT_READ = (
    "sensor", "plugin", "light", "projector", "audio_source", "particle_emitter", "battery",
)  # fmt: skip
_MODEL, _WORLD = "__model__", "world"


def urdf_of(sdf: ET.Element, where: str) -> tuple[str, list[str]]:
    """The URDF of an SDF's only model, and what of it a URDF cannot hold; SpecError if it has no model
    or several, one within another, or a number or frame is wrong."""
    models = [*sdf.findall("model"), *sdf.findall("world/model")]
    moving = [one for one in models if any(j.get("type") in _MOVING for j in one.findall("joint"))]
    if len(moving) != 1:
        named = f" ({listed(one.get('name', '') for one in moving)})" if moving else ""
        raise SpecError(f"{where} has {len(moving)} models with joints{named}; allowed: one")
    made = _Model(moving[0], sdf.get("version", "1.7"), where)
    if others := [one.get("name", "") for one in models if one is not moving[0]]:
        made.said.append(f"left out, since they are no part of the robot: {listed(others)}")
    return ET.tostring(made.robot, encoding="unicode"), made.said


class _Model:
    """A URDF that grows from a model.

    SDF puts every frame anywhere; the frame of a URDF's link is that of its joint. Where SDF has the
    link's own frame elsewhere, a link without mass stands in between.
    """

    def __init__(self, model: ET.Element, version: str, where: str) -> None:
        self._model, self._where = model, where
        self._version = tuple(int(part) for part in version.split(".") if part.isdecimal())
        self.robot = ET.Element("robot", name=model.get("name", ""))
        self.said: list[str] = []
        self._frames: dict[str, tuple[str, pin.SE3]] = {_MODEL: ("", pin.SE3.Identity())}
        self._known: dict[str, pin.SE3] = {}
        joints = model.findall("joint")
        for tag in ("model", "include"):
            if model.find(tag) is not None:
                advice = "models within others are not read; write them out as one (gz sdf -p)"
                raise self._wrong(f"<{tag}> within a model: {advice}")
        links, frames = model.findall("link"), model.findall("frame")
        for element in (*links, *joints, *frames):
            self._add_frame(element)
        if _WORLD not in self._frames:  # a link may be called so
            self._frames[_WORLD] = (_MODEL, pin.SE3.Identity())
            if any(_text(joint, "parent") == _WORLD for joint in joints):
                ET.SubElement(self.robot, "link", name=_WORLD)
        for joint in joints:
            for end in (_text(joint, "parent"), _text(joint, "child")):
                if end not in self._frames:
                    raise self._wrong(f"joint {joint.get('name', '')!r}: {end!r} is no link")
        for name in self._frames:
            self._place(name)
        for link in links:
            self._add_link(link)
        for joint in joints:
            self._add_joint(joint)
        for frame in frames:
            name, of = frame.get("name", ""), self._attached(frame)
            ET.SubElement(self.robot, "link", name=name)
            place_joint(self.robot, f"{name}_fixed", "fixed", of, name, self._between(of, name))
        for plugin in model.iter("plugin"):  # some names tell what kind of platform it is
            names = {key: plugin.get(key, "") for key in ("name", "filename")}
            ET.SubElement(ET.SubElement(self.robot, "gazebo"), "plugin", names)
        if found := Counter(part.tag for part in model.iter() if part.tag in _NOT_READ):
            counts = ", ".join(f"{count} {tag}" for tag, count in found.items())
            self.said.append(f"a URDF has no place for these, which are left out: {counts}")
        if bare := [link.get("name", "") for link in links if link.find("inertial") is None]:
            self.said.append(f"links without <inertial> have 1 kg, as SDF says: {listed(bare)}")

    # Frames ---------------------------------------------------------------------------------------

    def _wrong(self, text: str) -> SpecError:
        return SpecError(f"{self._where}: {text}")

    def _add_frame(self, element: ET.Element) -> None:
        name, pose = element.get("name", ""), element.find("pose")
        if not name or name in self._frames:
            raise self._wrong(f"{element.tag} {name!r} has no name, or one that is there already")
        usual = {"joint": _text(element, "child"), "frame": element.get("attached_to", _MODEL)}
        to = "" if pose is None else pose.get("relative_to", pose.get("frame", ""))
        self._frames[name] = (to or usual.get(element.tag, _MODEL), self._pose(pose, name))

    def _attached(self, frame: ET.Element) -> str:
        """The link that a frame is fixed to, through frames and joints in between."""
        seen, name = set[str](), frame.get("attached_to", "")
        elements = {e.get("name", ""): e for e in self._model if e.tag in ("frame", "joint")}
        while name in elements and name not in seen:
            seen.add(name)
            element = elements[name]
            to = element.get("attached_to", "")
            name = _text(element, "child") if element.tag == "joint" else to
        first = self._model.find("link")
        return name if name not in ("", _MODEL) or first is None else first.get("name", "")

    def _place(self, name: str, seen: tuple[str, ...] = ()) -> pin.SE3:
        """A frame in the model's."""
        if name not in self._frames or name in seen:
            what = "is defined by itself" if name in seen else "is not there"
            raise self._wrong(f"the frame {name!r} {what}")
        if name not in self._known:
            to, pose = self._frames[name]
            self._known[name] = pose if not to else self._place(to, (*seen, name)) * pose
        return self._known[name]

    def _between(self, one: str, other: str) -> pin.SE3:
        return self._place(one).actInv(self._place(other))

    def _pose(self, element: ET.Element | None, owner: str) -> pin.SE3:
        text = "" if element is None else element.text or ""
        if element is None or not text.strip():
            return pin.SE3.Identity()
        values, quaternion = numbers(text), element.get("rotation_format") == "quat_xyzw"
        count = 7 if quaternion else 6
        if values is None or len(values) != count or (quaternion and not any(values[3:])):
            which = " (of a quaternion that is not 0)" if quaternion else ""
            allowed = f"{count} finite numbers{which}"
            raise self._wrong(f"<pose> of {owner!r} is {element.text!r}; allowed: {allowed}")
        if quaternion:
            x, y, z, w = values[3:]
            rotation = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
        else:
            unit = math.pi / 180.0 if element.get("degrees") in ("true", "1") else 1.0
            rotation = pin.rpy.rpyToMatrix(*(unit * v for v in values[3:]))
        return pin.SE3(rotation, np.array(values[:3]))

    # Links and joints -----------------------------------------------------------------------------

    def _number(self, element: ET.Element | None, path: str, default: float) -> float:
        found = None if element is None else element.find(path)
        if found is None:
            return default
        text = (found.text or "").strip()
        value = number(text)
        if value is None and text.lstrip("+-").lower() in ("inf", "infinity"):
            value = float(text)
        if value is None:
            raise self._wrong(f"<{found.tag}> is {found.text!r}; allowed: a number")
        return value

    def _add_link(self, link: ET.Element) -> None:
        name, inertial = link.get("name", ""), link.find("inertial")
        element = ET.SubElement(self.robot, "link", name=name)
        at = self._pose(None if inertial is None else inertial.find("pose"), name)
        moments = np.zeros((3, 3))
        for i, j in zip(*np.triu_indices(3), strict=True):
            path = f"inertia/i{'xyz'[i]}{'xyz'[j]}"
            moments[i, j] = moments[j, i] = self._number(inertial, path, float(i == j))
        compose.add_inertial(element, self._number(inertial, "mass", 1.0), at, moments)
        for use in ("visual", "collision"):
            for part in link.findall(use):
                self._add_part(element, part, use)

    def _add_part(self, link: ET.Element, part: ET.Element, use: str) -> None:
        name, pose = part.get("name", ""), part.find("pose")
        shape = next(part.iterfind("geometry/*"), None)
        at = self._pose(pose, name)
        if pose is not None and (to := pose.get("relative_to", "")):
            at = self._between(link.get("name", ""), to) * at
        if shape is None or shape.tag not in (*SHAPES, "capsule"):
            tag = "" if shape is None else shape.tag
            self.said.append(f"a URDF has no geometry {tag!r}: {use} {name!r} is left out")
            return
        own = {child.tag: " ".join((child.text or "").split()) for child in shape}
        if shape.tag == "capsule":  # with SDF's defaults
            sizes = (("radius", 0.5), ("length", 1.0))
            own = {key: repr(self._number(shape, key, usual)) for key, usual in sizes}
        if shape.tag == "mesh":
            own = {"filename": _text(shape, "uri"), "scale": own.get("scale") or "1 1 1"}
        compose.add_shape(link, use, shape.tag, own, at)

    def _add_joint(self, joint: ET.Element) -> None:
        name, given, axis = joint.get("name", ""), joint.get("type", ""), joint.find("axis")
        parent, child = _text(joint, "parent"), _text(joint, "child")
        kind = given if given in _MOVING else "fixed"
        if kind == "fixed" and given != "fixed":
            self.said.append(f"a URDF has no {given} joint: {name!r} is held")
        lower, upper = (self._number(axis, f"limit/{end}", s * math.inf) for end, s in _BOUNDS)
        if kind == "revolute" and min(abs(lower), abs(upper)) > _NONE:
            kind = "continuous"
        carried, own = child, self._between(name, child)
        if not own.isIdentity(1e-12):
            carried = f"{name}__frame"
            ET.SubElement(self.robot, "link", name=carried)
            place_joint(self.robot, f"{name}__to_link", "fixed", carried, child, own)
        at = self._between(parent, name)
        element = place_joint(self.robot, name, kind, parent, carried, at)
        if kind == "fixed" or axis is None:
            return
        ET.SubElement(element, "axis", xyz=text_of(self._axis(axis, name)))
        limit = {key: self._number(axis, f"limit/{key}", -1.0) for key in ("effort", "velocity")}
        if kind != "continuous":
            for key, value in (("lower", lower), ("upper", upper)):
                limit[key] = value if abs(value) < _NONE else math.copysign(math.inf, value)
        ET.SubElement(element, "limit", {key: repr(value) for key, value in limit.items()})
        forces = (self._number(axis, f"dynamics/{k}", 0.0) for k in ("damping", "friction"))
        compose.add_dynamics(element, *forces)
        if self._number(axis, "dynamics/spring_stiffness", 0.0):
            self.said.append(f"a URDF has no spring: joint {name!r}")
        if (mimic := axis.find("mimic")) is not None:
            keys = (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
            ratio, offset, reference = (self._number(mimic, key, usual) for key, usual in keys)
            law = {"multiplier": repr(ratio), "offset": repr(offset - ratio * reference)}
            ET.SubElement(element, "mimic", {"joint": mimic.get("joint", ""), **law})

    def _axis(self, axis: ET.Element, joint: str) -> Array:
        """The direction of a joint's axis in its own frame, shape (3,)."""
        element = axis.find("xyz")
        values = numbers("0 0 1" if element is None else element.text or "")
        if values is None or len(values) != 3:
            raise self._wrong(f"<xyz> of joint {joint!r} is no vector of 3 numbers")
        to = "" if element is None else element.get("expressed_in", "")
        # until 1.6 a flag said so; before 1.5 it was always the model's frame
        usual = "true" if self._version < (1, 5) else "false"
        flag = axis.findtext("use_parent_model_frame", usual)
        if not to and self._version < (1, 7) and flag.strip() in ("true", "1"):
            to = _MODEL
        rotation = self._between(joint, to).rotation if to else np.eye(3)
        return np.array(rotation @ np.array(values))


_BOUNDS = (("lower", -1.0), ("upper", 1.0))


def _text(element: ET.Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()
