"""Skid-steered platforms: several fixed wheels on each side, which slip sideways when it turns."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from pydantic import Field

from mobman.model.platforms.body import WheeledBody, WheelPart, body_urdf, required, required_body
from mobman.model.platforms.differential import TwoSided
from mobman.model.platforms.platform import Site, WheeledFields, platforms
from mobman.model.platforms.wheels import Named, sides
from mobman.toml_model import validate


class SkidSteerBody(WheeledBody):
    """The fields of ``[platform.body]`` for skid-steering: four wheels."""

    wheelbase: float = Field(gt=0)
    """Distance of the front and the rear axle (m)."""


class SkidSteerParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "skid-steer"``."""

    right_wheels: list[str] = []
    """URDF joints of the wheels on the right, the one that stands for all of them first."""
    left_wheels: list[str] = []
    """The same on the left."""
    half_track: float | None = Field(None, gt=0)
    """Half the distance of the sides (m); by default that in the URDF."""
    track_factor: float = Field(1.0, ge=1)
    """The effective track is so many times the geometric one: it turns as slowly as a differential
    platform of that track. Identified on the ground that is driven on; 1 is no slip of the side."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of the middle of the wheels."""
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

    skids = True

    @classmethod
    def build(cls, site: Site) -> SkidSteer:
        given = site.read(SkidSteerParameters)
        named = Named(site, given)
        right, left = (named.wheels(f"{side}_wheels", *_names(side)) for side in ("right", "left"))
        centre, half_track = sides(site, right, left)
        if given.half_track is not None:
            half_track = given.half_track
        R, a = given.wheel_radius, given.reference_offset
        return cls(
            right=[place.joint for place in right],
            left=[place.joint for place in left],
            radius=R,
            half_track=half_track * given.track_factor,
            offset=a,
            signs=[place.sign for place in (*right, *left)],
            root_offset=np.array([-a, 0.0, R]) - centre,
            heading=given.heading,
        )

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box with two wheels on either side."""
        given = validate(SkidSteerParameters, parameters, f"{origin}: [platform]")
        body = required_body(origin, given.body)
        R, W = given.wheel_radius, required(origin, "half_track", given.half_track)
        ahead = 0.5 * body.wheelbase
        wheels = [
            WheelPart(name, (x, y, R), R)
            for side, y in (("right", -W), ("left", W))
            for name, x in zip(_names(side), (ahead, -ahead), strict=True)
        ]
        return body_urdf(body, wheels)


def _names(side: str) -> list[str]:
    """Names of the wheels' joints of a platform described by its numbers."""
    return [f"wheel_front_{side}", f"wheel_rear_{side}"]
