"""Skid-steered platforms: several fixed wheels on each side, which slip sideways when it turns."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.model.platforms.body import (
    WheeledBody,
    WheelPart,
    body_urdf,
    joint_names,
    required,
    required_body,
)
from mobman.model.platforms.body_frame import BodyFramePlatform
from mobman.model.platforms.platform import Gear, Site, Wheel, platforms
from mobman.model.platforms.wheels import sides, wheel_place
from mobman.toml_model import Strict, validate


class SkidSteerBody(WheeledBody):
    """The fields of ``[platform.body]`` for skid-steering: four wheels."""

    wheelbase: float = Field(gt=0)
    """Distance of the front and the rear axle (m)."""


class SkidSteerParameters(Strict):
    """The fields of ``[platform]`` for ``type = "skid-steer"``."""

    right_wheels: list[str] = []
    """URDF joints of the wheels on the right, the one that stands for all of them first."""
    left_wheels: list[str] = []
    """The same on the left."""
    wheel_radius: float = Field(gt=0)
    """R (m)."""
    half_track: float | None = Field(None, gt=0)
    """Half the distance of the sides (m); by default that in the URDF."""
    track_factor: float = Field(1.0, ge=1)
    """The effective track is so many times the geometric one: it turns as slowly as a differential
    platform of that track. Identified on the ground that is driven on; 1 is no slip of the side."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of the middle of the wheels."""
    heading: float = 0.0
    """Direction of forward in the root link's frame, about z from its x axis (rad)."""
    body: SkidSteerBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` is required then."""


class SkidSteer(BodyFramePlatform):
    r"""Wheels geared together on each side, as a differential platform with an effective track
    (Mandow et al., IROS 2007): :math:`l = 3 + w` for w wheels, :math:`k = 1 + w`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_{r1}, \phi_{r2}, \dots, \phi_{l1}, \dots)`,
    :math:`\alpha` the rates of the right and the left side. The middle does not slip sideways; that
    the wheels do is no constraint. One motor a side; B is the identity.

    Args:
        right: Joint names of the wheels on the right.
        left: The same on the left.
        radius: R (m).
        half_track: Effective W (m).
        offset: a (m).
        signs: +1 where a wheel's positive rate drives forward, -1 where backward; right, then left.
        root_offset: See :class:`Platform`.
        heading: See :class:`Platform`.
    """

    def __init__(
        self,
        right: Sequence[str],
        left: Sequence[str],
        radius: float,
        half_track: float,
        offset: float = 0.0,
        signs: Sequence[float] | None = None,
        root_offset: Array | None = None,
        heading: float = 0.0,
    ) -> None:
        joints = (*right, *left)
        w = len(joints)
        signs = (1.0,) * w if signs is None else signs
        self.radius, self.half_track, self.offset = radius, half_track, offset
        R, W, a = radius, half_track, offset
        A_b, N_b, B_b = np.zeros((1 + w, 3 + w)), np.zeros((3 + w, 2)), np.zeros((3 + w, 2))
        A_b[0, :3] = 0.0, -1.0, a
        geared = []
        for j, (first, count, side) in enumerate(
            ((0, len(right), 1.0), (len(right), len(left), -1.0))
        ):
            # alpha is the rate of the side's first wheel, which has the motor
            forward = signs[first]
            N_b[:3, j] = 0.5 * R * forward * np.array([1.0, side * a / W, side / W])
            B_b[3 + first, j] = 1.0
            for i in range(first, first + count):
                A_b[1 + i, :3] = 1.0, 0.0, side * W
                A_b[1 + i, 3 + i] = -R * signs[i]
                N_b[3 + i, j] = signs[i] * forward
                if i != first:
                    geared.append(Gear(joints[i], joints[first], signs[i] * forward))
        super().__init__(
            joints,
            ("alpha_1", "alpha_2"),
            A_b,
            N_b,
            B_b,
            root_offset=root_offset,
            heading=heading,
            wheels=tuple(Wheel(joint, R) for joint in joints),
        )
        self.geared, self.skids = tuple(geared), True

    @classmethod
    def build(cls, site: Site) -> SkidSteer:
        """See :meth:`Platform.build`."""
        given = _parameters(site.parameters, site.origin)
        right, left = (
            [
                wheel_place(site, name, field, given.heading)
                for name in joint_names(site.origin, field, named, given.body, own)
            ]
            for field, named, own in (
                ("right_wheels", given.right_wheels, _names("right")),
                ("left_wheels", given.left_wheels, _names("left")),
            )
        )
        centre, half_track = sides(site, right, left)
        if given.half_track is not None:
            half_track = given.half_track
        return cls(
            right=[place.joint for place in right],
            left=[place.joint for place in left],
            radius=given.wheel_radius,
            half_track=half_track * given.track_factor,
            offset=given.reference_offset,
            signs=[place.sign for place in (*right, *left)],
            root_offset=np.array([-given.reference_offset, 0.0, given.wheel_radius]) - centre,
            heading=given.heading,
        )

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box with two wheels on either side."""
        given = _parameters(parameters, origin)
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


def _parameters(parameters: dict[str, Any], origin: str) -> SkidSteerParameters:
    return validate(SkidSteerParameters, parameters, f"{origin}: [platform]")


platforms.register("skid-steer", SkidSteer)
