"""Interface of a mobile base, and the registry of base types."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Index, Matrix, Tensor, Vector
from mobman.compiled import kernel, plain
from mobman.errors import SpecError
from mobman.linalg import dot
from mobman.model.platforms.body import Angle, Knuckle, WheelPart, body_urdf
from mobman.model.platforms.wheels import Site
from mobman.registry import Registry
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.toml_model import Strict, validate


class Fields(Strict):
    """The fields of ``[platform]`` that most types have."""

    heading: Angle = 0.0
    """Direction of forward in the root link's frame, about z from its x axis (rad)."""


class WheeledFields(Fields):
    """The same with wheels, all alike."""

    wheel_radius: float = Field(gt=0)  # R (m)


class Wheel(NamedTuple):
    """A wheel that rolls on the ground."""

    joint: str  # its joint, one of the platform's coordinates
    radius: float  # m
    roller: float | None = None
    """With rollers: the angle from where a positive rate rolls it to the axis of the roller that touches
    the ground, seen from above, anticlockwise (rad)."""


class Gear(NamedTuple):
    """Two of a platform's joints that gears, a belt or a rod couple."""

    joint: str
    of: str  # the joint that it turns with
    ratio: float  # its rate over that joint's


class ArmJoints(NamedTuple):
    """All joints that are not the platform's: those with a motor, and those that follow them."""

    joints: Index  # their places in q, increasing
    column: Index  # the number of the entry of y' that moves each
    ratio: Vector  # its rate over that: 1 for a joint with a motor


class Motion(NamedTuple):
    """A platform's part of a robot's kinematics, see :class:`mobman.model.dynamics.Buffers`."""

    platform_index: Index
    arm: ArmJoints
    q: Vector
    z: Vector
    x: Vector
    x_dot: Vector
    alpha: Vector
    N: Matrix
    N_rate: Matrix
    platform_B: Matrix
    q_dot: Vector
    C: Matrix
    C_dot_z: Vector
    platform_A: Matrix
    A_x: Tensor
    A_x_rate: Tensor
    A: Matrix
    A_rate: Matrix


class Equations(NamedTuple):
    """A platform's A and N as functions that write into arrays.

    The functions are kernels (:func:`mobman.compiled.kernel`); plain functions of Python do as well, at
    the price of a slower call each. Every entry of the arrays is to be written.
    """

    parameters: Array  # the numbers that the functions need; their first argument, always
    velocity_map: Callable[[Array, Array, Array], None]
    """(parameters, x, N): N(x), shape (l, l-k)."""
    velocity_map_rate: Callable[[Array, Array, Array, Array], None]
    """(parameters, x, x_dot, N_rate): dN/dt along x', shape (l, l-k)."""
    constraints: Callable[[Array, Array, Array, Array], None]
    """(parameters, x, A, A_x): A(x), shape (k, l), and its derivatives dA_ij/dx_m, shape (k, l, l)."""
    constraint_derivative_rate: Callable[[Array, Array, Array, Array], None]
    """(parameters, x, x_dot, A_x_rate): the rate of those along x', shape (k, l, l)."""
    actuation: Callable[[Array, Array, Array], None]
    """(parameters, x, B): B'' of (16), the generalised forces of x that each command makes; shape
    (l, l-k). For motors on the coordinates themselves it is a selection of them."""


class Platform:
    r"""A driving base with Pfaffian constraints :math:`A(x)\dot x = 0` (1) and
    :math:`\dot x = N(x)\alpha` (3), :math:`A N = 0` (4).

    Controllers never see a platform; the robot assembles its matrices into those of (9), (16) and
    (17). A new type is one new module in ``mobman/model/platforms`` that registers its class.
    """

    fields: type[Strict] = Fields
    """The fields of ``[platform]``; with a ``body`` if it may be described by its numbers."""
    coordinates: tuple[str, ...]  # joint names of x, in the paper's order (l of them)
    velocity_names: tuple[str, ...]  # names of the quasi-velocities alpha (l-k of them)
    root_offset: Array
    """Position of the URDF's root link in the platform frame (m), shape (3,). The frame's origin is
    the reference point (x1, x2) on the ground, its x axis the heading theta."""
    heading: float = 0.0
    """Direction of the platform frame's x axis in the root link's frame, about z (rad)."""
    base_joints: tuple[str, ...] = BASE_JOINTS
    """The joints that move the platform: :data:`BASE_JOINTS`, or none."""
    virtual_joints: tuple[str, ...] = ()
    """Coordinates that describe how the platform moves and that no joint of the URDF has. They become
    joints without mass behind the root link, which turn about its z axis."""
    following: tuple[str, ...] = ()
    """Coordinates that others determine, see :meth:`consistent`. The posture criterion leaves them to
    those unless it gives them weights."""
    wheels: tuple[Wheel, ...] = ()  # the wheels among the coordinates
    geared: tuple[Gear, ...] = ()  # joints that turn together without the ground's help
    skids: bool = False
    """True if the wheels slip sideways whenever it turns, which its equations say nothing of."""
    equations: Equations  # A and N, and their derivatives
    inferred: tuple[str, ...] = ()
    """The fields of ``[platform]`` that ``mobman robots add`` is to find in a URDF for a type of the
    user's own: of ``heading``, ``right_wheel`` and ``left_wheel`` (or both with ``rear_`` in front),
    ``right_wheels`` and ``left_wheels``, ``wheels``, ``kind``, ``steering``, ``front_wheels``,
    ``turret``, ``axle``, ``centre``, ``height``, ``wheel_radius``, ``half_track``. Without any,
    ``--platform`` does not offer the type."""

    def __init__(
        self,
        joints: Sequence[str],
        velocity_names: Sequence[str],
        equations: Equations,
        root_offset: Array | None = None,
        heading: float = 0.0,
        wheels: Sequence[Wheel] = (),
    ) -> None:
        self.coordinates = (*self.base_joints, *self.virtual_joints, *joints)
        self.velocity_names, self.equations = tuple(velocity_names), equations
        self.root_offset = np.zeros(3) if root_offset is None else root_offset
        self.heading, self.wheels = heading, tuple(wheels)

    @classmethod
    def build(cls, site: Site) -> Platform:
        """A platform from the fields of ``[platform]`` and the URDF's kinematic tree; by default what
        the class makes of ``site`` and these fields.

        Raises:
            SpecError: If a field is wrong or the tree does not fit the type.
        """
        make: Callable[..., Platform] = cls
        return make(site, site.read(cls.fields))

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """The URDF of a platform that is described by its numbers, ``[platform.body]``, with the links
        ``platform`` (on the ground, at its centre) and ``deck`` (top of the body, where an arm is
        mounted). The type's own fields are not checked before; SpecError, in which the description is
        called ``origin``, if one is wrong, or the type cannot be described so."""
        if "body" not in cls.fields.model_fields:
            raise SpecError(
                f"{origin}: field 'urdf' is missing: this platform type has no description by numbers"
            )
        given: Any = validate(cls.fields, parameters, f"{origin}: [platform]")
        if given.body is None:
            raise SpecError(
                f"{origin}: field 'urdf' is missing, and so is 'platform.body': describe the platform "
                "by a URDF or by its numbers"
            )
        radius = getattr(given, "wheel_radius", 0.0)
        return body_urdf(given.body, radius, cls.parts(given, origin))

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart | Knuckle]:
        """The wheels and steering joints of a platform that is described by its numbers, ``given`` its
        fields; see :meth:`describe`."""
        return ()

    def consistent(self, x: Array) -> Array:
        """x with the coordinates that others determine set accordingly; all are free by default.

        Raises:
            UsageError: If the others determine none.
        """
        return x

    def constraint_matrix(self, x: Array) -> Array:
        """A(x), shape (k, l)."""
        return self._constraints(x)[0]

    def constraint_matrix_rate(self, x: Array, x_dot: Array) -> Array:
        """dA/dt along x', shape (k, l)."""
        rate: Array = self._constraints(x)[1] @ x_dot
        return rate

    def velocity_map(self, x: Array) -> Array:
        """N(x), shape (l, l-k)."""
        return self._per_velocity(self.equations.velocity_map, x)

    def velocity_map_rate(self, x: Array, x_dot: Array) -> Array:
        """dN/dt along x', shape (l, l-k)."""
        return self._per_velocity(self.equations.velocity_map_rate, x, x_dot)

    def actuation(self, x: Array) -> Array:
        """B''(x) of (16), shape (l, l-k)."""
        return self._per_velocity(self.equations.actuation, x)

    def constraint_hessian(self, x: Array, multiplier: Array) -> Array:
        """d(A^T lam)/dx at fixed lam, shape (l, l); not symmetric: the constraints do not integrate."""
        return np.tensordot(multiplier, self._constraints(x)[1], axes=1)

    def constraint_hessian_rate(self, x: Array, x_dot: Array, multiplier: Array) -> Array:
        """d/dt of :meth:`constraint_hessian` along x' at fixed lam, shape (l, l)."""
        equations, l = self.equations, len(self.coordinates)
        rate = np.zeros((l - len(self.velocity_names), l, l))
        plain(equations.constraint_derivative_rate)(equations.parameters, x, x_dot, rate)
        return np.tensordot(multiplier, rate, axes=1)

    def _constraints(self, x: Array) -> tuple[Array, Array]:
        l, k = len(self.coordinates), len(self.coordinates) - len(self.velocity_names)
        a, a_x = np.zeros((k, l)), np.zeros((k, l, l))
        plain(self.equations.constraints)(self.equations.parameters, x, a, a_x)
        return a, a_x

    def _per_velocity(self, fill: Callable[..., None], *given: Array) -> Array:
        matrix = np.zeros((len(self.coordinates), len(self.velocity_names)))
        plain(fill)(self.equations.parameters, *given, matrix)
        return matrix


platforms: Registry[type[Platform]] = Registry(
    "platform type", "mobman.model.platforms", "mobman.platforms"
)


# Kernels that all platforms have in common; the platform's own stand between them, see
# :class:`mobman.model.dynamics.Buffers`.


@kernel
def gather(at: Motion) -> None:
    """x and alpha out of q and z = (alpha, y')."""
    for i in range(at.x.shape[0]):
        at.x[i] = at.q[at.platform_index[i]]
    for i in range(at.alpha.shape[0]):
        at.alpha[i] = at.z[i]


@kernel
def assemble_velocity(at: Motion) -> None:
    """C = blkdiag(N, I) of (9), q' = C z and C' z, in q's order; what follows has a row of its own in
    the place of I's."""
    p = at.alpha.shape[0]
    for i in range(at.x.shape[0]):
        row = at.platform_index[i]
        at.q_dot[row] = at.x_dot[i]
        at.C_dot_z[row] = dot(at.N_rate[i], at.alpha)
        for j in range(p):
            at.C[row, j] = at.N[i, j]
    for j in range(at.arm.joints.shape[0]):
        row, column = at.arm.joints[j], p + at.arm.column[j]
        at.q_dot[row] = at.arm.ratio[j] * at.z[column]
        at.C[row, column] = at.arm.ratio[j]


@kernel
def assemble_constraints(at: Motion) -> None:
    """[A 0] of (16) and its rate, in q's order, from A and its derivatives."""
    for i in range(at.platform_A.shape[0]):
        for j in range(at.x.shape[0]):
            at.A[i, at.platform_index[j]] = at.platform_A[i, j]
            at.A_rate[i, at.platform_index[j]] = dot(at.A_x[i, j], at.x_dot)
