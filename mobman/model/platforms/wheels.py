"""Positions of a URDF's wheels, and the directions in which they roll."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.platforms.platform import Site
from mobman.robots.urdf.compose import BASE_JOINTS

AXIS_TOLERANCE = 1e-2
"""Tolerance of an axis (rad): angles such as 1.57 and 3.1 are rounded."""
LENGTH_TOLERANCE = 5e-3
"""Tolerance of centres (m). The equations have them where they should be."""


class JointPlace(NamedTuple):
    """A joint in axes that are parallel to the platform's, from the root link's origin."""

    joint: str
    centre: Array
    """m, shape (3,)."""
    axis: Array
    """Unit vector, shape (3,)."""

    @property
    def sign(self) -> float:
        """+1 where a positive rate about the axis rolls a wheel forward, -1 where backward."""
        return float(np.sign(self.axis[1]))


def joint_place(site: Site, name: str, field: str, heading: float) -> JointPlace:
    """Locate a joint.

    Args:
        site: The description and its tree.
        name: The joint.
        field: The field of ``[platform]`` that names it, for messages.
        heading: Direction of the platform's x axis in the root link's frame (rad).

    Raises:
        SpecError: If there is no such movable joint.
    """
    tree = site.tree
    if not tree.existJointName(name):
        movable = ", ".join(n for n in list(tree.names)[1:] if n not in BASE_JOINTS) or "none"
        raise SpecError(
            f"{site.origin}: field 'platform.{field}': the URDF has no movable joint {name!r}; it "
            f"has: {movable}"
        )
    data = tree.createData()
    pin.computeJointJacobians(tree, data, pin.neutral(tree))
    index = tree.getJointId(name)
    columns = pin.getJointJacobian(tree, data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    turn = pin.utils.rotate("z", -heading)
    axis = turn @ columns[3:, tree.joints[index].idx_v]
    centre = turn @ data.oMi[index].translation * np.array([1.0, site.track, 1.0])
    return JointPlace(name, centre, axis)


def wheel_place(site: Site, name: str, field: str, heading: float) -> JointPlace:
    """Locate a wheel whose axis is along the platform's y.

    Raises:
        SpecError: If it is no movable joint, or its axis is another.
    """
    place = joint_place(site, name, field, heading)
    if abs(place.axis[1]) < math.cos(AXIS_TOLERANCE):
        raise SpecError(
            f"{site.origin}: field 'platform.{field}': the axis of joint {name!r} is "
            f"{place.axis.round(3)} in the platform frame; a wheel turns about the platform's y axis "
            "(to the left; see field 'platform.heading' for a root link whose x axis is not forward)"
        )
    return place


def carriers(site: Site, place: JointPlace) -> list[str]:
    """The joints that carry a joint, itself included."""
    tree = site.tree
    return [tree.names[i] for i in tree.supports[tree.getJointId(place.joint)] if i]


def check_upright(site: Site, places: Sequence[JointPlace], field: str) -> None:
    """Check that steering joints have vertical axes.

    Raises:
        SpecError: If one has not.
    """
    for place in places:
        if abs(place.axis[2]) < math.cos(AXIS_TOLERANCE):
            raise SpecError(
                f"{site.origin}: field 'platform.{field}': the axis of joint {place.joint!r} is "
                f"{place.axis.round(3)} in the platform frame; a steering joint's is vertical"
            )


def check_level(site: Site, places: Sequence[JointPlace]) -> None:
    """Check that the joints of ``platform.wheels`` have horizontal axes at one height.

    Raises:
        SpecError: If one has not.
    """
    for place in places:
        if abs(place.axis[2]) > AXIS_TOLERANCE:
            raise SpecError(
                f"{site.origin}: field 'platform.wheels': the axis of joint {place.joint!r} is "
                f"{place.axis.round(3)} in the platform frame; a wheel's is horizontal"
            )
        if abs(place.centre[2] - places[0].centre[2]) > LENGTH_TOLERANCE:
            raise SpecError(
                f"{site.origin}: field 'platform.wheels': {places[0].joint!r} and {place.joint!r} are "
                f"at heights {places[0].centre[2]:.4f} and {place.centre[2]:.4f}; wheels of one radius "
                "on one ground are at one height"
            )


def sides(
    site: Site, right: Sequence[JointPlace], left: Sequence[JointPlace]
) -> tuple[Array, float]:
    """The middle between right and left wheels, and half the track.

    Returns:
        The centre of all wheels (m), shape (3,), and half the distance of the two sides (m).

    Raises:
        SpecError: If the wheels are not on two parallel lines, at one height, the right ones on the
            right; or if one axle has its right wheel ahead of the left one.
    """
    places = [*right, *left]
    centre = np.mean([np.mean([p.centre for p in side], axis=0) for side in (right, left)], axis=0)
    half_track = 0.5 * float(
        np.mean([p.centre[1] for p in left]) - np.mean([p.centre[1] for p in right])
    )
    level = all(abs(p.centre[2] - centre[2]) <= LENGTH_TOLERANCE for p in places)
    on_lines = all(
        abs(p.centre[1] - centre[1] - side * half_track) <= LENGTH_TOLERANCE
        for side, wheels in ((-1.0, right), (1.0, left))
        for p in wheels
    )
    ahead_right, ahead_left = (
        np.array(sorted(float(p.centre[0]) for p in wheels)) for wheels in (right, left)
    )
    paired = len(right) == len(left) and bool(
        np.all(np.abs(ahead_right - ahead_left) <= LENGTH_TOLERANCE)
    )
    if not (half_track > 0 and level and on_lines and paired):
        listing = ", ".join(f"{p.joint!r} at {p.centre.round(4)}" for p in places)
        raise SpecError(
            f"{site.origin}: [platform]: the wheels {listing} are not a right and a left one on one "
            "axle along y (or several such pairs): x and z must agree, and the left one's y be the "
            "larger"
        )
    return centre, half_track
