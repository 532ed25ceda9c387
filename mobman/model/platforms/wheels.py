"""The description that a platform is made from: its fields, and where a URDF has the wheels of these."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.platforms.body import required
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.toml_model import Strict, validate

M = TypeVar("M", bound=Strict)

AXIS_TOLERANCE = 1e-2  # tolerance of an axis (rad): angles such as 1.57 and 3.1 are rounded
LENGTH_TOLERANCE = 5e-3  # tolerance of centres (m); the equations have them where they should be


class JointPlace(NamedTuple):
    """A joint in axes that are parallel to the platform's, from the root link's origin."""

    joint: str
    centre: Array  # m, shape (3,)
    axis: Array  # unit vector, shape (3,)

    @property
    def at(self) -> complex:
        """Its place seen from above, ahead and to the left (m)."""
        return complex(self.centre[0], self.centre[1])

    @property
    def forward(self) -> complex:
        """Direction in which a positive rate rolls a wheel: the axis times the vertical, of length 1."""
        rolls = complex(self.axis[1], -self.axis[0])
        return rolls / abs(rolls)

    @property
    def sign(self) -> float:
        """+1 where a positive rate about the axis rolls a wheel forward, -1 where backward."""
        return float(np.sign(self.axis[1]))

    @property
    def turn(self) -> float:
        """+1 where a positive angle of a steering joint turns to the left, -1 where to the right."""
        return float(np.sign(self.axis[2]))


@dataclass
class Site:
    """The description that a platform is made from."""

    parameters: dict[str, Any]  # the type's own fields of [platform], not yet checked
    tree: pin.Model
    """The robot with its root link at the world's origin; for reading where the wheels are."""
    origin: str  # name of the description in messages
    folder: Path  # folder that relative paths in the description start from
    track: float = 1.0
    """Factor of the wheels' distances to the left and right of the root link's origin."""
    given: Any = None  # the fields, once they are read

    def read(self, model: type[M]) -> M:
        """The fields of ``[platform]``; SpecError if one is wrong."""
        self.given = read = validate(model, self.parameters, f"{self.origin}: [platform]")
        return read

    def fault(self, field: str, text: str) -> SpecError:
        """The error of a field of ``[platform]``."""
        return SpecError(f"{self.origin}: field 'platform.{field}'{text}")

    def names(self, field: str, own: Iterable[str]) -> list[str]:
        """Names of the joints of a field, a name or a list of them; ``own`` are those of a platform with
        a ``body`` by default.
        SpecError if it is missing, and there is no ``[platform.body]``."""
        value = getattr(self.given, field)
        named = [value] if isinstance(value, str) else list(value or ())
        if self.given.body is not None:
            return named or list(own)
        why = "name the URDF's joint, or give [platform.body]"
        return required(self.origin, field, named, why)

    def wheels(self, field: str, *own: str) -> list[JointPlace]:
        """Places of a field's wheels, see :func:`wheel_place`."""
        heading = self.given.heading
        return [wheel_place(self, n, field, heading) for n in self.names(field, own)]

    def pair(self, right: str, left: str, *own: str) -> list[JointPlace]:
        """Places of the wheels that two fields name, the right and the left one."""
        return [*self.wheels(right, own[0]), *self.wheels(left, own[1])]

    def steering(self, field: str, *own: str) -> list[JointPlace]:
        """Places of a field's joints, about vertical axes; SpecError if an axis is not vertical."""
        names, heading = self.names(field, own), self.given.heading
        places = [joint_place(self, name, field, heading) for name in names]
        for place in places:
            if abs(place.axis[2]) < math.cos(AXIS_TOLERANCE):
                raise self.fault(
                    field,
                    f": the axis of joint {place.joint!r} is {place.axis.round(3)} in the platform "
                    "frame; a steering joint's is vertical",
                )
        return places

    def rolling(self, *own: str) -> list[JointPlace]:
        """Places of the joints of field ``wheels``, about horizontal axes at one height; SpecError if
        one has not such an axis."""
        names, heading = self.names("wheels", own), self.given.heading
        places = [joint_place(self, name, "wheels", heading) for name in names]
        for place in places:
            if abs(place.axis[2]) > AXIS_TOLERANCE:
                raise self.fault(
                    "wheels",
                    f": the axis of joint {place.joint!r} is {place.axis.round(3)} in the platform "
                    "frame; a wheel's is horizontal",
                )
            low, high = places[0].centre[2], place.centre[2]
            if abs(high - low) > LENGTH_TOLERANCE:
                raise self.fault(
                    "wheels",
                    f": {places[0].joint!r} and {place.joint!r} are at heights {low:.4f} and "
                    f"{high:.4f}; wheels of one radius on one ground are at one height",
                )
        return places


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
    movable = [n for n in list(tree.names)[1:] if n not in BASE_JOINTS]
    if name not in movable:
        has = ", ".join(movable) or "none"
        raise site.fault(field, f": the URDF has no movable joint {name!r}; it has: {has}")
    data = tree.createData()
    pin.computeJointJacobians(tree, data, pin.neutral(tree))
    index = tree.getJointId(name)
    columns = pin.getJointJacobian(tree, data, index, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    turn = pin.utils.rotate("z", -heading)
    axis = turn @ columns[3:, tree.joints[index].idx_v]
    centre = turn @ data.oMi[index].translation * np.array([1.0, site.track, 1.0])
    return JointPlace(name, centre, axis)


def wheel_place(site: Site, name: str, field: str, heading: float) -> JointPlace:
    """Locate a wheel whose axis is along the platform's y; SpecError if it is no movable joint, or its
    axis is another."""
    place = joint_place(site, name, field, heading)
    if abs(place.axis[1]) < math.cos(AXIS_TOLERANCE):
        raise site.fault(
            field,
            f": the axis of joint {name!r} is {place.axis.round(3)} in the platform frame; a wheel "
            "turns about the platform's y axis (to the left; see field 'platform.heading' for a root "
            "link whose x axis is not forward)",
        )
    return place


def joints_of(places: Iterable[JointPlace]) -> list[str]:
    """Names of joints by their places."""
    return [place.joint for place in places]


def carriers(site: Site, place: JointPlace) -> list[str]:
    """The joints that carry a joint, itself included."""
    tree = site.tree
    return [tree.names[i] for i in tree.supports[tree.getJointId(place.joint)] if i]


def sides(
    site: Site, right: Sequence[JointPlace], left: Sequence[JointPlace]
) -> tuple[Array, float]:
    """The centre of all wheels (m), shape (3,), and half the distance of the two sides (m); SpecError if
    the wheels are not on two parallel lines, at one height, the right ones on the right, or if one axle
    has its right wheel ahead of the left one."""
    places = [*right, *left]
    sideways = [float(np.mean([p.centre[1] for p in side])) for side in (right, left)]
    centre = np.mean([np.mean([p.centre for p in side], axis=0) for side in (right, left)], axis=0)
    half_track = 0.5 * (sideways[1] - sideways[0])
    lines = np.repeat([-half_track, half_track], [len(right), len(left)])
    apart = np.array([p.centre for p in places]) - centre
    in_place = np.all(np.abs(apart[:, 1] - lines) <= LENGTH_TOLERANCE)
    level = np.all(np.abs(apart[:, 2]) <= LENGTH_TOLERANCE)
    one, other = (np.sort([p.centre[0] for p in side]) for side in (right, left))
    paired = len(one) == len(other) and np.all(np.abs(one - other) <= LENGTH_TOLERANCE)
    if not (half_track > 0 and level and in_place and paired):
        listing = ", ".join(f"{p.joint!r} at {p.centre.round(4)}" for p in places)
        raise SpecError(
            f"{site.origin}: [platform]: the wheels {listing} are not a right and a left one on one "
            "axle along y (or several such pairs): x and z must agree, and the left one's y be the "
            "larger"
        )
    return centre, half_track
