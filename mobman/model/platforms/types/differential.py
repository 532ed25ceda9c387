"""The differential-drive platform, type (2,0): the paper's."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.platforms.platform import Platform, platforms
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
        # Y = R/2W of (7), scaled, for each wheel
        self._y = tuple(kappa * radius / (2.0 * half_track) * sign for sign in signs)

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

    def constraint_matrix(self, x: Array) -> Array:
        """A of (6), with a = 0 of (2), shape (3, 5)."""
        # (2) and (6): no lateral slip, no longitudinal slip of the right and the left wheel
        c, s, r, w = math.cos(x[2]), math.sin(x[2]), self.radius, self.half_track
        right, left = self.signs
        return np.array(
            [
                [s, -c, self.offset, 0.0, 0.0],
                [c, s, w, -r * right, 0.0],
                [c, s, -w, 0.0, -r * left],
            ]
        )

    def constraint_matrix_rate(self, x: Array, x_dot: Array) -> Array:
        """dA/dt, shape (3, 5); only the heading changes it."""
        turning = float(x_dot[2])
        c, s = math.cos(x[2]) * turning, math.sin(x[2]) * turning
        return np.array([[c, s, 0.0, 0.0, 0.0], [-s, c, 0.0, 0.0, 0.0], [-s, c, 0.0, 0.0, 0.0]])

    def velocity_map(self, x: Array) -> Array:
        """N of (7) times kappa, shape (5, 2)."""
        # (7) with alpha scaled by kappa
        c, s, a, w = math.cos(x[2]), math.sin(x[2]), self.offset, self.half_track
        y_right, y_left = self._y
        return np.array(
            [
                [y_right * (w * c - a * s), y_left * (w * c + a * s)],
                [y_right * (w * s + a * c), y_left * (w * s - a * c)],
                [y_right, -y_left],
                [self.kappa, 0.0],
                [0.0, self.kappa],
            ]
        )

    def velocity_map_rate(self, x: Array, x_dot: Array) -> Array:
        """dN/dt, shape (5, 2)."""
        turning = float(x_dot[2])
        c, s = math.cos(x[2]) * turning, math.sin(x[2]) * turning
        a, w = self.offset, self.half_track
        y_right, y_left = self._y
        return np.array(
            [
                [-y_right * (w * s + a * c), -y_left * (w * s - a * c)],
                [y_right * (w * c - a * s), y_left * (w * c + a * s)],
                [0.0, 0.0],
                [0.0, 0.0],
                [0.0, 0.0],
            ]
        )

    def constraint_hessian(self, x: Array, multiplier: Array) -> Array:
        """d(A^T lam)/dx, shape (5, 5): its column of theta alone."""
        hessian = np.zeros((5, 5))
        c, s = math.cos(x[2]), math.sin(x[2])
        lateral, forward = multiplier[0], multiplier[1] + multiplier[2]
        hessian[0, 2] = c * lateral - s * forward
        hessian[1, 2] = s * lateral + c * forward
        return hessian

    def constraint_hessian_rate(self, x: Array, x_dot: Array, multiplier: Array) -> Array:
        """d/dt of the same, shape (5, 5)."""
        rate = np.zeros((5, 5))
        now = self.constraint_hessian(x, multiplier)
        rate[0, 2] = -now[1, 2] * x_dot[2]
        rate[1, 2] = now[0, 2] * x_dot[2]
        return rate

    @property
    def actuation(self) -> Array:
        """B'': the motors turn the wheels, shape (5, 2)."""
        selection = np.zeros((5, 2))
        selection[3, 0] = selection[4, 1] = 1.0
        return selection


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
