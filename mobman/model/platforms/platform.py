"""What a driving base must say of itself, and the registry of types."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.registry import Registry


class Equations(NamedTuple):
    """A platform's A and N as functions that write into arrays.

    The functions are kernels (:mod:`mobman.kernels`), to be part of what is evaluated at every tick;
    plain functions of Python do as well, at the price of a call each. Every entry is to be written.
    """

    parameters: Array
    """The numbers that the functions need; their first argument, always."""
    velocity_map: Callable[[Array, Array, Array], None]
    """(parameters, x, N): N(x), shape (l, l-k)."""
    velocity_map_rate: Callable[[Array, Array, Array, Array], None]
    """(parameters, x, x_dot, N_rate): dN/dt along x', shape (l, l-k)."""
    constraints: Callable[[Array, Array, Array, Array], None]
    """(parameters, x, A, A_x): A(x), shape (k, l), and its derivatives dA_ij/dx_m, shape (k, l, l)."""
    constraint_derivative_rate: Callable[[Array, Array, Array, Array], None]
    """(parameters, x, x_dot, A_x_rate): the rate of those along x', shape (k, l, l)."""


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

    @property
    @abstractmethod
    def equations(self) -> Equations:
        """A and N, and their derivatives."""

    def constraint_matrix(self, x: Array) -> Array:
        """A(x), shape (k, l)."""
        return self._constraints(x)[0]

    def constraint_matrix_rate(self, x: Array, x_dot: Array) -> Array:
        """dA/dt along x', shape (k, l)."""
        rate: Array = self._constraints(x)[1] @ x_dot
        return rate

    def velocity_map(self, x: Array) -> Array:
        """N(x), shape (l, l-k)."""
        n = np.zeros((len(self.coordinates), len(self.velocity_names)))
        self.equations.velocity_map(self.equations.parameters, x, n)
        return n

    def velocity_map_rate(self, x: Array, x_dot: Array) -> Array:
        """dN/dt along x', shape (l, l-k)."""
        rate = np.zeros((len(self.coordinates), len(self.velocity_names)))
        self.equations.velocity_map_rate(self.equations.parameters, x, x_dot, rate)
        return rate

    def constraint_hessian(self, x: Array, multiplier: Array) -> Array:
        """d(A^T lam)/dx at fixed lam, shape (l, l); not symmetric: the constraints do not integrate."""
        return np.tensordot(multiplier, self._constraints(x)[1], axes=1)

    def constraint_hessian_rate(self, x: Array, x_dot: Array, multiplier: Array) -> Array:
        """d/dt of :meth:`constraint_hessian` along x' at fixed lam, shape (l, l)."""
        l, k = len(self.coordinates), len(self.coordinates) - len(self.velocity_names)
        rate = np.zeros((k, l, l))
        self.equations.constraint_derivative_rate(self.equations.parameters, x, x_dot, rate)
        return np.tensordot(multiplier, rate, axes=1)

    def _constraints(self, x: Array) -> tuple[Array, Array]:
        l, k = len(self.coordinates), len(self.coordinates) - len(self.velocity_names)
        a, a_x = np.zeros((k, l)), np.zeros((k, l, l))
        self.equations.constraints(self.equations.parameters, x, a, a_x)
        return a, a_x

    @property
    @abstractmethod
    def actuation(self) -> Array:
        """B'' of (16), shape (l, l-k): 1 where a motor drives a coordinate directly."""


platforms: Registry[type[Platform]] = Registry("platform type", "mobman.model.platforms.types")
