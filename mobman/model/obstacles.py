"""Obstacles of simple shapes: the distance of points to them, with its first and second derivatives."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, field_validator

from mobman.arrays import Array
from mobman.toml_model import Strict

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
