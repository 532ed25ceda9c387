"""A robot as the checks see it: its links as they are written, and what several checks need of it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.model.build import assemble
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.meshes import MeshReader, MeshReference, mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, Shape, Use, placement, read_shapes, scalar

_SEED = 20_261_122
_STEERED = math.pi / 3  # rad: random steering angles keep away from the model's singularity at pi/2


@dataclass(frozen=True)
class Link:
    """A link of a URDF, before fixed joints merge it with others into a body.

    Attributes:
        name: With the prefix of its mount.
        mass: kg; None without an ``<inertial>`` element.
        com: Centre of mass in the link's frame (m), shape (3,).
        moments: Principal moments of inertia, ascending (kg m^2), shape (3,).
        shapes: What could be read of its geometry.
        incomplete: The uses of which a mesh is missing or could not be read.
        file: Name, for messages, of the place where it is described.
    """

    name: str
    mass: float | None
    com: Array
    moments: Array
    shapes: tuple[Shape, ...]
    incomplete: frozenset[Use]
    file: str

    @property
    def solid(self) -> list[Shape]:
        """The collision geometry, or the visual one where there is none."""
        collision = [shape for shape in self.shapes if shape.use == "collision"]
        return collision or list(self.shapes)


def _read_link(
    element: ET.Element, vertices: Callable[[str, str], Array | None], file: str
) -> Link:
    name, inertial = str(element.get("name")), element.find("inertial")
    mass, com, moments = None, np.zeros(3), np.zeros(3)
    if inertial is not None:
        inertia = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (
            scalar(inertia, key) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        moments = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        mass, com = scalar(inertial.find("mass"), "value"), placement(inertial)[1]
    shapes = [s for use in USES for s in read_shapes(element, use, partial(vertices, name))]
    known = tuple(shape for shape in shapes if shape.known)
    incomplete = frozenset(shape.use for shape in shapes if not shape.known)
    return Link(name, mass, com, moments, known, incomplete, file)


class Subject:
    """A robot and what is derived from it and its files.

    Args:
        robot: The robot.

    Attributes:
        robot: The same.
        home: q_rest with the platform at the origin, so that the world's axes are the platform's,
            shape (nq,).
        mesh_reader: Reads the meshes.
    """

    def __init__(self, robot: MobileManipulator) -> None:
        self.robot = robot
        self.mesh_reader = MeshReader()
        self.home = robot.q_rest.copy()
        for name in BASE_JOINTS:
            if name in robot.joint_names:
                self.home[robot.joint_names.index(name)] = 0.0

    @property
    def _sources(self) -> list[tuple[str, UrdfFile]]:
        """The prefix of its links and the file of every URDF."""
        spec = self.robot.spec
        prefixes = [*([] if spec.urdf is None else [""]), *(mount.prefix for mount in spec.mount)]
        return list(zip(prefixes, self.robot.urdf.files, strict=True))

    @cached_property
    def meshes(self) -> list[tuple[MeshReference, UrdfFile]]:
        """Every mesh that the URDFs name, its link with the prefix of its mount, and the URDF."""
        return [
            (replace(mesh, link=f"{prefix}{mesh.link}"), file)
            for prefix, file in self._sources
            for mesh in mesh_paths(file.parse(), file)
        ]

    @cached_property
    def links(self) -> dict[str, Link]:
        """The links by name, in the URDF's order."""
        paths = {(mesh.link, mesh.filename): mesh.path for mesh, _ in self.meshes}

        def vertices(link: str, filename: str) -> Array | None:
            path = paths.get((link, filename))
            return None if path is None else self.mesh_reader.vertices(path)

        files = {
            f"{prefix}{link.get('name')}": file.path.name
            for prefix, file in self._sources
            for link in file.parse().findall("link")
        }
        found = {}
        for link in assemble(self.robot.spec, self.robot.urdf).robot.findall("link"):
            name = str(link.get("name"))
            found[name] = _read_link(link, vertices, files.get(name, self._numbers))
        return found

    @property
    def _numbers(self) -> str:
        return f"[platform.body] of robot {self.robot.name!r}"

    @property
    def files(self) -> str:
        """Names, for messages, of all files of the robot."""
        names = [file.path.name for file in self.robot.urdf.files]
        if self.robot.spec.urdf is None:
            names.insert(0, self._numbers)
        return ", ".join(dict.fromkeys(names))

    # Where things are at home --------------------------------------------------------------------

    @cached_property
    def data(self) -> pin.Data:
        """Pinocchio's results at home: placements of joints and links, Jacobians."""
        data = self.robot.model.createData()
        pin.computeJointJacobians(self.robot.model, data, self.home)
        pin.updateFramePlacements(self.robot.model, data)
        return data

    def placement(self, link: str) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of a link in the platform's frame, at home."""
        place = self.data.oMf[self.robot.model.getFrameId(link, pin.FrameType.BODY)]
        return np.array(place.rotation), np.array(place.translation)

    @property
    def tip_frame(self) -> int:
        """Index of the tip's frame; a joint may have its name, too."""
        return int(self.robot.model.getFrameId(self.robot.tip, pin.FrameType.BODY))

    @property
    def carrier(self) -> str:
        """The joint that carries the tip."""
        model = self.robot.model
        return str(model.names[model.frames[self.tip_frame].parentJoint])

    def jacobian(self, joint: str) -> Array:
        """Velocity (linear, then angular) of a joint's frame for unit rates at home, shape (6, nv)."""
        model, axes = self.robot.model, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.array(pin.getJointJacobian(model, self.data, model.getJointId(joint), axes))

    def _column(self, joint: str) -> Array:
        model = self.robot.model
        column: Array = self.jacobian(joint)[:, model.joints[model.getJointId(joint)].idx_v]
        return column

    def axis(self, joint: str) -> Array:
        """Axis of a joint in the platform's frame at home, unit vector, shape (3,)."""
        column = self._column(joint)
        return column[3:] if np.any(column[3:]) else column[:3]

    def turns(self, joint: str) -> bool:
        """True if a joint turns, False if it slides."""
        return bool(np.any(self._column(joint)[3:]))

    def upright(self, joint: str) -> bool:
        """True if a joint turns about the vertical at home, or nearly."""
        return self.turns(joint) and abs(float(self.axis(joint)[2])) > 0.9

    def centre(self, joint: str) -> Array:
        """Position of a joint in the platform's frame at home (m), shape (3,)."""
        return np.array(self.data.oMi[self.robot.model.getJointId(joint)].translation)

    def links_on(self, joint: str) -> list[Link]:
        """The links that move with a joint, and with no other behind it."""
        return self._bodies.get(self.robot.model.getJointId(joint), [])

    @cached_property
    def platform_links(self) -> list[Link]:
        """The links that no joint of the arm moves, wheels included."""
        model, arm = self.robot.model, set(self.robot.arm.joints.tolist())
        return [
            link
            for joint, links in self._bodies.items()
            for link in links
            if not arm & {model.joints[i].idx_q for i in model.supports[joint] if i}
        ]

    @cached_property
    def _bodies(self) -> dict[int, list[Link]]:
        bodies: dict[int, list[Link]] = {}
        for frame in self.robot.model.frames:
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
        wide = np.where(steered, _STEERED, math.pi)
        lower = np.maximum(robot.model.lowerPositionLimit, robot.q_rest - wide)
        upper = np.minimum(robot.model.upperPositionLimit, robot.q_rest + wide)
        lower = np.where(steered, np.maximum(lower, -_STEERED), lower)
        upper = np.where(steered, np.minimum(upper, _STEERED), upper)
        upper = np.maximum(lower, upper)
        return [
            (robot.consistent(random.uniform(lower, upper)), random.standard_normal(robot.nz))
            for _ in range(count)
        ]
