"""What a driving base must say of itself, and the registry of types."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import pinocchio as pin

from mobman.arrays import Array
from mobman.registry import Registry


class Platform(ABC):
    r"""A driving base with Pfaffian constraints :math:`A(x)\dot x = 0` (1) and
    :math:`\dot x = N(x)\alpha` (3), :math:`A N = 0` (4).

    Controllers never see a platform; the robot assembles its matrices into those of (9), (16) and
    (17). A new type is one new module in ``mobman/model/platforms/types`` that registers its class.
    """

    coordinates: tuple[str, ...]
    """Joint names of x, in the paper's order (l of them)."""
    velocity_names: tuple[str, ...]
    """Names of the quasi-velocities alpha (l-k of them)."""
    root_offset: Array
    """Position of the URDF's root link in the platform frame (m), shape (3,). The frame's origin is
    the reference point (x1, x2) on the ground, its x axis the heading theta."""

    @classmethod
    @abstractmethod
    def build(cls, parameters: dict[str, Any], tree: pin.Model, origin: str) -> Platform:
        """A platform from the fields of ``[platform]`` and the URDF's kinematic tree.

        Args:
            parameters: The type's own fields, not yet checked.
            tree: The robot with its root link at the platform frame's origin and the base joints in
                front; for reading where the wheels are.
            origin: The file, for messages.

        Raises:
            SpecError: If a field is wrong or the tree does not fit the type.
        """

    @abstractmethod
    def constraint_matrix(self, x: Array) -> Array:
        """A(x), shape (k, l)."""

    @abstractmethod
    def constraint_matrix_rate(self, x: Array, x_dot: Array) -> Array:
        """dA/dt along x', shape (k, l)."""

    @abstractmethod
    def velocity_map(self, x: Array) -> Array:
        """N(x), shape (l, l-k)."""

    @abstractmethod
    def velocity_map_rate(self, x: Array, x_dot: Array) -> Array:
        """dN/dt along x', shape (l, l-k)."""

    @abstractmethod
    def constraint_hessian(self, x: Array, multiplier: Array) -> Array:
        """d(A^T lam)/dx at fixed lam, shape (l, l); not symmetric: the constraints do not integrate."""

    @abstractmethod
    def constraint_hessian_rate(self, x: Array, x_dot: Array, multiplier: Array) -> Array:
        """d/dt of :meth:`constraint_hessian` along x' at fixed lam, shape (l, l)."""

    @property
    @abstractmethod
    def actuation(self) -> Array:
        """B'' of (16), shape (l, l-k): 1 where a motor drives a coordinate directly."""


platforms: Registry[type[Platform]] = Registry("platform type", "mobman.model.platforms.types")
