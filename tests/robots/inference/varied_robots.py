"""Mobile manipulators made at random, each with the truth about it.

The truth is kept while the robot is made, and read by homogeneous transforms of its own: nothing here
uses the product, nor Pinocchio.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from made_urdf import write_wheel_stl

Z = np.array([0.0, 0.0, 1.0])
STYLES = {  # how makers call the wheel of a side (and of an end), and its link
    "side_first": "{side}_{end}wheel_joint",
    "wheel_first": "wheel_{end}{side}_joint",
    "camel": "{Side}{End}Wheel",
    "letters": "joint_{e}{s}_wheel",
    "namespace": "robot/{end}{side}_wheel_joint",
    "foreign": "rueda {end}{side} wheel #1",
}


@dataclass
class Joint:
    """A joint as the truth knows it."""

    name: str
    kind: str
    parent: str
    child: str
    place: np.ndarray
    axis: np.ndarray
    limits: tuple[float, float] | None = None
    follows: tuple[str, float, float] | None = None


@dataclass
class Wheel:
    """A wheel as the truth knows it: of a joint, in the base's frame."""

    joint: str
    centre: np.ndarray
    ahead: np.ndarray
    slips: str = ""
    """``""`` in no direction, ``"sideways"``, or ``"mecanum"``: across its roller."""
    roller: np.ndarray | None = None
    inset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """From the joint's frame to the middle of the tyre (m)."""


@dataclass
class Truth:
    """What a reader must find of a robot."""

    types: tuple[str, ...] = ()
    radius: float = 0.1
    wheels: list[Wheel] = field(default_factory=list)
    right: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    steering: list[str] = field(default_factory=list)
    rolling: list[str] = field(default_factory=list)
    """Wheels that roll and are not driven."""
    arm: list[str] = field(default_factory=list)
    tip: str = ""
    ground: float = 0.0
    """Height in the base's frame (m)."""
    turret: bool = False
    """What steers is between the body and the carriage."""
    either_way: bool = False
    """Nothing tells which way is forward."""
    said: list[str] = field(default_factory=list)
    """Words of warnings that must be there."""
    refused: list[str] = field(default_factory=list)
    """Words of the question, one of them at least, where it must not be taken as it is."""
    answer: list[str] = field(default_factory=list)
    """Options with which it must be taken then; none: nothing helps."""
    tolerance: float = 1e-6
    """Of velocities at the contact for rates of the order of 1 (m/s)."""


def turned(rpy: Sequence[float]) -> np.ndarray:
    roll, pitch, yaw = rpy
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles(rotation: np.ndarray) -> list[float]:
    """Roll, pitch, yaw of a rotation."""
    pitch = math.asin(max(-1.0, min(1.0, -rotation[2, 0])))
    if abs(rotation[2, 0]) > 1.0 - 1e-12:
        return [0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])]
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    return [roll, pitch, math.atan2(rotation[1, 0], rotation[0, 0])]


def about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation about a unit vector (Rodrigues)."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k


def place(xyz: Sequence[float] = (0.0, 0.0, 0.0), rotation: np.ndarray | None = None) -> np.ndarray:
    t = np.eye(4)
    t[:3, 3] = xyz
    if rotation is not None:
        t[:3, :3] = rotation
    return t


class Varied:
    """A robot of a seed: its URDF and the truth.

    Args:
        seed: Of all choices.
        folder: Where its meshes go.
        kind: Of the base, see ``BASES``; by default any.
        fault: What is odd about it, see ``FAULTS``; by default any, or nothing.
    """

    def __init__(self, seed: int, folder: Path, kind: str = "", fault: str | None = None) -> None:
        self.random, self.folder = np.random.default_rng(seed), folder
        self.truth = Truth()
        self.joints: dict[str, Joint] = {}
        self.links: dict[str, ET.Element] = {}
        self.extra: list[ET.Element] = []
        self.kind = kind or self.any(list(BASES))
        self.fault = self.any(["", "", *FAULTS]) if fault is None else fault
        self.style = self.any([*STYLES, "numbers"])
        self.inset = self.between(0.02, 0.08) if self.chance(0.15) else 0.0
        self.suspended = self.chance(0.12)
        if self.kind not in ("differential", "four", "six"):
            self.inset = self.suspended = 0.0
        self.fault = "" if self.fault in ("no_radius", "millimetres") and self.inset else self.fault
        self.shape = self.any(["cylinder", "sphere", "mesh", "mesh mm", "visual", "hub and tyre"])
        self.count, self.made = 0, list[Wheel]()
        self.inset = 0.0 if "mesh" in self.shape else self.inset
        self._base()
        BASES[self.kind](self)
        self._casters()
        self._arm()
        self._beside()
        if self.fault:
            FAULTS[self.fault](self)
        self.urdf = self._write()

    # Choices

    def any(self, choices: Sequence):
        return choices[int(self.random.integers(len(choices)))]

    def chance(self, share: float) -> bool:
        return bool(self.random.random() < share)

    def between(self, low: float, high: float) -> float:
        return round(float(self.random.uniform(low, high)), 3)

    # Links and joints

    def link(self, name: str, mass: float = 1.0) -> ET.Element:
        link = self.links[name] = ET.Element("link", name=name)
        if mass:
            inertial = ET.SubElement(link, "inertial")
            at = self.random.uniform(-0.02, 0.02, 3)
            rpy = self.random.uniform(-3, 3, 3) if self.chance(0.5) else np.zeros(3)
            ET.SubElement(inertial, "origin", xyz=text(at), rpy=text(rpy))
            ET.SubElement(inertial, "mass", value=str(mass))
            moments = 0.01 * mass * self.random.uniform(0.8, 1.2, 3)
            inertia = dict(zip(("ixx", "iyy", "izz"), map(str, moments), strict=True))
            ET.SubElement(inertial, "inertia", inertia | dict.fromkeys(("ixy", "ixz", "iyz"), "0"))
        return link

    def shown(
        self,
        link: ET.Element,
        kind: str,
        attributes: dict,
        at: np.ndarray | None = None,
        uses: Iterable[str] = ("visual", "collision"),
    ) -> None:
        for use in uses:
            part = ET.SubElement(link, use)
            ET.SubElement(
                part,
                "origin",
                xyz=text((at if at is not None else place())[:3, 3]),
                rpy=text(angles((at if at is not None else place())[:3, :3])),
            )
            ET.SubElement(
                ET.SubElement(part, "geometry"), kind, {k: str(v) for k, v in attributes.items()}
            )

    def joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        at: np.ndarray,
        axis: np.ndarray = Z,
        limits: tuple[float, float] | None = None,
        follows: tuple[str, float, float] | None = None,
    ) -> Joint:
        self.joints[name] = Joint(
            name, kind, parent, child, at, np.asarray(axis, float), limits, follows
        )
        return self.joints[name]

    def fixed(self, parent: str, child: str, at: np.ndarray) -> None:
        self.joint(f"{child}_fixed", "fixed", parent, child, at)

    def detour(self, parent: str, at: np.ndarray) -> tuple[str, np.ndarray]:
        """A parent and a place that are the same, by some fixed links in between."""
        while self.chance(0.35):
            self.count += 1
            name = f"plate_{self.count}"
            step = place(
                self.random.uniform(-0.2, 0.2, 3), turned(self.random.uniform(-1.5, 1.5, 3))
            )
            self.link(name, mass=0.0)
            self.fixed(parent, name, step)
            parent, at = name, np.linalg.inv(step) @ at
        return parent, at

    def place_of(self, link: str, q: dict[str, float] | None = None) -> np.ndarray:
        """A link's frame in the base's, with the joints at q."""
        at, q = np.eye(4), q or {}
        above = {joint.child: joint for joint in self.joints.values()}
        while link != "chassis":
            joint = above[link]
            step = place()
            value = self.position(joint, q)
            if joint.kind == "prismatic":
                step = place(joint.axis * value)
            elif joint.kind != "fixed":
                step = place(rotation=about(joint.axis, value))
            at, link = joint.place @ step @ at, joint.parent
        return at

    def position(self, joint: Joint, q: dict[str, float]) -> float:
        if joint.follows is None:
            return q.get(joint.name, 0.0)
        of, ratio, offset = joint.follows
        return ratio * self.position(self.joints[of], q) + offset

    def reach(self) -> float:
        """From joint to joint of the arm and to the tip, with all that slides extended (m)."""
        at = [self.place_of(self.joints[name].child)[:3, 3] for name in self.truth.arm]
        at.append(self.place_of(self.truth.tip)[:3, 3])
        length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(at))
        way = dict.fromkeys(self.truth.arm, 0.0)
        for joint in self.joints.values():
            if joint.kind == "prismatic" and joint.limits is not None:
                if joint.name in way:
                    length += joint.limits[1] - joint.limits[0]
                elif joint.follows and joint.follows[0] in way:
                    length += joint.follows[1] * (joint.limits[1] - joint.limits[0])
        return length

    # The base

    def _base(self) -> None:
        truth = self.truth
        truth.radius = self.between(0.04, 0.18)
        self.track = self.between(0.25, 0.6)
        self.length = self.between(0.3, 0.8)
        self.up = self.between(0.0, 0.2) if self.chance(0.5) else 0.0
        truth.ground = -self.up  # the chassis' frame is so high
        self.axle = truth.radius - self.up
        chassis = self.link("chassis", mass=self.between(10, 60))
        height = self.between(0.1, 0.25)
        self.top = self.axle + height
        middle = place((0.0, 0.0, self.axle + height / 2))
        self.shown(chassis, "box", {"size": f"{self.length} {0.8 * self.track} {height}"}, middle)

    def wheel(
        self,
        end: str,
        side: str,
        xyz: Sequence[float],
        yaw: float = 0.0,
        parent: str = "chassis",
        radius: float = 0.0,
        slips: str = "",
        driven: bool = True,
        at: np.ndarray | None = None,
    ) -> Wheel:
        """A wheel whose axle points to the left of the direction ``yaw``, in the base's frame."""
        self.count += 1
        radius = radius or self.truth.radius
        name = self._wheel_name(end, side)
        link = f"{name}_link" if self.chance(0.6) else name  # links and joints may share names
        # the axle is some axis of the joint's frame, which is turned anyhow
        local = self.any(
            [np.eye(3)[1], -np.eye(3)[1], np.eye(3)[2], -np.eye(3)[2], np.eye(3)[0], None]
        )
        if local is None:
            local = self.random.standard_normal(3)
            local /= np.linalg.norm(local)
        left = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
        way = left * (1.0 if self.chance(0.7) else -1.0)
        rotation = carry(local, way) @ about(local, self.between(-3, 3))
        whole = place(xyz, rotation)
        if at is not None:  # in the frame of the joint that carries it
            whole = np.linalg.inv(at) @ whole
        inset = np.zeros(3)
        if self.inset and slips in ("", "sideways"):
            inset = np.array([0.0, math.copysign(self.inset, xyz[1]), 0.0])
            whole = place(-inset) @ whole
        if self.suspended:
            spring = f"spring_{self.count}"
            self.link(spring, 0.5)
            self.joint(f"{spring}_joint", "prismatic", parent, spring, place(xyz), Z, (-0.01, 0.01))
            parent, whole = spring, place(-np.asarray(xyz)) @ whole
        parent, whole = self.detour(parent, whole)
        element = self.link(link, mass=self.between(0.5, 3))
        self._tyre(element, local, radius, local * float(inset @ way))
        limits = None
        kind = "continuous"
        if self.chance(0.2):
            kind, limits = "revolute", self.any([(-1e16, 1e16), (-math.inf, math.inf), (-1e3, 1e3)])
        self.joint(name, kind, parent, link, whole, local, limits)
        wheel = Wheel(
            name,
            np.asarray(xyz, float),
            np.array([math.cos(yaw), math.sin(yaw), 0.0]),
            slips,
            inset=inset,
        )
        self.made.append(wheel)
        if driven:
            self.truth.wheels.append(wheel)
        return wheel

    def _wheel_name(self, end: str, side: str) -> str:
        if self.style == "numbers" or (self.style == "letters" and "drive" in side):
            return f"j{self.count}"
        gap = f"{end}_" if end else ""
        words = {"end": gap, "side": side, "e": end[:1], "s": side[:1]}
        words |= {"End": end.title(), "Side": side.title()}
        return STYLES[self.style].format(**words)

    def _tyre(self, link: ET.Element, local: np.ndarray, radius: float, out: np.ndarray) -> None:
        along = carry(Z, local)  # the cylinder's z along the axle
        width = round(0.3 * radius, 4)
        if self.shape in ("mesh", "mesh mm"):
            scale = 1.0 if self.shape == "mesh" else 1000.0
            file = f"{link.get('name', '').replace('/', '_')}.stl"
            write_wheel_stl(self.folder / file, radius * scale, width * scale, sides=64)
            unit = f"{1 / scale} {1 / scale} {1 / scale}"
            self.shown(link, "mesh", {"filename": file, "scale": unit}, place(out, along))
        elif self.shape == "sphere":
            self.shown(link, "sphere", {"radius": radius}, place(out), uses=["collision"])
        elif self.shape == "visual":
            self.shown(
                link, "cylinder", {"radius": radius, "length": width}, place(out, along), ["visual"]
            )
        else:
            self.shown(link, "cylinder", {"radius": radius, "length": width}, place(out, along))
        if self.shape == "hub and tyre":
            hub = {"radius": 0.4 * radius, "length": 2 * width}
            self.shown(link, "cylinder", hub, place(out, along), ["collision"])

    def differential(self) -> None:
        self.truth.types = ("differential",)
        x = self.between(-0.1, 0.1) if self.chance(0.4) else 0.0
        for side, y in (("right", -self.track / 2), ("left", self.track / 2)):
            wheel = self.wheel("", side, (x, y, self.axle))
            getattr(self.truth, side).append(wheel.joint)

    def six(self) -> None:
        self.four()
        for side, y in (("right", -self.track / 2), ("left", self.track / 2)):
            wheel = self.wheel("middle", side, (0.0, y, self.axle), slips="sideways")
            getattr(self.truth, side).append(wheel.joint)

    def turret(self) -> None:
        """A body that turns on a differential carriage, which is behind the turret's joint."""
        self.differential()
        self.truth.types, self.truth.steering = ("turret",), ["turret_joint"]
        x = self.any([-1.0, 1.0]) * self.between(0.05, 0.15)  # of the turret from the axle
        at = place((x + self.truth.wheels[0].centre[0], 0.0, self.axle + 0.02))
        self.link("carriage", 5.0)
        kind, limits = self.any([("continuous", None), ("revolute", (-3.14, 3.14))])
        self.joint("turret_joint", kind, "chassis", "carriage", at, Z, limits)
        for wheel in self.truth.wheels:
            self._hang(wheel.joint, "carriage", at)
        self.truth.right = self.truth.left = []
        self.truth.either_way = self.truth.turret = True

    def followed(self) -> None:
        """Four wheels of which the rear ones follow by <mimic>."""
        self.four()
        for side in (self.truth.right, self.truth.left):
            self.joints[side[1]].follows = (side[0], self._alike(*side), 0.0)

    def _alike(self, one: str, other: str) -> float:
        """+1 if two wheels roll forward at rates of one sign, else -1."""
        ways = [
            self.place_of(self.joints[n].child)[:3, :3] @ self.joints[n].axis for n in (one, other)
        ]
        return float(np.sign(ways[0] @ ways[1]))

    def four(self, types: tuple[str, ...] = ("skid-steer",), slips: str = "sideways") -> None:
        self.truth.types = types
        for end, x in (("front", self.length / 2), ("rear", -self.length / 2)):
            for side, y in (("right", -self.track / 2), ("left", self.track / 2)):
                wheel = self.wheel(end, side, (x, y, self.axle), slips=slips)
                getattr(self.truth, side).append(wheel.joint)
                # rollers that touch the ground form an O
                turn = math.pi / 4 * (1.0 if (end == "front") == (side == "right") else -1.0)
                wheel.roller = np.array([math.cos(turn), math.sin(turn), 0.0])

    def mecanum(self) -> None:
        self.four(("omnidirectional",), "mecanum")
        self.extra.append(
            ET.fromstring('<gazebo><plugin filename="libmecanum_drive.so" name="d"/></gazebo>')
        )

    def omni(self) -> None:
        self.truth.types, count = ("omnidirectional",), self.any([3, 3, 4])
        first, circle = self.between(-3, 3), self.between(0.12, 0.35)
        if self.shape == "sphere":
            self.shape = "cylinder"
        for i in range(count):
            angle = first + 2 * math.pi * i / count
            spot = (circle * math.cos(angle), circle * math.sin(angle), self.axle)
            # its axle points outwards
            self.wheel("", f"drive{i}", spot, yaw=angle - math.pi / 2, slips="sideways")
        self.truth.either_way = True

    def car(self) -> None:
        self.truth.types = ("car-like",)
        self.four(("car-like",), "")
        rear = [w for w in self.truth.wheels if w.centre[0] < 0]
        front = [w for w in self.truth.wheels if w.centre[0] > 0]
        self.truth.right, self.truth.left = ([w.joint] for w in rear)
        limit = self.between(0.3, 0.9)
        for side, wheel in zip(("right", "left"), front, strict=True):
            knuckle, sign = f"{side}_knuckle", self.any([1.0, -1.0])
            name = f"{side}_steering_joint"
            at = place(wheel.centre, turned([0.0 if sign > 0 else math.pi, 0.0, 0.0]))
            self.link(knuckle)
            parent, seen = self.detour("chassis", at)
            self.joint(name, "revolute", parent, knuckle, seen, Z, (-limit, limit))
            self._hang(wheel.joint, knuckle, at)
            self.truth.steering.append(name)
        self.truth.wheels, self.truth.rolling = rear, [w.joint for w in front]

    def truck(self) -> None:
        """A car with an axle more behind, which is steered as well."""
        self.car()
        self.truth.types = ("multi-axle",)
        front = [*self.truth.rolling]
        for side, y in (("right", -self.track / 2), ("left", self.track / 2)):
            centre = np.array([-0.75 * self.length, y, self.axle])
            wheel = self.wheel("last", side, centre, driven=False)
            name, knuckle, at = f"last_{side}_steering", f"last_{side}_knuckle", place(centre)
            self.link(knuckle)
            self.joint(name, "revolute", "chassis", knuckle, at, Z, (-0.5, 0.5))
            self._hang(wheel.joint, knuckle, at)
            self.truth.steering.append(name)
            front.append(wheel.joint)
        every = {w.joint: w for w in self.made}
        self.truth.rolling, self.truth.right, self.truth.left = [], [], []
        self.truth.wheels += [every[name] for name in front]

    def _hang(self, wheel: str, knuckle: str, at: np.ndarray) -> None:
        """Hang a wheel that is on the chassis on another link, where it is."""
        joint = self.joints[wheel]
        joint.place = np.linalg.inv(at) @ self.place_of(joint.parent) @ joint.place
        joint.parent = knuckle

    def swerve(self) -> None:
        self.four(("swerve",), "")
        self.truth.right = self.truth.left = []
        endless, beside = self.chance(0.5), self.between(-0.03, 0.03) if self.chance(0.5) else 0.0
        for i, wheel in enumerate(self.truth.wheels):
            name, knuckle = f"steer_{i}_joint", f"module_{i}"
            at = place(wheel.centre + beside * np.eye(3)[1])
            self.link(knuckle)
            self.joint(
                name,
                "continuous" if endless else "revolute",
                "chassis",
                knuckle,
                at,
                Z,
                None if endless else (-2.0, 2.0),
            )
            self._hang(wheel.joint, knuckle, at)
            self.truth.steering.append(name)
        self.truth.either_way = True

    def virtual(self) -> None:
        """Planar joints in front of a base whose wheels are fixed."""
        self.truth.types = ("planar",)
        self.truth.refused, self.truth.answer = ["--platform"], ["--platform", "planar"]
        self.truth.either_way = True
        for end, x in (("front", self.length / 2), ("rear", -self.length / 2)):
            for side, y in (("right", -self.track / 2), ("left", self.track / 2)):
                wheel = self.wheel(end, side, (x, y, self.axle), driven=False)
                self.joints[wheel.joint].kind = "fixed"

    def planar(self) -> None:
        """Planar joints, as simulators want them, in front of a base that has no wheels."""
        self.truth.types, self.truth.either_way = ("planar",), True
        self.truth.ground = self.axle  # the body's underside: nothing else is known
        self.in_front = self.any([["x", "y", "turn"], ["turn", "x", "turn2"], ["y", "x", "turn"]])
        if "y" not in self.in_front:  # it may be that of a base that rolls along its heading
            self.truth.refused, self.truth.answer = ["--platform"], ["--platform", "planar"]

    # All the rest

    def _casters(self) -> None:
        if self.kind not in ("differential",) or self.chance(0.3):
            return
        x = self.any([-1, 1]) * (self.length / 2)
        kind = self.any(["ball", "swivel", "limited swivel"])
        for i, y in enumerate([0.0] if self.chance(0.5) else [-0.1, 0.1]):
            name = self.any(["caster", "castor_wheel", "support"]) + f"_{i}"
            radius = self.any([0.4, 0.6]) * self.truth.radius
            spot = np.array([x, y, self.truth.ground + radius])
            if kind == "ball":
                ball = self.link(name)
                self.shown(ball, "sphere", {"radius": radius}, uses=["collision"])
                self.fixed("chassis", name, place(spot))
                continue
            self.link(f"{name}_fork", 0.3)
            swivel = (f"{name}_swivel", "continuous", None)
            if kind == "limited swivel":
                swivel = (f"{name}_swivel", "revolute", (-math.pi, math.pi))
            self.joint(
                swivel[0],
                swivel[1],
                "chassis",
                f"{name}_fork",
                place(spot + radius * Z),
                Z,
                swivel[2],
            )
            rolling = self.link(f"{name}_roll", 0.3)
            along = place(rotation=carry(Z, np.eye(3)[1]))
            self.shown(rolling, "cylinder", {"radius": radius, "length": 0.02}, along)
            self.joint(
                f"{name}_rolls",
                "continuous",
                f"{name}_fork",
                f"{name}_roll",
                place((-0.03, 0.0, -radius)),
                np.eye(3)[1],
            )

    def _arm(self) -> None:
        truth, prefix = self.truth, self.any(["arm_", "", "manipulator/", "A"])
        x = self.between(0.0, self.length / 2 - 0.05)
        at = place((x, 0.0, self.top), turned([0, 0, self.any([0.0, 0.0, 0.5, -1.57])]))
        parent = "chassis"
        if self.chance(0.25):  # a lift, of two stages at times
            self.link("lift_1")
            rise = self.between(0.2, 0.5)
            self.joint("lift_joint", "prismatic", parent, "lift_1", at, Z, (0.0, rise))
            truth.arm.append("lift_joint")
            parent, at = "lift_1", place((0, 0, 0.05))
            if self.chance(0.4):
                self.link("lift_2")
                ratio = self.any([1.0, 0.5])
                self.joint(
                    "lift_follower",
                    "prismatic",
                    parent,
                    "lift_2",
                    at,
                    Z,
                    (0.0, rise),
                    ("lift_joint", ratio, 0.0),
                )
                parent = "lift_2"
        axes = ["z", "y", "y", "x", "y", "x", "z"][: self.any([4, 5, 6, 7])]
        for i, axis in enumerate(axes):
            name, link = f"{prefix}joint{i + 1}", f"{prefix}link{i + 1}"
            if i == 1 and self.chance(0.2):
                link = name  # the same name for both
            wanted = np.eye(3)["xyz".index(axis)] * self.any([1.0, -1.0])
            local = self.any([np.eye(3)[2], np.eye(3)[1], -np.eye(3)[0]])
            rotation = carry(local, wanted)
            parent, seen = self.detour(parent, at @ place(rotation=rotation))
            low, high = -self.between(1.2, 3.1), self.between(1.2, 3.1)
            if self.chance(0.1):
                low, high = 0.1, 2.5  # 0 is outside
            limits, kind = (low, high), "revolute"
            if self.chance(0.08):
                limits, kind = None, "continuous"
            self.shown(self.link(link), "sphere", {"radius": 0.02}, uses=["visual"])
            self.joint(name, kind, parent, link, seen, local, limits)
            truth.arm.append(name)
            step = (
                (0.0, 0.0, self.between(0.08, 0.2))
                if axis == "z"
                else (self.between(0.1, 0.35), 0.0, 0.0)
            )
            parent, at = link, place(rotation=rotation.T) @ place(step)
        self.end = (parent, at)
        truth.tip = parent
        if self.chance(0.8):
            truth.tip = self.any(
                ["tool0", "tcp", "gripper_tcp", "ee_link", "end_effector", "tool_frame"]
            )
            self.link(truth.tip, mass=0.0)
            self.fixed(parent, truth.tip, at)
            parent = truth.tip
        fingers = self.any([0, 0, 1, 2, 3])
        for i in range(fingers):
            turn, name = 2 * math.pi * i / 3, f"finger_{i}"
            self.shown(self.link(f"{name}_link", 0.05), "box", {"size": "0.04 0.01 0.01"})
            grip = place((0.03, 0.02 * math.cos(turn), 0.02 * math.sin(turn)))
            follows = ("finger_0_joint", 1.0, 0.0) if i else None
            kind, limits = self.any([("prismatic", (0.0, 0.04)), ("revolute", (0.0, 0.8))])
            self.joint(
                f"{name}_joint", kind, parent, f"{name}_link", grip, np.eye(3)[1], limits, follows
            )

    def _beside(self) -> None:
        """A head, sensors, and what is around the robot."""
        if self.chance(0.4):
            self.link("head_pan_link")
            self.link("head_tilt_link")
            at = place((-0.05, 0.0, self.top + 0.3))
            self.joint("head_pan_joint", "revolute", "chassis", "head_pan_link", at, Z, (-1.5, 1.5))
            self.joint(
                "head_tilt_joint",
                "revolute",
                "head_pan_link",
                "head_tilt_link",
                place((0.05, 0, 0)),
                np.eye(3)[1],
                (-0.5, 0.9),
            )
        if self.chance(0.5):
            self.link("camera_link", 0.1)
            self.fixed("chassis", "camera_link", place((self.length / 2, 0, self.top)))
            self.link("laser_frame", 0.0)
            self.fixed("camera_link", "laser_frame", place((0.01, 0, 0.02)))
        self.yaw = self.any([0.0, 0.0, 0.0, math.pi / 2, -math.pi / 2, math.pi, 0.4])
        self.root, below = "chassis", "chassis"
        for way in reversed(getattr(self, "in_front", [])):
            name = f"world_{way}"
            self.link(name, 0.0)
            axis = {"x": np.eye(3)[0], "y": np.eye(3)[1]}.get(way, Z)
            kind, limits = ("continuous", None) if "turn" in way else ("prismatic", (-10, 10))
            self.joint(f"{name}_joint", kind, name, below, place(), axis, limits)
            self.root = below = name
        if self.style == "numbers" and abs(self.yaw) > 1.0:
            self.truth.either_way = True  # the root link's x axis says otherwise
        if self.kind != "planar" and (self.chance(0.5) or self.yaw):
            self.root = self.any(["base_footprint", "base_link", "world_frame"])
            drop = self.truth.ground if "footprint" in self.root else self.between(-0.1, 0.1)
            self.link(self.root, mass=0.0)
            # the base stands in the root's frame, turned by yaw
            self.fixed(self.root, "chassis", place((0.0, 0.0, -drop), turned([0, 0, self.yaw])))
            self.drop = drop

    def _write(self) -> Path:
        robot = ET.Element("robot", name=f"varied_{self.kind}")
        parts = [*self.links.values(), *map(self._element, self.joints.values()), *self.extra]
        if self.chance(0.6):
            self.random.shuffle(parts)
        robot.extend(parts)
        path = self.folder / "varied.urdf"
        path.write_text(ET.tostring(robot, encoding="unicode"), encoding="utf-8")
        return path

    def _element(self, joint: Joint) -> ET.Element:
        element = ET.Element("joint", name=joint.name, type=joint.kind)
        children = [
            ET.Element("parent", link=joint.parent),
            ET.Element("child", link=joint.child),
            ET.Element(
                "origin", xyz=text(joint.place[:3, 3]), rpy=text(angles(joint.place[:3, :3]))
            ),
        ]
        if joint.kind != "fixed":
            long = self.any([1.0, 1.0, 2.0, 0.5])  # axes need not be unit vectors
            children.append(ET.Element("axis", xyz=text(long * joint.axis)))
            if joint.limits is not None:
                low, high = (str(value) for value in joint.limits)
                children.append(
                    ET.Element("limit", lower=low, upper=high, effort="300", velocity="5")
                )
            if joint.follows is not None:
                of, ratio, offset = joint.follows
                law = {"multiplier": str(ratio), "offset": str(offset)}
                children.append(ET.Element("mimic", {"joint": of, **law}))
        self.random.shuffle(children)
        element.extend(children)
        return element

    # Faults -------------------------------------------------------------------------------------

    def no_arm(self) -> None:
        keep = {"chassis", self.root}
        while True:
            more = {
                j.child
                for j in self.joints.values()
                if j.parent in keep and j.child not in keep and not set(self.truth.arm) & {j.name}
            }
            if not more:
                break
            keep |= more
        gone = [n for n in self.links if n not in keep]
        self.links = {n: e for n, e in self.links.items() if n in keep}
        self.joints = {n: j for n, j in self.joints.items() if j.child in keep}
        assert gone
        self.joints = {n: j for n, j in self.joints.items() if not n.startswith("head_")}
        self.links = {n: e for n, e in self.links.items() if not n.startswith("head_")}
        self.truth.refused, self.truth.answer = ["--mount"], []

    def no_radius(self) -> None:
        """Wheels without geometry, and nothing else that stands on the ground."""
        for wheel in self.truth.wheels:
            link = self.links[self.joints[wheel.joint].child]
            for part in [*link.findall("visual"), *link.findall("collision")]:
                link.remove(part)
        footprint = "footprint" in self.root
        casters = any(
            "caster" in name or "castor" in name or "support" in name for name in self.links
        )
        if not (footprint or casters) and self.truth.wheels and self.kind != "virtual":
            self.truth.refused = ["--wheel-radius"]
            self.truth.answer = ["--wheel-radius", str(self.truth.radius)]

    def millimetres(self) -> None:
        """A mesh in millimetres without a scale."""
        if not self.truth.wheels:
            return
        for name in (*(w.joint for w in self.truth.wheels), *self.truth.rolling):
            link = self.links[self.joints[name].child]
            for part in [*link.findall("visual"), *link.findall("collision")]:
                link.remove(part)
            write_wheel_stl(self.folder / "tyre.stl", 1000 * self.truth.radius, 20.0, sides=64)
            local = self.joints[name].axis
            self.shown(link, "mesh", {"filename": "tyre.stl"}, place(rotation=carry(Z, local)))
        self.truth.refused = ["millimetres"]
        self.truth.answer = ["--wheel-radius", str(self.truth.radius), "--as-it-is"]

    def on_its_side(self) -> None:
        if self.kind in ("differential", "turret", "car") and abs(math.sin(self.yaw)) > 0.5:
            return  # it stands on its two wheels with its nose up: that may be meant
        axis, rpy = self.any([("y", [-math.pi / 2, 0, 0]), ("-y", [math.pi / 2, 0, 0])])
        self.links["lying"] = ET.Element("link", name="lying")
        self.joint("lying_fixed", "fixed", "lying", self.root, place(rotation=turned(rpy)))
        self.truth.answer += ["--up", axis]
        self.truth.refused = ["--up", "--platform"]
        self.truth.either_way = True

    def silly_geometry(self) -> None:
        link = self.link("odd_link", 0.1)
        kind, attributes = self.any(
            [
                ("box", {"size": "0 0 0"}),
                ("mesh", {"filename": "a.stl", "scale": "1 1 1 1"}),
                ("sphere", {"radius": "-1"}),
                ("cylinder", {"radius": "0.1"}),
                ("mesh", {"filename": "none.dae"}),
            ]
        )
        self.shown(link, kind, attributes, uses=[self.any(["visual", "collision"])])
        self.fixed("chassis", "odd_link", place((0, 0, self.top)))
        if attributes.get("filename") != "none.dae":
            self.truth.said.append("odd_link")

    def two_arms(self) -> None:
        parent = "chassis"
        for i, axis in enumerate("zyyx"):
            link = self.link(f"second_link{i}")
            self.shown(link, "sphere", {"radius": 0.02}, uses=["visual"])
            step = place((0.0, 0.15, self.top)) if not i else place((0.2, 0.0, 0.0))
            self.joint(
                f"second_joint{i}",
                "revolute",
                parent,
                f"second_link{i}",
                step,
                np.eye(3)["xyz".index(axis)],
                (-2.0, 2.0),
            )
            parent = f"second_link{i}"
        self.truth.refused += ["--tip"]
        self.truth.answer += ["--tip", self.truth.tip]

    def rounded(self) -> None:
        """Axles that are some mrad off."""
        if not self.truth.wheels:
            return
        wheel = self.any(self.truth.wheels)
        joint, off = self.joints[wheel.joint], self.between(0.0015, 0.008)
        across = np.cross(joint.axis, [0.3, 0.5, 0.8])
        off_by = about(across / np.linalg.norm(across), off)
        joint.place = joint.place @ place(rotation=off_by)
        self.truth.tolerance = 0.02
        if self.kind in ("differential", "four", "car"):
            self.truth.said.append(wheel.joint)

    def crooked(self) -> None:
        """An axle that is far off; of these bases it must be the two wheels' own."""
        if self.kind not in ("differential", "car"):
            return
        wheel = self.truth.wheels[0]
        joint = self.joints[wheel.joint]
        up = np.linalg.inv(self.place_of(joint.child))[:3, :3] @ Z
        joint.place = joint.place @ place(rotation=about(up, self.between(0.05, 0.3)))
        self.truth.refused, self.truth.answer = ["--", "axes", wheel.joint], []

    def friction(self) -> None:
        name = self.any(self.truth.arm)
        self.friction_of = name
        self.truth.said.append("urdf-friction")
        kept = self._element

        def element(joint: Joint) -> ET.Element:
            made = kept(joint)
            if joint.name == name:
                made.append(ET.Element("dynamics", damping="0.7", friction="0.1"))
            return made

        self._element = element  # type: ignore[method-assign]

    def endless_limits(self) -> None:
        name = self.any(self.truth.arm)
        joint = self.joints[name]
        if joint.kind == "revolute":
            joint.limits = (-math.inf, math.inf)

    def sunk(self) -> None:
        """A body that reaches below the ground on which the wheels stand."""
        if self.kind in ("virtual", "planar"):
            return
        keel = self.link("keel")
        self.shown(keel, "box", {"size": "0.1 0.1 0.1"})
        self.fixed("chassis", "keel", place((0, 0, self.truth.ground - 0.06)))
        self.truth.refused, self.truth.answer = ["keel"], ["--as-it-is"]

    def different_wheels(self) -> None:
        """One wheel is larger than its fellow."""
        if self.kind != "differential" or self.shape == "sphere":
            return
        link = self.links[self.joints[self.truth.left[0]].child]
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
        local = self.joints[self.truth.left[0]].axis
        self.shown(
            link,
            "cylinder",
            {"radius": 1.3 * self.truth.radius, "length": 0.03},
            place(rotation=carry(Z, local)),
        )
        self.truth.refused, self.truth.answer = ["radii", "--"], []


def carry(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The rotation that turns one unit vector into another."""
    axis, cosine = np.cross(one, other), float(np.dot(one, other))
    if np.linalg.norm(axis) < 1e-9:
        across = np.cross(one, [0.3, 0.5, 0.8])
        return np.eye(3) if cosine > 0 else about(across / np.linalg.norm(across), math.pi)
    return about(axis / np.linalg.norm(axis), math.atan2(float(np.linalg.norm(axis)), cosine))


def text(values: Iterable[float]) -> str:
    return " ".join(repr(float(round(value, 12))) for value in values)


BASES = {
    name: getattr(Varied, name)
    for name in (
        "differential",
        "four",
        "mecanum",
        "omni",
        "car",
        "swerve",
        "virtual",
        "six",
        "turret",
        "followed",
        "truck",
        "planar",
    )
}
FAULTS = {
    name: getattr(Varied, name)
    for name in (
        "no_arm",
        "no_radius",
        "millimetres",
        "on_its_side",
        "silly_geometry",
        "two_arms",
        "rounded",
        "crooked",
        "friction",
        "endless_limits",
        "sunk",
        "different_wheels",
    )
}
