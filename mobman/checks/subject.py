"""A robot as the checks see it: what several of them need, worked out once."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.checks.links import Link, read_links
from mobman.checks.mesh_files import MeshFile, mesh_files
from mobman.model.assembly import Assembly
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.meshes import MeshReader

_SEED = 20_261_122
_STEERED = math.pi / 3  # rad: random steering angles keep away from the model's singularity at pi/2


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

    @cached_property
    def meshes(self) -> list[MeshFile]:
        """Every mesh that the URDFs name."""
        return mesh_files(self.robot.spec, self.robot.urdf)

    @cached_property
    def links(self) -> dict[str, Link]:
        """The links by name, in the URDF's order."""
        paths = {(mesh.link, mesh.filename): mesh.path for mesh in self.meshes}

        def read(link: str, filename: str) -> Array | None:
            path = paths.get((link, filename))
            return None if path is None else self.mesh_reader.vertices(path)

        return read_links(Assembly(self.robot.spec, self.robot.urdf).robot, read)

    def file_of(self, link: str) -> str:
        """What to call the place where a link is described."""
        return self._files.get(link, f"[platform.body] of robot {self.robot.name!r}")

    @property
    def files(self) -> str:
        """What to call all files of the robot together."""
        names = [file.path.name for file in self.robot.urdf.files]
        if self.robot.spec.urdf is None:
            names.insert(0, f"[platform.body] of robot {self.robot.name!r}")
        return ", ".join(dict.fromkeys(names))

    @cached_property
    def _files(self) -> dict[str, str]:
        spec = self.robot.spec
        prefixes = [] if spec.urdf is None else [""]
        prefixes += [mount.prefix for mount in spec.mount]
        return {
            f"{prefix}{link.get('name')}": file.path.name
            for prefix, file in zip(prefixes, self.robot.urdf.files, strict=True)
            for link in file.parse().findall("link")
        }

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
        index = self.robot.model.getFrameId(link, pin.FrameType.BODY)
        place = self.data.oMf[index]
        return np.array(place.rotation), np.array(place.translation)

    @property
    def tip_frame(self) -> int:
        """Index of the tip's frame; a joint may have its name, too."""
        return int(self.robot.model.getFrameId(self.robot.tip, pin.FrameType.BODY))

    def axis(self, joint: str) -> Array:
        """Axis of a joint in the platform's frame at home, unit vector, shape (3,)."""
        column = self._column(joint)
        return column[3:] if np.any(column[3:]) else column[:3]

    def turns(self, joint: str) -> bool:
        """Whether a joint turns; it slides otherwise."""
        return bool(np.any(self._column(joint)[3:]))

    def _column(self, joint: str) -> Array:
        """Velocity (linear, then angular) of a joint's own frame for its unit rate, shape (6,)."""
        model = self.robot.model
        index = model.getJointId(joint)
        columns = pin.getJointJacobian(
            model, self.data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        return np.array(columns[:, model.joints[index].idx_v])

    def centre(self, joint: str) -> Array:
        """Position of a joint in the platform's frame at home (m), shape (3,)."""
        return np.array(self.data.oMi[self.robot.model.getJointId(joint)].translation)

    def links_on(self, joint: str) -> list[Link]:
        """The links that move with a joint, and with no other behind it."""
        return self._bodies.get(self.robot.model.getJointId(joint), [])

    @cached_property
    def platform_links(self) -> list[Link]:
        """The links that no joint of the arm moves, wheels included."""
        model, arm = self.robot.model, set(self.robot.arm_index.tolist())
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

    # Joints --------------------------------------------------------------------------------------

    @cached_property
    def steering(self) -> list[str]:
        """The platform's joints that turn about the vertical, other than its heading."""
        wheels = {wheel.joint for wheel in self.robot.platform.wheels}
        return [
            name
            for name in self.robot.platform.coordinates
            if name not in BASE_JOINTS
            and name not in wheels
            and self.turns(name)
            and abs(self.axis(name)[2]) > 0.9
        ]

    # States --------------------------------------------------------------------------------------

    def states(self, count: int) -> list[tuple[Array, Array]]:
        """``count`` random pairs (q, z): within the limits and within half a turn (or pi m) of rest."""
        robot, random = self.robot, np.random.default_rng(_SEED)
        wide = np.full(robot.nq, math.pi)
        for name in self.steering:
            wide[robot.joint_names.index(name)] = _STEERED
        lower = np.maximum(robot.model.lowerPositionLimit, robot.q_rest - wide)
        upper = np.minimum(robot.model.upperPositionLimit, robot.q_rest + wide)
        for name in self.steering:
            i = robot.joint_names.index(name)
            lower[i], upper[i] = max(lower[i], -_STEERED), min(upper[i], _STEERED)
        upper = np.maximum(lower, upper)
        return [
            (random.uniform(lower, upper), random.standard_normal(robot.nz)) for _ in range(count)
        ]
