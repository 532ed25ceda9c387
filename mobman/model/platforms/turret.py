r"""Turret platforms: the body turns on a differential carriage, about an axis ahead of the axle.

With :math:`\beta = \theta + \psi` the direction of the carriage and a its offset, the reference point on
the turret's axis moves by

.. math:: \dot x_1 + \mathrm{i}\dot x_2 = (v + \mathrm{i}a\dot\beta)e^{\mathrm{i}\beta},

so that for :math:`a \ne 0` the two wheels and the turret's motor move the body in every direction.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import Field

from mobman.model.platforms.body import Knuckle, WheeledBody, WheelPart, required
from mobman.model.platforms.body_frame import BodyFramePlatform
from mobman.model.platforms.platform import Wheel, WheeledFields, platforms
from mobman.model.platforms.wheels import LENGTH_TOLERANCE, Site, carriers, joints_of, sides

_TURRET, _WHEELS = "turret", ("wheel_right", "wheel_left")  # of a platform by its numbers
_LEAST = 0.01  # m; with less offset the wheels can hardly move the body sideways


class TurretBody(WheeledBody):
    """The fields of ``[platform.body]``: the box turns on a carriage with a wheel on either side."""

    carriage_mass: float = Field(gt=0)  # without the wheels (kg)
    turret_velocity: float = Field(0.0, ge=0)  # largest rate of the turret (rad/s); 0: not known
    turret_effort: float = Field(0.0, ge=0)  # largest torque of the turret (N m); 0: not known


class TurretParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "turret"``; forward is that of the body, and of the
    carriage with the turret at 0."""

    turret: str | None = None  # URDF joint between the body and the carriage
    right_wheel: str | None = None  # URDF joint of the carriage's wheel on the right
    left_wheel: str | None = None  # URDF joint of the carriage's wheel on the left
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance between the wheels in the URDF."""
    offset: float | None = None
    """a (m): the turret's axis lies so far ahead of the axle; by default as in the URDF."""
    body: TurretBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` and ``offset`` are required
    then, and ``platform`` is under the turret's axis."""


@platforms.register("turret")
class Turret(BodyFramePlatform):
    r"""A body on a turret on a differential carriage, :math:`l = 6`, :math:`k = 3`.

    Coordinates :math:`x = (x_1, x_2, \theta, \psi, \phi_1, \phi_2)`: the turret's axis, the body's
    heading, the turret's angle, right and left wheel. :math:`\alpha = (\dot\phi_1, \dot\phi_2,
    \dot\psi)` are the motors' rates and the commands their torques: B is the identity. For URDFs
    whose root link is the body, with the carriage behind the turret's joint; where the root link is
    the carriage, that joint is the arm's first one on a differential platform. SpecError if the
    wheels are not behind the turret's joint, or its axis is above the axle.
    """

    fields = TurretParameters

    def __init__(self, site: Site, given: TurretParameters) -> None:
        R = given.wheel_radius
        (axis,) = site.steering("turret", _TURRET)
        places = site.pair("right_wheel", "left_wheel", *_WHEELS)
        if any(axis.joint not in carriers(site, place) for place in places):
            raise site.fault(
                "turret",
                f": {axis.joint!r} does not carry the wheels; where the body turns on a carriage that "
                "is the root link, use type 'differential'",
            )
        axle, half_track = sides(site, places[:1], places[1:])
        apart = axis.centre - axle
        if abs(apart[1]) > LENGTH_TOLERANCE:
            raise site.fault(
                "turret",
                f": its axis is {apart[1]:+.4f} m beside the middle of the wheels; allowed: ahead of "
                "it or behind it",
            )
        a = float(apart[0]) if given.offset is None else given.offset
        if abs(a) < _LEAST:
            raise site.fault(
                "offset",
                f" is {a:.4f} m; allowed: at least {_LEAST} m either way, or else the wheels do not "
                "move the body sideways",
            )
        W, turn = given.half_track or half_track, axis.turn
        # in the carriage's axes, which the turret turns against the body; beta' = theta' + turn psi'
        A_b, N_b, B_b = np.zeros((3, 6)), np.zeros((6, 3)), np.zeros((6, 3))
        A_b[0, :4] = 0.0, -1.0, a, a * turn  # no lateral slip of the axle
        for j, (place, side) in enumerate(zip(places, (W, -W), strict=True)):
            A_b[1 + j, :4] = 1.0, 0.0, side, side * turn  # no longitudinal slip of the wheel
            A_b[1 + j, 4 + j] = -R * place.sign
            v = 0.5 * R * place.sign
            N_b[:3, j] = v, a * v / side, v / side
            N_b[4 + j, j] = 1.0
        N_b[2:4, 2] = -turn, 1.0
        B_b[[4, 5, 3], [0, 1, 2]] = 1.0  # a motor on each wheel and on the turret
        super().__init__(
            joints_of([axis, *places]),
            ("alpha_1", "alpha_2", f"{axis.joint}_rate"),
            *(A_b, N_b, B_b),
            turned=(3, turn),
            wheels=[Wheel(joint, R) for joint in joints_of(places)],
            root_offset=np.array([-axis.centre[0], -axis.centre[1], R - axle[2]]),
            heading=given.heading,
        )

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart | Knuckle]:
        """A carriage with a wheel on either side."""
        body, R = given.body, given.wheel_radius
        W = required(origin, "half_track", given.half_track)
        a = required(origin, "offset", given.offset)
        motor = {"velocity": body.turret_velocity, "effort": body.turret_effort}
        yield Knuckle(_TURRET, (0.0, 0.0, R), body.carriage_mass, **motor)
        for name, y in zip(_WHEELS, (-W, W), strict=True):
            yield WheelPart(name, (-a, y, 0.0), parent=f"{_TURRET}_link")
