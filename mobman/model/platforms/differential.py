"""Platforms with fixed wheels on two sides: the differential drive, type (2,0), which is the paper's,
and skid-steering."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np
from pydantic import Field

from mobman.model.platforms.body import WheeledBody, WheelPart, required
from mobman.model.platforms.body_frame import BodyFramePlatform
from mobman.model.platforms.platform import Gear, Wheel, WheeledFields, platforms
from mobman.model.platforms.wheels import JointPlace, Site, joints_of, sides

_WHEELS = ("wheel_right", "wheel_left")  # of a platform described by its numbers


class _TrackFields(WheeledFields):
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance between the sides in the URDF."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of the middle of the wheels."""


class DifferentialParameters(_TrackFields):
    """The fields of ``[platform]`` for ``type = "differential"``."""

    right_wheel: str | None = None  # URDF joint of the driven wheel on the right (phi_1)
    left_wheel: str | None = None  # URDF joint of the driven wheel on the left (phi_2)
    alpha: Literal["wheel-rates", "paper"] = "wheel-rates"
    """Quasi-velocities: the wheels' rates (7), or those of (5) with phi' = (2/R) alpha."""
    body: WheeledBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` is required then."""


class TwoSided(BodyFramePlatform):
    """Wheels on two sides, those of a side geared together; their axles do not slip sideways in the
    middle.

    Args:
        site, given: The description and its fields.
        right: The wheels on the right, the one with the motor first.
        left: The same on the left.
        kappa: phi'/alpha.
        factor: The effective track over the geometric one.
    """

    def __init__(
        self,
        site: Site,
        given: Any,
        right: Sequence[JointPlace],
        left: Sequence[JointPlace],
        kappa: float = 1.0,
        factor: float = 1.0,
    ) -> None:
        middle, half_track = sides(site, right, left)
        self.radius, self.offset, self.kappa = given.wheel_radius, given.reference_offset, kappa
        self.half_track = (given.half_track or half_track) * factor
        R, W, a = self.radius, self.half_track, self.offset
        joints = joints_of([*right, *left])
        self.signs = tuple(place.sign for place in (*right, *left))
        w = len(joints)
        A_b, N_b, B_b = np.zeros((1 + w, 3 + w)), np.zeros((3 + w, 2)), np.zeros((3 + w, 2))
        A_b[0, :3] = 0.0, -1.0, a  # no lateral slip; below it no longitudinal slip of each wheel
        geared = []
        for j, (places, side) in enumerate(((right, 1.0), (left, -1.0))):
            first, motor = j * len(right), places[0]
            Y = kappa * R / (2.0 * W) * motor.sign
            N_b[:3, j] = Y * W, side * Y * a, side * Y
            B_b[3 + first, j] = 1.0
            for i, place in enumerate(places, start=first):
                A_b[1 + i, :3] = 1.0, 0.0, side * W
                A_b[1 + i, 3 + i] = -R * place.sign
                N_b[3 + i, j] = kappa * place.sign * motor.sign
                if i != first:
                    geared.append(Gear(place.joint, motor.joint, place.sign * motor.sign))
        self.geared = tuple(geared)
        super().__init__(
            joints,
            ("alpha_1", "alpha_2"),
            *(A_b, N_b, B_b),
            wheels=[Wheel(joint, R) for joint in joints],
            root_offset=np.array([-a, 0.0, R]) - middle,
            heading=given.heading,
        )


@platforms.register("differential")
class Differential(TwoSided):
    r"""Two driven wheels on one axle that neither slip nor skid, :math:`l = 5`, :math:`k = 3`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_1, \phi_2)`, right wheel first. With the reference
    point ``a`` ahead of the axle (the arm's mount, say), A is (6) and N is (7) times ``kappa``, where
    :math:`\dot\phi = \kappa\alpha`: 1 for wheel rates, 2/R for the alpha of (5). With a = 0 they
    are (2) and, for the paper's alpha, (5).
    """

    fields = DifferentialParameters

    def __init__(self, site: Site, given: DifferentialParameters) -> None:
        right, left = site.pair("right_wheel", "left_wheel", *_WHEELS)
        kappa = 1.0 if given.alpha == "wheel-rates" else 2.0 / given.wheel_radius
        super().__init__(site, given, [right], [left], kappa)

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart]:
        """A wheel on either side."""
        R, W = given.wheel_radius, required(origin, "half_track", given.half_track)
        return [WheelPart(name, (0.0, y, R)) for name, y in zip(_WHEELS, (-W, W), strict=True)]


class SkidSteerBody(WheeledBody):
    """The fields of ``[platform.body]`` for skid-steering: four wheels."""

    wheelbase: float = Field(gt=0)  # distance of the front and the rear axle (m)


class SkidSteerParameters(_TrackFields):
    """The fields of ``[platform]`` for ``type = "skid-steer"``."""

    right_wheels: list[str] = []
    """URDF joints of the wheels on the right, the one that stands for all of them first."""
    left_wheels: list[str] = []  # the same on the left
    track_factor: float = Field(1.0, ge=1)
    """The effective track is so many times the geometric one: it turns as slowly as a differential
    platform of that track. Identified on the ground that is driven on; 1 is no slip of the side."""
    body: SkidSteerBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` is required then."""


@platforms.register("skid-steer")
class SkidSteer(TwoSided):
    r"""Wheels geared together on each side, as a differential platform with an effective track
    (Mandow et al., IROS 2007): :math:`l = 3 + w` for w wheels, :math:`k = 1 + w`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_{r1}, \phi_{r2}, \dots, \phi_{l1}, \dots)`,
    :math:`\alpha` the rates of the right and the left side. The middle does not slip sideways; that
    the wheels do is no constraint. One motor a side; B is the identity.
    """

    fields = SkidSteerParameters
    skids = True

    def __init__(self, site: Site, given: SkidSteerParameters) -> None:
        right, left = (site.wheels(f"{side}_wheels", *_names(side)) for side in ("right", "left"))
        super().__init__(site, given, right, left, factor=given.track_factor)

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart]:
        """Two wheels on either side."""
        R, W = given.wheel_radius, required(origin, "half_track", given.half_track)
        ahead = 0.5 * given.body.wheelbase
        for side, y in (("right", -W), ("left", W)):
            for name, x in zip(_names(side), (ahead, -ahead), strict=True):
                yield WheelPart(name, (x, y, R))


def _names(side: str) -> list[str]:
    """Names of the wheels' joints of a platform described by its numbers."""
    return [f"wheel_front_{side}", f"wheel_rear_{side}"]
