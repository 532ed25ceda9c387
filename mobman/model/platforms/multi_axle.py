r"""Platforms of several axles, each of them steered or fixed: trucks, four-wheel steering.

The axles of all wheels meet in one point at any time. Here it stays on one line across the platform:
that of the axle which is fixed, or, where every axle is steered, the one that the steering is built
around (symmetrical steering of two axles: midway). With the reference point on that line the platform
travels straight ahead there, :math:`\psi = 0`, and its motion is that of :mod:`~.swerve` for this
:math:`\psi`: type (1,1) of Campion, Bastin and d'Andrea-Novel, a car whose steering is told by the
curvature :math:`\kappa` of its path in place of an angle. A module at :math:`\rho_i` stands at the angle
of :math:`\zeta_i = 1 + \mathrm{i}\kappa\rho_i`; it is singular on that line only, where it is refused.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import Field

from mobman.errors import SpecError
from mobman.model.platforms.body import Knuckle, WheeledBody, WheelPart, required
from mobman.model.platforms.platform import WheeledFields, platforms
from mobman.model.platforms.swerve import (
    Module,
    Modules,
    ModuleWheel,
    Swerve,
    located,
    modules_of,
)
from mobman.model.platforms.wheels import LENGTH_TOLERANCE, Site, carriers, joints_of, wheel_place
from mobman.robots.urdf.compose import TRAVEL_JOINTS

_SIDES = {"right": -1.0, "left": 1.0}


class MultiAxleBody(WheeledBody):
    """The fields of ``[platform.body]``: axles with a right and a left wheel each."""

    axles: list[float] = Field(min_length=2)  # their places ahead of platform (m)
    steered: list[int] = Field(min_length=1)  # numbers of those that are steered, from 1
    half_track: float = Field(gt=0)  # m
    steering_limit: float = Field(gt=0)  # largest angle of a knuckle (rad)
    steering_velocity: float = Field(0.0, ge=0)  # largest steering rate (rad/s); 0: not known
    steering_effort: float = Field(0.0, ge=0)  # largest steering torque (N m); 0: not known
    knuckle_mass: float = Field(gt=0)  # mass of what a steering joint turns, without the wheel (kg)


class MultiAxleParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "multi-axle"``."""

    steering: list[str] = []  # URDF joints that steer
    wheels: list[str] = []
    """URDF joints of all wheels that roll: behind those, and of the axle that is fixed."""
    driven: list[str] = []  # those with a motor; by default all
    axle: float | None = None
    """Place of the line on which the centre of rotation stays, ahead of the root link (m): by default
    that of the wheels that are fixed."""
    body: MultiAxleBody | None = None  # the platform by its numbers instead of by a URDF


@platforms.register("multi-axle")
class MultiAxle(Swerve):
    r"""n steering joints and w wheels: :math:`l = 4 + n + w`, :math:`k = 2 + n + w`.

    Coordinates :math:`x = (x_1, x_2, \theta, \kappa, \delta_1, \dots, \delta_n, \phi_1, \dots,
    \phi_w)` with (x1, x2) on the line of the fixed axle. :math:`\alpha = (v, \dot\kappa)` (m/s,
    1/(m s)): :math:`\dot\theta = v\kappa`, :math:`\delta_i = \arg\zeta_i`; the commands are the forces
    that belong to them. The steering joints and the driven wheels make these with the least sum of
    squares. Steering moves no tip at once, as a car's.
    """

    fields = MultiAxleParameters
    virtual_joints = TRAVEL_JOINTS[1:]
    velocity_names = ("v", "kappa_dot")

    def found(self, site: Site, given: Any) -> Modules:
        """See :meth:`Swerve.found`; the joints say which wheels are steered."""
        axes, places = located(site, *_names(given.body, site.origin))
        wheels, steering = joints_of(places), set(joints_of(axes))
        turned = [place for place in places if {*carriers(site, place)} & steering]
        fixed = [name for name in wheels if name not in joints_of(turned)]
        straight = [wheel_place(site, name, "wheels", given.heading) for name in fixed]
        ahead = [float(place.centre[0]) for place in straight]
        if ahead and max(ahead) - min(ahead) > LENGTH_TOLERANCE:
            raise site.fault(
                "wheels",
                f": the wheels {', '.join(fixed)}, which are not steered, are "
                f"{np.round(ahead, 4).tolist()} m ahead; allowed: one axle (several slip when it turns)",
            )
        axle = given.axle
        if axle is None:
            why = "no wheel is fixed; say on which line across the platform the centre of rotation"
            found = float(np.mean(ahead)) if ahead else None
            axle = required(site.origin, "axle", found, f"{why} stays")
        elif ahead and abs(axle - np.mean(ahead)) > LENGTH_TOLERANCE:
            raise site.fault(
                "axle",
                f" is {axle:g} m; the wheels that are not steered have theirs {np.mean(ahead):.4f} m "
                "ahead",
            )
        middle = complex(axle, float(np.mean([p.centre[1] for p in (straight or places)])))
        for place in axes:
            if abs(place.centre[0] - axle) < LENGTH_TOLERANCE:
                raise site.fault(
                    "steering",
                    f": {place.joint!r} is on the line of the axle, {axle:.4f} m ahead, where it is "
                    "singular; allowed: before or behind it",
                )
        modules, rolling = modules_of(site, axes, turned, middle)
        for at, place in enumerate(straight, start=len(modules)):
            modules.append(Module("", place.at - middle, 1.0, 0.0))
            rolling.append(ModuleWheel(place.joint, at, 0.0, place.sign))
        if unknown := set(given.driven) - set(wheels):
            raise site.fault(
                "driven", f" names {sorted(unknown)[0]!r}; allowed: of {', '.join(wheels)}"
            )
        driven = set(given.driven or wheels)
        rolling = [one._replace(driven=one.joint in driven) for one in rolling]
        return Modules(middle, modules, rolling, places)

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart | Knuckle]:
        """Axles of a right and a left wheel each."""
        body, R = given.body, given.wheel_radius
        motion = body.knuckle_mass, body.steering_limit, body.steering_velocity
        for i, x in enumerate(body.axles, start=1):
            for side, sign in _SIDES.items():
                spot, name = (x, sign * body.half_track, R), f"{i}_{side}"
                if i in body.steered:
                    yield Knuckle(f"steering_{name}", spot, *motion, body.steering_effort)
                    yield WheelPart(f"wheel_{name}", parent=f"steering_{name}_link")
                else:
                    yield WheelPart(f"wheel_{name}", spot)


def _names(body: MultiAxleBody | None, origin: str) -> tuple[list[str], list[str]]:
    """Names of the places of a platform by its numbers: of those that are steered, and of all."""
    if body is None:
        return [], []
    every = range(1, len(body.axles) + 1)
    if not set(body.steered) <= set(every):
        raise SpecError(
            f"{origin}: field 'platform.body.steered' is {body.steered}; allowed: numbers of axles, 1 "
            f"to {len(body.axles)}"
        )
    names = [(i, f"{i}_{side}") for i in every for side in _SIDES]
    return [name for i, name in names if i in body.steered], [name for _, name in names]
