"""The differential-drive platform, type (2,0): the paper's."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.errors import SpecError
from mobman.kernels.kernel import kernel
from mobman.model.platforms.platform import Equations, Platform, platforms
from mobman.robots.urdf import BASE_JOINTS
from mobman.toml_model import Strict, validate

_AXIS_TOLERANCE = 1e-3  # rad: how far a wheel's axis may be from the platform's y axis
_LENGTH_TOLERANCE = 1e-3  # m: how far the wheels' centres may be from one axle


class DifferentialParameters(Strict):
    """The fields of ``[platform]`` for ``type = "differential"``."""

    right_wheel: str
    """URDF joint of the driven wheel on the right (phi_1)."""
    left_wheel: str
    """URDF joint of the driven wheel on the left (phi_2)."""
    wheel_radius: float = Field(gt=0)
    """R (m)."""
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance between the wheels in the URDF."""
    alpha: Literal["wheel-rates", "paper"] = "wheel-rates"
    """Quasi-velocities: the wheels' rates (7), or those of (5) with phi' = (2/R) alpha."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of the axle, as in (6) and (7); 0 is the
    point on the axle of (2) and (5), the arm's mount is the other usual choice."""


class Differential(Platform):
    r"""Two driven wheels on one axle that neither slip nor skid, :math:`l = 5`, :math:`k = 3`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_1, \phi_2)`, right wheel first. With the reference
    point ``a`` ahead of the axle, A is (6) and N is (7) times ``kappa``, where
    :math:`\dot\phi = \kappa\alpha`: 1 for wheel rates, 2/R for the alpha of (5). With a = 0 they
    are (2) and, for the paper's alpha, (5).

    Args:
        wheels: Joint names of the right and the left wheel.
        radius: R (m).
        half_track: W (m).
        offset: a (m).
        kappa: phi'/alpha.
        signs: +1 where a wheel's positive rate drives forward, -1 where backward: URDFs differ.
        root_offset: See :class:`Platform`.
    """

    def __init__(
        self,
        wheels: tuple[str, str],
        radius: float,
        half_track: float,
        offset: float = 0.0,
        kappa: float = 1.0,
        signs: tuple[float, float] = (1.0, 1.0),
        root_offset: Array | None = None,
    ) -> None:
        self.coordinates = (*BASE_JOINTS, *wheels)
        self.velocity_names = ("alpha_1", "alpha_2")
        self.radius = radius
        self.half_track = half_track
        self.offset = offset
        self.kappa = kappa
        self.signs = signs
        self.root_offset = np.zeros(3) if root_offset is None else root_offset
        self._equations = Equations(
            np.array([radius, half_track, offset, kappa, *signs]),
            _velocity_map,
            _velocity_map_rate,
            _constraints,
            _constraint_derivative_rate,
        )

    @classmethod
    def build(cls, parameters: dict[str, Any], tree: pin.Model, origin: str) -> Differential:
        """See :meth:`Platform.build`; the wheels say where the axle is, and which way they roll."""
        given = validate(DifferentialParameters, parameters, f"{origin}: [platform]")
        right, left = (
            _wheel(tree, name, f"{origin}: field 'platform.{side}'")
            for name, side in ((given.right_wheel, "right_wheel"), (given.left_wheel, "left_wheel"))
        )
        gap = left[0] - right[0]
        if gap[1] <= 0 or max(abs(gap[0]), abs(gap[2])) > _LENGTH_TOLERANCE:
            raise SpecError(
                f"{origin}: [platform]: the wheels {given.right_wheel!r} at {right[0].round(4)} and "
                f"{given.left_wheel!r} at {left[0].round(4)} are not a right and a left one on one "
                "axle along y: x and z must agree, and the left one's y be the larger"
            )
        axle = 0.5 * (left[0] + right[0])
        return cls(
            wheels=(given.right_wheel, given.left_wheel),
            radius=given.wheel_radius,
            half_track=0.5 * float(gap[1]) if given.half_track is None else given.half_track,
            offset=given.reference_offset,
            kappa=1.0 if given.alpha == "wheel-rates" else 2.0 / given.wheel_radius,
            signs=(right[1], left[1]),
            root_offset=np.array([-given.reference_offset, 0.0, given.wheel_radius]) - axle,
        )

    @property
    def equations(self) -> Equations:
        """(6) and (7)."""
        return self._equations

    @property
    def actuation(self) -> Array:
        """B'': the motors turn the wheels, shape (5, 2)."""
        selection = np.zeros((5, 2))
        selection[3, 0] = selection[4, 1] = 1.0
        return selection


# Parameters of the kernels: R, W, a, kappa, and the wheels' signs; x = (x_1, x_2, theta, phi_1, phi_2).


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """(7), with alpha scaled by kappa; with a = 0 and the paper's alpha it is (5)."""
    R, W, a, kappa = parameters[0], parameters[1], parameters[2], parameters[3]
    c, s = math.cos(x[2]), math.sin(x[2])
    for j in range(2):
        side = 1.0 - 2.0 * j  # of the wheel: right, left
        Y = kappa * R / (2.0 * W) * parameters[4 + j]
        N[0, j] = Y * (W * c - side * a * s)
        N[1, j] = Y * (W * s + side * a * c)
        N[2, j] = side * Y
        N[3, j] = kappa * (1 - j)
        N[4, j] = kappa * j


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of (7); only the heading changes it."""
    R, W, a, kappa = parameters[0], parameters[1], parameters[2], parameters[3]
    c, s = math.cos(x[2]) * x_dot[2], math.sin(x[2]) * x_dot[2]
    for j in range(2):
        side = 1.0 - 2.0 * j
        Y = kappa * R / (2.0 * W) * parameters[4 + j]
        N_rate[0, j] = -Y * (W * s + side * a * c)
        N_rate[1, j] = Y * (W * c - side * a * s)
        N_rate[2, j] = N_rate[3, j] = N_rate[4, j] = 0.0


@kernel
def _constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """(6), with a = 0 (2): no lateral slip, no longitudinal slip of the right and the left wheel."""
    R, W, a = parameters[0], parameters[1], parameters[2]
    c, s = math.cos(x[2]), math.sin(x[2])
    A[:, :] = 0.0
    A_x[:, :, :] = 0.0
    A[0, 0], A[0, 1], A[0, 2] = s, -c, a
    A_x[0, 0, 2], A_x[0, 1, 2] = c, s
    for j in range(2):
        side = 1.0 - 2.0 * j
        A[1 + j, 0], A[1 + j, 1], A[1 + j, 2] = c, s, side * W
        A[1 + j, 3 + j] = -R * parameters[4 + j]
        A_x[1 + j, 0, 2], A_x[1 + j, 1, 2] = -s, c


@kernel
def _constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of (6)."""
    c, s = math.cos(x[2]) * x_dot[2], math.sin(x[2]) * x_dot[2]
    A_x_rate[:, :, :] = 0.0
    A_x_rate[0, 0, 2], A_x_rate[0, 1, 2] = -s, c
    for j in range(2):
        A_x_rate[1 + j, 0, 2], A_x_rate[1 + j, 1, 2] = -c, -s


def _wheel(tree: pin.Model, name: str, field: str) -> tuple[Array, float]:
    """Centre (3,) of a wheel in the platform frame, and the sense of its axis along y.

    Raises:
        SpecError: If there is no such joint, or it is not a wheel of this platform.
    """
    if not tree.existJointName(name):
        movable = ", ".join(n for n in list(tree.names)[1:] if n not in BASE_JOINTS)
        raise SpecError(f"{field}: the URDF has no movable joint {name!r}; it has: {movable}")
    data = tree.createData()
    pin.computeJointJacobians(tree, data, pin.neutral(tree))
    index = tree.getJointId(name)
    columns = pin.getJointJacobian(tree, data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    axis = np.array(columns[3:, tree.joints[index].idx_v])
    if abs(axis[1]) < np.cos(_AXIS_TOLERANCE):
        raise SpecError(
            f"{field}: the axis of joint {name!r} is {axis.round(3)} in the platform frame; a wheel "
            "turns about the platform's y axis (to the left)"
        )
    return np.array(data.oMi[index].translation), float(np.sign(axis[1]))


platforms.register("differential", Differential)
