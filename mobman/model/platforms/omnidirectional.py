"""Omnidirectional platforms: three or more omni or mecanum wheels."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Literal

import numpy as np

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.platforms.body import Angle, SpreadBody, WheelPart
from mobman.model.platforms.body_frame import BodyFramePlatform
from mobman.model.platforms.platform import Wheel, WheeledFields, platforms
from mobman.model.platforms.wheels import AXIS_TOLERANCE, LENGTH_TOLERANCE, Site, joints_of

_SINGULAR = 1e-3  # ratio of singular values below which the wheels leave a direction free


class OmnidirectionalParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "omnidirectional"``."""

    kind: Literal["mecanum", "omni"]  # rollers at 45 degrees to the wheel's axis, or across it
    wheels: list[str] = []  # URDF joints of the wheels, three or more
    roller_angles: list[Angle] | None = None
    """For each wheel, the axis of the roller that touches the ground, seen from above and from the
    wheel's forward direction, anticlockwise (rad). By default 0 for omni wheels; for mecanum wheels
    -pi/4 front left and rear right, pi/4 front right and rear left."""
    body: SpreadBody | None = None  # the platform by its numbers instead of by a URDF


@platforms.register("omnidirectional")
class Omnidirectional(BodyFramePlatform):
    r"""Wheels with rollers, :math:`l = 3 + w` for w wheels, :math:`k = w`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_1, \dots, \phi_w)`, with (x1, x2) in the middle of
    the wheels; :math:`\alpha = (v_x, v_y, \omega)` in the platform's axes (m/s, rad/s). A roller lets
    its wheel slide across the roller's axis r only, so that along it the wheel's centre moves as the
    wheel turns, :math:`\langle r, v_c\rangle = R\dot\phi\,\langle r, f\rangle` with the wheel's
    forward direction f: one constraint a wheel, and none on the platform's own motion.

    The commands are the force and the torque on the platform (N, N, N m), so that B is the identity;
    the w motors share them with the least sum of squares, :math:`\tau = W(W^TW)^{-1} v` for
    :math:`\dot\phi = W\alpha`. SpecError if the wheels are less than three, or leave a direction of
    motion free.
    """

    fields = OmnidirectionalParameters

    def __init__(self, site: Site, given: OmnidirectionalParameters) -> None:
        own = _spots(given, site.origin)
        places = site.rolling(*(f"wheel_{name}" for name in own))
        names = joints_of(places)
        if len(set(names)) < 3:
            field = "wheels" if given.wheels else "body.angles"
            raise site.fault(
                field, f" gives {', '.join(names)}; allowed: three or more different joints"
            )
        centre = np.mean([place.centre for place in places], axis=0)
        positions = np.array([place.centre[:2] - centre[:2] for place in places])
        axes = np.array([place.axis for place in places])
        forward = np.column_stack([axes[:, 1], -axes[:, 0]])  # axis x z
        angles = _roller_angles(site, given, positions, forward)
        c, s = np.cos(angles), np.sin(angles)
        if np.any(np.abs(c) < _SINGULAR):
            raise site.fault(
                "roller_angles",
                f" is {given.roller_angles}; allowed: rollers that a wheel moves by turning, none at a "
                "right angle to its forward direction",
            )
        # a positive rate rolls a wheel ahead, or to the left where that is neither, or else backward
        ahead = np.where(np.abs(forward[:, 0]) > AXIS_TOLERANCE, forward[:, 0], forward[:, 1]) > 0.0
        x, y = (np.where(ahead, 1.0, -1.0)[:, None] * forward).T
        rollers = np.column_stack([c * x - s * y, s * x + c * y])
        rows = np.column_stack([rollers, _cross(positions, rollers)])
        singular = np.linalg.svd(rows, compute_uv=False)
        if singular[-1] < _SINGULAR * singular[0]:
            raise SpecError(
                f"{site.origin}: [platform]: these wheels and rollers leave a direction of motion free; "
                "check fields 'platform.wheels' (or 'platform.body'), 'platform.kind' and "
                "'platform.roller_angles'"
            )
        self.radius = R = given.wheel_radius
        along = np.einsum("ij,ij->i", rollers, forward)
        W = rows / (R * along[:, None])
        shares = W @ np.linalg.inv(W.T @ W)
        turned = np.arctan2(_cross(forward, rollers), along).tolist()
        super().__init__(
            names,
            ("v_x", "v_y", "omega"),
            np.hstack([rows, -R * np.diag(along)]),
            np.vstack([np.eye(3), W]),
            np.vstack([np.zeros((3, 3)), shares]),
            wheels=[Wheel(name, R, angle) for name, angle in zip(names, turned, strict=True)],
            root_offset=np.array([0.0, 0.0, R]) - centre,
            heading=given.heading,
        )

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart]:
        """Wheels on a rectangle or on a circle."""
        angles = given.body.angles if given.kind == "omni" else [0.5 * math.pi] * 4
        for (name, spot), angle in zip(_spots(given, origin).items(), angles, strict=True):
            place = *spot, given.wheel_radius
            yield WheelPart(f"wheel_{name}", place, angle - 0.5 * math.pi)


def _cross(a: Array, b: Array) -> Array:
    """The cross product of vectors of the plane, row by row."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _roller_angles(
    site: Site, given: OmnidirectionalParameters, positions: Array, forward: Array
) -> Array:
    if given.roller_angles is not None:
        if len(given.roller_angles) != len(positions):
            numbers = f"{len(given.roller_angles)} numbers for {len(positions)} wheels"
            raise site.fault("roller_angles", f" has {numbers}")
        return np.array(given.roller_angles)
    if given.kind == "omni":
        return np.zeros(len(positions))
    crooked = np.any(np.abs(forward[:, 1]) > AXIS_TOLERANCE)
    if crooked or np.any(np.abs(positions) < LENGTH_TOLERANCE):
        raise site.fault(
            "roller_angles",
            " is missing: it has a default only for mecanum wheels whose axes are along the platform's "
            "y, in front of and behind its middle",
        )
    return -0.25 * math.pi * np.sign(positions[:, 0] * positions[:, 1])


def _spots(given: OmnidirectionalParameters, origin: str) -> dict[str, tuple[float, float]]:
    """Places of the wheels of a platform described by its numbers (m), by name."""
    if given.body is None:
        return {}
    return given.body.spots(origin, given.kind == "omni", f"{given.kind} wheels need it")
