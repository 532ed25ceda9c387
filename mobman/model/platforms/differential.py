"""The differential-drive platform, type (2,0): the paper's."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from mobman.model.platforms.body import WheeledBody, WheelPart, body_urdf, required, required_body
from mobman.model.platforms.body_frame import BodyFramePlatform
from mobman.model.platforms.platform import Gear, Site, Wheel, WheeledFields, platforms
from mobman.model.platforms.wheels import Named, sides
from mobman.toml_model import validate

_RIGHT, _LEFT = "wheel_right", "wheel_left"  # of a platform described by its numbers


class DifferentialParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "differential"``."""

    right_wheel: str | None = None
    """URDF joint of the driven wheel on the right (phi_1)."""
    left_wheel: str | None = None
    """URDF joint of the driven wheel on the left (phi_2)."""
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance between the wheels in the URDF."""
    alpha: Literal["wheel-rates", "paper"] = "wheel-rates"
    """Quasi-velocities: the wheels' rates (7), or those of (5) with phi' = (2/R) alpha."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of the axle, as in (6) and (7); 0 is the
    point on the axle of (2) and (5), the arm's mount is the other usual choice."""
    body: WheeledBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` is required then."""


class TwoSided(BodyFramePlatform):
    """Wheels on two sides, those of a side geared together; their axles do not slip sideways in the
    middle.

    Args:
        right: Joint names of the wheels on the right, the one with the motor first.
        left: The same on the left.
        radius: R (m).
        half_track: W (m).
        offset: a (m), the reference point ahead of the middle.
        kappa: phi'/alpha.
        signs: +1 where a wheel's positive rate drives forward, -1 where backward; right, then left.
        **place: See :class:`BodyFramePlatform`.
    """

    def __init__(
        self,
        right: Sequence[str],
        left: Sequence[str],
        radius: float,
        half_track: float,
        offset: float = 0.0,
        kappa: float = 1.0,
        signs: Sequence[float] | None = None,
        **place: Any,
    ) -> None:
        joints = (*right, *left)
        w = len(joints)
        self.signs = (1.0,) * w if signs is None else tuple(signs)
        self.radius, self.half_track, self.offset, self.kappa = radius, half_track, offset, kappa
        R, W, a = radius, half_track, offset
        A_b, N_b, B_b = np.zeros((1 + w, 3 + w)), np.zeros((3 + w, 2)), np.zeros((3 + w, 2))
        A_b[0, :3] = 0.0, -1.0, a  # no lateral slip; below it no longitudinal slip of each wheel
        geared = []
        for j, (names, side) in enumerate(((right, 1.0), (left, -1.0))):
            first = j * len(right)
            forward = self.signs[first]
            Y = kappa * R / (2.0 * W) * forward
            N_b[:3, j] = Y * W, side * Y * a, side * Y
            B_b[3 + first, j] = 1.0
            for i, name in enumerate(names, start=first):
                A_b[1 + i, :3] = 1.0, 0.0, side * W
                A_b[1 + i, 3 + i] = -R * self.signs[i]
                N_b[3 + i, j] = kappa * self.signs[i] * forward
                if i != first:
                    geared.append(Gear(name, names[0], self.signs[i] * forward))
        self.geared = tuple(geared)
        wheels = tuple(Wheel(joint, R) for joint in joints)
        super().__init__(joints, ("alpha_1", "alpha_2"), A_b, N_b, B_b, wheels=wheels, **place)


@platforms.register("differential")
class Differential(TwoSided):
    r"""Two driven wheels on one axle that neither slip nor skid, :math:`l = 5`, :math:`k = 3`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_1, \phi_2)`, right wheel first. With the reference
    point ``a`` ahead of the axle, A is (6) and N is (7) times ``kappa``, where
    :math:`\dot\phi = \kappa\alpha`: 1 for wheel rates, 2/R for the alpha of (5). With a = 0 they
    are (2) and, for the paper's alpha, (5).

    Args:
        wheels: Joint names of the right and the left wheel.
        radius: R (m).
        half_track: W (m).
        offset, kappa, signs, place: See :class:`TwoSided`.
    """

    def __init__(
        self,
        wheels: tuple[str, str],
        radius: float,
        half_track: float,
        offset: float = 0.0,
        kappa: float = 1.0,
        **place: Any,
    ) -> None:
        super().__init__(wheels[:1], wheels[1:], radius, half_track, offset, kappa, **place)

    @classmethod
    def build(cls, site: Site) -> Differential:
        """See :meth:`Platform.build`; the wheels say where the axle is, and which way they roll."""
        given = site.read(DifferentialParameters)
        right, left = Named(site, given).pair("right_wheel", "left_wheel", _RIGHT, _LEFT)
        axle, half_track = sides(site, [right], [left])
        R, a = given.wheel_radius, given.reference_offset
        return cls(
            wheels=(right.joint, left.joint),
            radius=R,
            half_track=half_track if given.half_track is None else given.half_track,
            offset=a,
            kappa=1.0 if given.alpha == "wheel-rates" else 2.0 / R,
            signs=(right.sign, left.sign),
            root_offset=np.array([-a, 0.0, R]) - axle,
            heading=given.heading,
        )

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box with a wheel on either side."""
        given = validate(DifferentialParameters, parameters, f"{origin}: [platform]")
        body = required_body(origin, given.body)
        R, W = given.wheel_radius, required(origin, "half_track", given.half_track)
        wheels = [WheelPart(name, (0.0, y, R), R) for name, y in ((_RIGHT, -W), (_LEFT, W))]
        return body_urdf(body, wheels)
