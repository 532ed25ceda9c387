"""The criterion that keeps links away from obstacles, as a term beside the posture criterion."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.build import load_geometry
from mobman.model.criterion import ByComplexStep, Criterion, Term, criteria
from mobman.model.joint_tree import JointTree
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.obstacles import Obstacle

_FINEST = 4  # cells along the longest edge of what a link's spheres cover


@criteria.register("clearance")
class Clearance(Term):
    r"""Distance from obstacles,
    :math:`F = \sum \tfrac{w}{12}\,\delta^4/b^2` over obstacles and the spheres that cover the robot.

    :math:`\delta = \max(b - d, 0)` with d the distance of a sphere from an obstacle (m). F is of class
    C^3 and 0 farther away than b; at contact its curvature along the normal is w (m^-2). The spheres
    cover the boxes about the collision geometry of base and arm, without the wheels: the robot is
    farther away than d says, never nearer. The term has no direction where a sphere's centre is in an
    obstacle.
    """

    obstacles: list[Obstacle] = Field(min_length=1)
    """Standing in the world: half-spaces, spheres, boxes, upright cylinders."""
    margin: float = Field(0.2, gt=0)  # b (m)

    def on(self, robot: MobileManipulator) -> Criterion:
        """The term for a robot.

        Raises:
            UsageError: If it has no collision geometry, or stands in an obstacle at rest.
            SpecError: If a mesh of its geometry cannot be read.
        """
        term = LinkClearance(robot, self)
        if not term.radii.size:
            raise UsageError(f"criterion 'clearance': {robot.name!r} has no collision geometry")
        term.require_outside(robot.q_rest)
        return term


class LinkClearance(ByComplexStep):
    """Clearance of one robot; see :class:`Clearance`.

    Attributes:
        obstacles: What it keeps away from.
        radii: Of the spheres that cover the robot (m).
    """

    def __init__(self, robot: MobileManipulator, given: Clearance) -> None:
        self.obstacles, self._given = given.obstacles, given
        self._model, self._data = robot.model, robot.model.createData()
        own = set(robot.arm.joints.tolist())
        arm = [i for i in range(1, robot.model.njoints) if robot.model.idx_qs[i] in own]
        # what carries the arm, and the arm
        self._chain = JointTree(robot.model, {i for j in arm for i in robot.model.supports[j] if i})
        solids = load_geometry(robot).collision.geometryObjects
        covers = [_cover(solids, joint) for joint in self._chain.joints]
        self.radii = np.concatenate([radii for _, radii in covers])
        self._points = np.concatenate([points for points, _ in covers])
        self._joint = np.repeat(np.arange(len(covers)), [len(radii) for _, radii in covers])

    def clearance(self, q: Array) -> float:
        """Least distance of a sphere from an obstacle (m), negative where they overlap."""
        points = self._centres(q)
        return float(
            min(np.min(each.distance(points).value - self.radii) for each in self.obstacles)
        )

    def require_outside(self, q: Array) -> None:
        """Raise if a sphere's centre is in an obstacle: UsageError."""
        points = self._centres(q)
        for number, obstacle in enumerate(self.obstacles):
            inside = np.flatnonzero(obstacle.distance(points).value <= 0.0)
            if inside.size:
                joint = self._model.names[self._chain.joints[self._joint[inside[0]]]]
                raise UsageError(
                    f"criterion 'clearance': at rest, a link that joint {joint!r} of "
                    f"{self._model.name!r} moves is in obstacles[{number}] ({obstacle.type}); "
                    "move one of them"
                )

    def value(self, q: Array) -> float:
        """F(q)."""
        points, scale = self._centres(q), self._given.weight / 12.0 / self._given.margin**2
        depths = [self._depth(each.distance(points).value - self.radii) for each in self.obstacles]
        return float(scale * np.sum(np.array(depths) ** 4))

    def derivatives(self, q: Array, along: Array) -> tuple[Array, Array]:
        gradient = np.zeros(len(q), dtype=along.dtype)
        hessian = np.zeros((len(q), len(q)), dtype=along.dtype)
        points, margin = self._centres(q), self._given.margin
        near = [each.distance(points).value - self.radii < margin for each in self.obstacles]
        if not np.any(near):
            return gradient, hessian
        pose, index = self._chain.at(along), self._chain.index
        earlier, later = pose.pairs()
        scale = self._given.weight / margin**2
        whole = np.zeros((len(index), len(index)), dtype=along.dtype)
        for obstacle, own in zip(self.obstacles, near, strict=True):
            joint = self._joint[own]
            frames = pose.frames[joint]
            points = (
                np.einsum("pij,pj->pi", frames[:, :3, :3], self._points[own]) + frames[:, :3, 3]
            )
            J = pose.jacobian(points) * self._chain.moves[joint][:, :, None]
            found = obstacle.distance(points)
            depth = self._depth(found.value - self.radii[own])
            slope = -scale / 3.0 * depth**3
            normal = np.einsum("pic,pc->pi", J, found.gradient)  # dd/dq
            force = slope[:, None] * found.gradient  # dF/dp
            gradient[index] += np.einsum("p,pi->i", slope, normal)
            within = slope[:, None, None] * found.hessian
            whole += np.einsum("p,pi,pj->ij", scale * depth**2, normal, normal)
            whole += np.einsum("pic,pcd,pjd->ij", J, within, J, optimize=True)
            moment = np.cross(J, force[:, None]).sum(axis=0)  # J_i x dF/dp
            curved = np.einsum("kic,kic->ki", pose.axes[earlier], moment[later])
            whole += np.where(self._chain.moves[later, earlier], curved, 0.0)
        hessian[np.ix_(index, index)] = whole
        return gradient, hessian

    def _depth(self, d: Array) -> Array:
        over = self._given.margin - d
        return np.where(over.real > 0.0, over, 0.0)

    def _centres(self, q: Array) -> Array:
        """Centres of the spheres in the world (m), shape (spheres, 3)."""
        pin.forwardKinematics(self._model, self._data, q)
        places = [self._data.oMi[joint] for joint in self._chain.joints]
        turned = np.array([place.rotation for place in places])[self._joint]
        moved = np.array([place.translation for place in places])[self._joint]
        points: Array = np.einsum("pij,pj->pi", turned, self._points) + moved
        return points


def _cover(solids: Iterable[pin.GeometryObject], joint: int) -> tuple[Array, Array]:
    """Spheres that cover what a joint moves: centres in its frame, and radii (m)."""
    spheres = [(np.zeros((0, 3)), np.zeros(0))]
    spheres += [_spheres(solid) for solid in solids if solid.parentJoint == joint]
    points, radii = (np.concatenate(column) for column in zip(*spheres, strict=True))
    order = np.argsort(-radii, kind="stable")
    points, radii = points[order], radii[order]
    apart = np.linalg.norm(points[:, None] - points, axis=2)
    inside = np.tril(apart + radii[:, None] <= radii, -1).any(axis=1)
    return points[~inside], radii[~inside]


def _spheres(solid: pin.GeometryObject) -> tuple[Array, Array]:
    """Spheres that cover the box about a solid."""
    solid.geometry.computeLocalAABB()
    low, high = solid.geometry.aabb_local.min_, solid.geometry.aabb_local.max_
    size = high - low
    cell = max(size.min(), size.max() / _FINEST)
    counts = np.maximum(np.ceil(size / cell - 1e-9).astype(int), 1)
    steps = [(np.arange(n) + 0.5) / n for n in counts]
    grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = (low + grid * size) @ solid.placement.rotation.T + solid.placement.translation
    return centres, np.full(len(grid), 0.5 * np.linalg.norm(size / counts))
