"""Interface of a check of robots, the registry of checks, what they look at, and running all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import FOREIGN_ERRORS
from mobman.model.build import assemble
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.registry import Registry
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.meshes import MeshReader, MeshReference, mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, Shape, Use, placement, read_shapes, scalar

Status = Literal["ok", "warning", "wrong"]
_MOST_NAMED = 4
_SEED = 20_261_122
_STEERED = math.pi / 3  # rad: random steering angles keep away from the model's singularity at pi/2


@dataclass(frozen=True)
class Finding:
    """Result of a check on a robot."""

    check: str
    """The check's name, which :func:`run_checks` fills in."""
    status: Status
    """``"wrong"``: must be fixed; ``"warning"``: plausible, please verify."""
    found: str
    """Result in words, with numbers and units."""
    fix: str = ""
    """Remedy: which field or element of which file; empty where nothing is to be done."""


ok = partial(Finding, "", "ok")
"""Nothing is to be done."""
warning = partial(Finding, "", "warning")
"""Plausible, to be verified."""
wrong = partial(Finding, "", "wrong")
"""Must be fixed."""


def some(items: Iterable[str], joint: str = ", ") -> str:
    """A list for a sentence: the first few, and how many more."""
    items = list(items)
    more = f" and {len(items) - _MOST_NAMED} more" if len(items) > _MOST_NAMED else ""
    return joint.join(items[:_MOST_NAMED]) + more


Findings = Generator[Finding, None, str]
"""What a check finds, and what it returns where that is nothing: what holds, with its numbers."""
Function = Callable[["Subject"], Iterable[Finding]]


class Check(NamedTuple):
    """Something that can be wrong with a robot."""

    name: str
    meaning: str
    """Condition that holds on a sound robot, in a clause."""
    function: Function
    simulates: bool
    """True if it runs a closed loop."""


checks: Registry[Check] = Registry("check", "mobman.checks", "mobman.checks")


def check(name: str, meaning: str, *, simulates: bool = False) -> Callable[[Function], Function]:
    """Decorator: register a function of a :class:`Subject` that gives :data:`Findings` as a check."""

    def register(function: Function) -> Function:
        function.__doc__ = function.__doc__ or f"Check {name!r}: {meaning}."
        item = Check(name, meaning, function, simulates)
        return checks.register(name, item, module=function.__module__).function

    return register


def list_checks() -> list[Check]:
    """All checks, sorted by name."""
    return [checks.get(name) for name in checks.names()]


def run_checks(
    robot: MobileManipulator, *, simulation: bool = True, only: Collection[str] | None = None
) -> list[Finding]:
    """Findings of the checks on a robot, at least one each, in the order of the checks' names.

    Args:
        robot: The robot.
        simulation: Whether to run the checks that need a closed loop, too.
        only: Names of the checks to run; all by default.

    Raises:
        UnknownNameError: If ``only`` has a name that is none of :func:`list_checks`.
    """
    subject = Subject(robot)
    found: list[Finding] = []
    for item in list_checks() if only is None else [checks.get(name) for name in sorted(only)]:
        if simulation or not item.simulates:
            found += [replace(finding, check=item.name) for finding in _findings(item, subject)]
    return found


def _findings(item: Check, subject: Subject) -> list[Finding]:
    found: list[Finding] = []
    holds = item.meaning

    def each() -> Iterator[Finding]:
        nonlocal holds
        findings: Any = item.function(subject)
        holds = (yield from findings) or holds

    try:
        found.extend(each())
    except FOREIGN_ERRORS as error:  # what breaks one check must not hide what the others find
        text = " ".join(str(error).split()) or "no message"
        fix = f"look at what it looks at ({item.meaning}); where nothing is wrong there, the check"
        found.append(wrong(f"the check ended with {type(error).__name__}: {text}", f"{fix} is"))
    return found or [ok(holds)]


# What the functions that check look at -----------------------------------------------------------------


@dataclass(frozen=True)
class Link:
    """A link of a URDF, before fixed joints merge it with others into a body."""

    name: str  # with the prefix of its mount
    mass: float | None  # kg; None without an <inertial> element
    com: Array  # centre of mass in the link's frame (m), shape (3,)
    moments: Array  # principal moments of inertia, ascending (kg m^2), shape (3,)
    shapes: tuple[Shape, ...]  # what could be read of its geometry
    incomplete: frozenset[Use]  # the uses of which a mesh is missing or could not be read
    file: str  # name, for messages, of the place where it is described

    @property
    def solid(self) -> list[Shape]:
        """The collision geometry, or the visual one where there is none."""
        collision = [shape for shape in self.shapes if shape.use == "collision"]
        return collision or list(self.shapes)


class Subject:
    """A robot and what several checks need of it and its files.

    Attributes:
        robot: The robot.
        model: Pinocchio's model of it.
        arm: Indices in q of the arm's joints.
        tip_frame: Index of the tip's frame; a joint may have its name, too.
        home: q_rest with the platform at the origin, so that the world's axes are the platform's,
            shape (nq,).
        name: ``"robot 'NAME'"``, for messages.
        files: Names, for messages, of all files of the robot.
        mesh_reader: Reads the meshes.
        meshes: Every mesh that the URDFs name, its link with the prefix of its mount, and the URDF.
    """

    def __init__(self, robot: MobileManipulator) -> None:
        self.robot, self.model, spec = robot, robot.model, robot.spec
        self.name, self.arm = f"robot {robot.name!r}", set(robot.arm.joints.tolist())
        self.tip_frame = int(self.model.getFrameId(robot.tip, pin.FrameType.BODY))
        self.mesh_reader, files = MeshReader(), robot.urdf.files
        self.home = np.where(np.isin(robot.joint_names, BASE_JOINTS), 0.0, robot.q_rest)
        prefixes = [*([] if spec.urdf is None else [""]), *(mount.prefix for mount in spec.mount)]
        self._sources = list(zip(prefixes, files, strict=True))
        self._numbers = f"[platform.body] of {self.name}"
        names = [*([self._numbers] if spec.urdf is None else []), *(f.path.name for f in files)]
        self.files = ", ".join(dict.fromkeys(names))

    @cached_property
    def meshes(self) -> list[tuple[MeshReference, UrdfFile]]:
        return [
            (replace(mesh, link=f"{prefix}{mesh.link}"), file)
            for prefix, file in self._sources
            for mesh in mesh_paths(file.parse(), file)
        ]

    @cached_property
    def links(self) -> dict[str, Link]:
        """The links by name, in the URDF's order."""
        files = {
            f"{prefix}{link.get('name')}": file.path.name
            for prefix, file in self._sources
            for link in file.parse().findall("link")
        }
        found = {}
        robot = assemble(self.robot.spec, self.robot.urdf, mesh_paths).robot
        for element in robot.findall("link"):
            name, inertial = str(element.get("name")), element.find("inertial")
            mass, com, moments = None, np.zeros(3), np.zeros(3)
            if inertial is not None:
                mass, com = scalar(inertial.find("mass"), "value"), placement(inertial)[1]
                keys = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")
                entries = [scalar(inertial.find("inertia"), key) for key in keys]
                moments = np.linalg.eigvalsh(np.reshape(entries, (3, 3)))
            vertices = self.mesh_reader.of
            shapes = [shape for use in USES for shape in read_shapes(element, use, vertices)]
            known = tuple(shape for shape in shapes if shape.known)
            incomplete = frozenset(shape.use for shape in shapes if not shape.known)
            file = files.get(name, self._numbers)
            found[name] = Link(name, mass, com, moments, known, incomplete, file)
        return found

    @property
    def few(self) -> str:
        """Reason why checks of the tip's motion do not apply, empty if they do."""
        nz, m = self.robot.nz, TaskMap().m
        return f"does not apply: {nz} degrees of freedom, fewer than the tip's {m}" * (nz < m)

    # Where things are at home

    @cached_property
    def data(self) -> pin.Data:
        """Pinocchio's results at home: placements of joints and links, Jacobians."""
        data = self.model.createData()
        pin.computeJointJacobians(self.model, data, self.home)
        pin.updateFramePlacements(self.model, data)
        return data

    def placement(self, link: str) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of a link in the platform's frame, at home."""
        place = self.data.oMf[self.model.getFrameId(link, pin.FrameType.BODY)]
        return np.array(place.rotation), np.array(place.translation)

    @cached_property
    def carrier(self) -> str:
        """The joint that carries the tip."""
        return str(self.model.names[self.model.frames[self.tip_frame].parentJoint])

    def jacobian(self, joint: str) -> Array:
        """Velocity (linear, then angular) of a joint's frame for unit rates at home, shape (6, nv)."""
        index, axes = self.model.getJointId(joint), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.array(pin.getJointJacobian(self.model, self.data, index, axes))

    def _column(self, joint: str) -> tuple[Array, Array]:
        column = self.jacobian(joint)[:, self.model.joints[self.model.getJointId(joint)].idx_v]
        return column[:3], column[3:]

    def axis(self, joint: str) -> Array:
        """Axis of a joint in the platform's frame at home, unit vector, shape (3,)."""
        linear, angular = self._column(joint)
        return angular if np.any(angular) else linear

    def turns(self, joint: str) -> bool:
        """True if a joint turns, False if it slides."""
        return bool(np.any(self._column(joint)[1]))

    def upright(self, joint: str) -> bool:
        """True if a joint turns about the vertical at home, or nearly."""
        return abs(float(self._column(joint)[1][2])) > 0.9

    def centre(self, joint: str) -> Array:
        """Position of a joint in the platform's frame at home (m), shape (3,)."""
        return np.array(self.data.oMi[self.model.getJointId(joint)].translation)

    def links_on(self, joint: str) -> list[Link]:
        """The links that move with a joint, and with no other behind it."""
        return self._bodies.get(self.model.getJointId(joint), [])

    @cached_property
    def platform_links(self) -> list[Link]:
        """The links that no joint of the arm moves, wheels included."""
        arm = {i for i in range(1, self.model.njoints) if self.model.joints[i].idx_q in self.arm}
        bodies = self._bodies.items()
        return [
            one for i, links in bodies if arm.isdisjoint(self.model.supports[i]) for one in links
        ]

    @cached_property
    def _bodies(self) -> dict[int, list[Link]]:
        bodies: dict[int, list[Link]] = {}
        for frame in self.model.frames:
            if frame.type == pin.FrameType.BODY and frame.name in self.links:
                bodies.setdefault(int(frame.parentJoint), []).append(self.links[frame.name])
        return bodies

    @cached_property
    def steering(self) -> list[str]:
        """The platform's joints that turn about the vertical, other than its heading."""
        others = {*BASE_JOINTS, *(wheel.joint for wheel in self.robot.platform.wheels)}
        names = self.robot.platform.coordinates
        return [name for name in names if name not in others and self.upright(name)]

    def states(self, count: int) -> list[tuple[Array, Array]]:
        """``count`` random pairs (q, z): within the limits and within half a turn (or pi m) of rest."""
        robot, random = self.robot, np.random.default_rng(_SEED)
        steered = np.isin(robot.joint_names, self.steering)
        wide, most = np.where(steered, _STEERED, math.pi), np.where(steered, _STEERED, math.inf)
        lower = np.maximum(self.model.lowerPositionLimit, np.maximum(robot.q_rest - wide, -most))
        upper = np.minimum(self.model.upperPositionLimit, np.minimum(robot.q_rest + wide, most))
        upper = np.maximum(lower, upper)
        return [
            (robot.consistent(random.uniform(lower, upper)), random.standard_normal(robot.nz))
            for _ in range(count)
        ]
