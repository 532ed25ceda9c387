"""The criterion that keeps links away from obstacles, as a term beside the posture criterion: obstacles
of simple shapes, the distance of points to them with its derivatives, and spheres that cover a robot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field, field_validator

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.build import load_geometry
from mobman.model.criterion import ByComplexStep, Criterion, Term, criteria
from mobman.model.joint_tree import JointTree
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.toml_model import Strict

_FINEST = 4  # cells along the longest edge of what a link's spheres cover
Coordinates = tuple[float, float, float]
Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Distance(NamedTuple):
    """Distance of points to an obstacle; points may be complex, and these then are."""

    value: Array  # d (m), 0 or less inside, shape (points,)
    gradient: Array  # dd/dp, shape (points, 3)
    hessian: Array  # d2d/dp2, shape (points, 3, 3)


class HalfSpace(Strict):
    """Everything behind a plane: a wall, a floor, a ceiling."""

    type: Literal["half-space"]
    point: Coordinates  # a point of the plane (m), in the world
    normal: Coordinates  # direction out of it, of any length above 0

    @field_validator("normal")
    @classmethod
    def _not_zero(cls, normal: Coordinates) -> Coordinates:
        if not any(normal):
            raise ValueError("must have a length above 0")
        return normal

    def distance(self, points: Array) -> Distance:
        """Distance of points, shape (points, 3)."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        d = (points - np.array(self.point)) @ normal
        gradient = np.broadcast_to(normal, points.shape)
        return Distance(d, gradient, np.zeros((*points.shape, 3)))


class Ball(Strict):
    """A ball."""

    type: Literal["sphere"]
    centre: Coordinates  # in the world (m)
    radius: Length  # m

    def distance(self, points: Array) -> Distance:
        """Distance of points, shape (points, 3)."""
        length, gradient, hessian = _length(points - np.array(self.centre))
        return Distance(length - self.radius, gradient, hessian)


class Pillar(Strict):
    """A cylinder with a vertical axis."""

    type: Literal["cylinder"]
    centre: Coordinates  # in the world (m)
    radius: Length  # m
    height: Length  # m

    def distance(self, points: Array) -> Distance:
        """Distance of points, shape (points, 3); see :func:`_beyond`."""
        x = points - np.array(self.centre)
        rho, direction, curvature = _length(x[:, :2])
        size = np.array([self.radius, self.height / 2.0])
        distance = _beyond(np.stack([rho, x[:, 2]], axis=1), size)
        # d(rho, z)/dp, and the curvature of rho
        map_ = np.zeros((len(x), 2, 3), dtype=points.dtype)
        map_[:, 0, :2], map_[:, 1, 2] = direction, 1.0
        hessian = np.einsum("pab,pai,pbj->pij", distance.hessian, map_, map_)
        hessian[:, :2, :2] += distance.gradient[:, :1, None] * curvature
        gradient = np.einsum("pa,pai->pi", distance.gradient, map_)
        return Distance(distance.value, gradient, hessian)


class Cuboid(Strict):
    """A box with horizontal and vertical faces."""

    type: Literal["box"]
    centre: Coordinates  # in the world (m)
    size: tuple[Length, Length, Length]  # lengths of its edges (m)
    yaw: float = 0.0  # angle about the vertical (rad)

    def distance(self, points: Array) -> Distance:
        """Distance of points, shape (points, 3); see :func:`_beyond`."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        d, gradient, hessian = _beyond(
            (points - np.array(self.centre)) @ R, np.array(self.size) / 2
        )
        return Distance(d, gradient @ R.T, R @ hessian @ R.T)


Obstacle = Annotated[HalfSpace | Ball | Pillar | Cuboid, Field(discriminator="type")]


def _length(x: Array) -> Distance:
    """|x| of each row."""
    length = np.sqrt(np.sum(x * x, axis=1))
    unit = x / length[:, None]
    curvature = np.eye(x.shape[1]) - unit[:, :, None] * unit[:, None, :]
    return Distance(length, unit, curvature / length[:, None, None])


def _beyond(x: Array, size: Array) -> Distance:
    r"""Distance of each row x to the box :math:`|x_i| \le b_i`,
    :math:`(\sum_i \max(|x_i| - b_i, 0)^4)^{1/4}`.

    Beside a face it is the distance; beside edges and corners, where that has no second derivative, at
    most 3^(1/4) too small, and of class C^3. Inside it is 0, with gradient and curvature 0.
    """
    sign = np.sign(x.real)
    over = sign * x - size
    u = np.where(over.real > 0.0, over, 0.0)
    d = np.sum(u**4, axis=1) ** 0.25
    outside = np.where(d.real > 0.0, d, 1.0)
    share = u / outside[:, None]
    gradient = sign * share**3
    diagonal = 3.0 * share[:, :, None] ** 2 * np.eye(len(size))
    hessian = diagonal - 3.0 * share[:, :, None] ** 3 * share[:, None, :] ** 3
    signs = sign[:, :, None] * sign[:, None, :]
    return Distance(d, gradient, signs * hessian / outside[:, None, None])


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
        """The term for a robot; UsageError if it has no collision geometry, or stands in an obstacle at
        rest; SpecError if a mesh of its geometry cannot be read."""
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
