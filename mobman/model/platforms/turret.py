r"""Turret platforms: the body turns on a differential carriage, about an axis ahead of the axle.

With :math:`\beta = \theta + \psi` the direction of the carriage and a its offset, the reference point on
the turret's axis moves by

.. math:: \dot x_1 + \mathrm{i}\dot x_2 = (v + \mathrm{i}a\dot\beta)e^{\mathrm{i}\beta},

so that for :math:`a \ne 0` the two wheels and the turret's motor move the body in every direction.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.model.platforms.body import (
    Knuckle,
    WheeledBody,
    WheelPart,
    body_urdf,
    required,
    required_body,
)
from mobman.model.platforms.platform import Equations, Platform, Site, Wheel, platforms
from mobman.model.platforms.wheels import (
    LENGTH_TOLERANCE,
    Named,
    carriers,
    check_upright,
    joint_place,
    sides,
)
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.toml_model import Strict, validate

_RIGHT, _LEFT, _TURRET = "wheel_right", "wheel_left", "turret"  # of a platform by its numbers
_LEAST = 0.01  # m; with less offset the wheels can hardly move the body sideways


class TurretBody(WheeledBody):
    """The fields of ``[platform.body]``: the box turns on a carriage with a wheel on either side."""

    carriage_mass: float = Field(gt=0)
    """Without the wheels (kg)."""
    turret_velocity: float = Field(0.0, ge=0)
    """Largest rate of the turret (rad/s); 0: not known."""
    turret_effort: float = Field(0.0, ge=0)
    """Largest torque of the turret (N m); 0: not known."""


class TurretParameters(Strict):
    """The fields of ``[platform]`` for ``type = "turret"``."""

    turret: str | None = None
    """URDF joint between the body and the carriage."""
    right_wheel: str | None = None
    """URDF joint of the carriage's wheel on the right."""
    left_wheel: str | None = None
    """URDF joint of the carriage's wheel on the left."""
    wheel_radius: float = Field(gt=0)
    """R (m)."""
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance between the wheels in the URDF."""
    offset: float | None = None
    """a (m): the turret's axis lies so far ahead of the axle; by default as in the URDF."""
    heading: float = 0.0
    """Direction of forward in the root link's frame, about z from its x axis (rad): the carriage's
    with the turret at 0, and the body's."""
    body: TurretBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` and ``offset`` are required
    then, and ``platform`` is under the turret's axis."""


@platforms.register("turret")
class Turret(Platform):
    r"""A body on a turret on a differential carriage, :math:`l = 6`, :math:`k = 3`.

    Coordinates :math:`x = (x_1, x_2, \theta, \psi, \phi_1, \phi_2)`: the turret's axis, the body's
    heading, the turret's angle, right and left wheel. :math:`\alpha = (\dot\phi_1, \dot\phi_2,
    \dot\psi)` are the motors' rates and the commands their torques: B is the identity. For URDFs whose
    root link is the body, with the carriage behind the turret's joint; where the root link is the
    carriage, that joint is the arm's first one on a differential platform.

    Args:
        turret: Name of the turret's joint.
        wheels: Joint names of the right and the left wheel.
        radius: R (m).
        half_track: W (m).
        offset: a (m), not 0.
        turn: +1 where a positive angle turns the carriage to the left, else -1.
        signs: +1 where a wheel's positive rate drives forward, else -1.
        root_offset, heading: See :class:`Platform`.
    """

    def __init__(
        self,
        turret: str,
        wheels: tuple[str, str],
        radius: float,
        half_track: float,
        offset: float,
        turn: float = 1.0,
        signs: tuple[float, float] = (1.0, 1.0),
        root_offset: Array | None = None,
        heading: float = 0.0,
    ) -> None:
        self.radius, self.half_track, self.offset = radius, half_track, offset
        self.coordinates = (*BASE_JOINTS, turret, *wheels)
        self.velocity_names = ("alpha_1", "alpha_2", f"{turret}_rate")
        self.root_offset = np.zeros(3) if root_offset is None else root_offset
        self.heading = heading
        self.wheels = tuple(Wheel(joint, radius) for joint in wheels)
        self.equations = Equations(
            np.array([radius * signs[0], radius * signs[1], half_track, offset, turn]),
            *(_velocity_map, _velocity_map_rate, _constraints),
            *(_constraint_derivative_rate, _actuation),
        )

    @classmethod
    def build(cls, site: Site) -> Turret:
        given = site.read(TurretParameters)
        named = Named(site, given)
        (turret,) = named.names("turret", [_TURRET])
        axis = joint_place(site, turret, "turret", given.heading)
        check_upright(site, [axis], "turret")
        places = named.pair("right_wheel", "left_wheel", _RIGHT, _LEFT)
        if any(turret not in carriers(site, place) for place in places):
            raise site.fault(
                "turret",
                f": {turret!r} does not carry the wheels; where the body turns on a carriage that is "
                "the root link, use type 'differential'",
            )
        axle, half_track = sides(site, places[:1], places[1:])
        apart = axis.centre - axle
        if abs(apart[1]) > LENGTH_TOLERANCE:
            raise site.fault(
                "turret",
                f": its axis is {apart[1]:+.4f} m beside the middle of the wheels; allowed: ahead of "
                "it or behind it",
            )
        offset = float(apart[0]) if given.offset is None else given.offset
        if abs(offset) < _LEAST:
            raise site.fault(
                "offset",
                f" is {offset:.4f} m; allowed: at least {_LEAST} m either way, or else the wheels do "
                "not move the body sideways",
            )
        return cls(
            turret,
            (places[0].joint, places[1].joint),
            given.wheel_radius,
            half_track if given.half_track is None else given.half_track,
            offset,
            turn=float(np.sign(axis.axis[2])),
            signs=(places[0].sign, places[1].sign),
            root_offset=np.array([-axis.centre[0], -axis.centre[1], given.wheel_radius - axle[2]]),
            heading=given.heading,
        )

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box on a carriage with a wheel on either side."""
        given = validate(TurretParameters, parameters, f"{origin}: [platform]")
        body, R = required_body(origin, given.body), given.wheel_radius
        W = required(origin, "half_track", given.half_track)
        a = required(origin, "offset", given.offset)
        carriage = Knuckle(
            *(_TURRET, (0.0, 0.0, R), math.inf, body.turret_velocity, body.carriage_mass, R),
            effort=body.turret_effort,
        )
        wheels = [
            WheelPart(name, (-a, y, 0.0), R, parent=f"{_TURRET}_link")
            for name, y in ((_RIGHT, -W), (_LEFT, W))
        ]
        return body_urdf(body, wheels, [carriage])


# Parameters of the kernels: sign R of the right and of the left wheel, W, a, turn.


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """N of the class; v = (R phi_1' + R phi_2')/2, beta' = (R phi_1' - R phi_2')/(2 W)."""
    W, a, turn = parameters[2], parameters[3], parameters[4]
    c, s = math.cos(x[2] + turn * x[3]), math.sin(x[2] + turn * x[3])
    N[:, :] = 0.0
    for j in range(2):
        v = 0.5 * parameters[j]
        rate = v / W if j == 0 else -v / W
        N[0, j], N[1, j], N[2, j] = c * v - s * a * rate, s * v + c * a * rate, rate
        N[4 + j, j] = 1.0
    N[2, 2], N[3, 2] = -turn, 1.0


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of the same; the carriage's direction changes it."""
    W, a, turn = parameters[2], parameters[3], parameters[4]
    beta, beta_rate = x[2] + turn * x[3], x_dot[2] + turn * x_dot[3]
    c, s = math.cos(beta) * beta_rate, math.sin(beta) * beta_rate
    N_rate[:, :] = 0.0
    for j in range(2):
        v = 0.5 * parameters[j]
        rate = v / W if j == 0 else -v / W
        N_rate[0, j], N_rate[1, j] = -s * v - c * a * rate, c * v - s * a * rate


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """A motor on each wheel and on the turret."""
    B[:, :] = 0.0
    B[4, 0] = B[5, 1] = B[3, 2] = 1.0


@kernel
def _constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """No lateral slip of the axle, no slip of the right and of the left wheel."""
    W, a, turn = parameters[2], parameters[3], parameters[4]
    c, s = math.cos(x[2] + turn * x[3]), math.sin(x[2] + turn * x[3])
    A[:, :] = 0.0
    A_x[:, :, :] = 0.0
    A[0, 0], A[0, 1], A[0, 2], A[0, 3] = s, -c, a, a * turn
    A_x[0, 0, 2], A_x[0, 1, 2] = c, s
    for j in range(2):
        side = W if j == 0 else -W
        A[1 + j, 0], A[1 + j, 1], A[1 + j, 2], A[1 + j, 3] = c, s, side, side * turn
        A[1 + j, 4 + j] = -parameters[j]
        A_x[1 + j, 0, 2], A_x[1 + j, 1, 2] = -s, c
    for i in range(3):
        A_x[i, 0, 3], A_x[i, 1, 3] = turn * A_x[i, 0, 2], turn * A_x[i, 1, 2]


@kernel
def _constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A."""
    turn = parameters[4]
    beta, beta_rate = x[2] + turn * x[3], x_dot[2] + turn * x_dot[3]
    c, s = math.cos(beta) * beta_rate, math.sin(beta) * beta_rate
    A_x_rate[:, :, :] = 0.0
    for i in range(3):
        for m in (2, 3):
            factor = turn if m == 3 else 1.0
            A_x_rate[i, 0, m] = factor * (-s if i == 0 else -c)
            A_x_rate[i, 1, m] = factor * (c if i == 0 else -s)
