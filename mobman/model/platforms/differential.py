"""The differential-drive platform, type (2,0): the paper's."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any, Literal

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
from mobman.model.platforms.platform import Site, Wheel, platforms
from mobman.model.platforms.wheels import sides, wheel_place
from mobman.toml_model import Strict, validate

_RIGHT, _LEFT = "wheel_right", "wheel_left"  # of a platform described by its numbers


class DifferentialParameters(Strict):
    """The fields of ``[platform]`` for ``type = "differential"``."""

    right_wheel: str | None = None
    """URDF joint of the driven wheel on the right (phi_1)."""
    left_wheel: str | None = None
    """URDF joint of the driven wheel on the left (phi_2)."""
    wheel_radius: float = Field(gt=0)
    """R (m)."""
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance between the wheels in the URDF."""
    alpha: Literal["wheel-rates", "paper"] = "wheel-rates"
    """Quasi-velocities: the wheels' rates (7), or those of (5) with phi' = (2/R) alpha."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of the axle, as in (6) and (7); 0 is the
    point on the axle of (2) and (5), the arm's mount is the other usual choice."""
    heading: float = 0.0
    """Direction of forward in the root link's frame, about z from its x axis (rad)."""
    body: WheeledBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` is required then."""


class Differential(BodyFramePlatform):
    r"""Two driven wheels on one axle that neither slip nor skid, :math:`l = 5`, :math:`k = 3`.

    Coordinates :math:`x = (x_1, x_2, \theta, \phi_1, \phi_2)`, right wheel first. With the reference
    point ``a`` ahead of the axle, A is (6) and N is (7) times ``kappa``, where
    :math:`\dot\phi = \kappa\alpha`: 1 for wheel rates, 2/R for the alpha of (5). With a = 0 they
    are (2) and, for the paper's alpha, (5).

    Args:
        wheels: Joint names of the right and the left wheel.
        radius: R (m).
        half_track: W (m).
        offset: a (m).
        kappa: phi'/alpha.
        signs: +1 where a wheel's positive rate drives forward, -1 where backward: URDFs differ.
        root_offset: See :class:`Platform`.
        heading: See :class:`Platform`.
    """

    def __init__(
        self,
        wheels: tuple[str, str],
        radius: float,
        half_track: float,
        offset: float = 0.0,
        kappa: float = 1.0,
        signs: tuple[float, float] = (1.0, 1.0),
        root_offset: Array | None = None,
        heading: float = 0.0,
    ) -> None:
        self.radius, self.half_track, self.offset = radius, half_track, offset
        self.kappa, self.signs = kappa, signs
        R, W, a = radius, half_track, offset
        # no lateral slip; no longitudinal slip of the right and of the left wheel
        A_b = np.array(
            [
                [0.0, -1.0, a, 0.0, 0.0],
                [1.0, 0.0, W, -R * signs[0], 0.0],
                [1.0, 0.0, -W, 0.0, -R * signs[1]],
            ]
        )
        N_b, B_b = np.zeros((5, 2)), np.zeros((5, 2))
        for j, side in ((0, 1.0), (1, -1.0)):
            Y = kappa * R / (2.0 * W) * signs[j]
            N_b[:3, j] = Y * W, side * Y * a, side * Y
            N_b[3 + j, j] = kappa
            B_b[3 + j, j] = 1.0
        super().__init__(
            wheels,
            ("alpha_1", "alpha_2"),
            A_b,
            N_b,
            B_b,
            root_offset=root_offset,
            heading=heading,
            wheels=tuple(Wheel(joint, R) for joint in wheels),
        )

    @classmethod
    def build(cls, site: Site) -> Differential:
        """See :meth:`Platform.build`; the wheels say where the axle is, and which way they roll."""
        given = _parameters(site.parameters, site.origin)
        right, left = (
            wheel_place(site, name, field, given.heading)
            for field, named, own in (
                ("right_wheel", given.right_wheel, _RIGHT),
                ("left_wheel", given.left_wheel, _LEFT),
            )
            for name in joint_names(site.origin, field, [named], given.body, [own])
        )
        axle, half_track = sides(site, [right], [left])
        return cls(
            wheels=(right.joint, left.joint),
            radius=given.wheel_radius,
            half_track=half_track if given.half_track is None else given.half_track,
            offset=given.reference_offset,
            kappa=1.0 if given.alpha == "wheel-rates" else 2.0 / given.wheel_radius,
            signs=(right.sign, left.sign),
            root_offset=np.array([-given.reference_offset, 0.0, given.wheel_radius]) - axle,
            heading=given.heading,
        )

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box with a wheel on either side."""
        given = _parameters(parameters, origin)
        body = required_body(origin, given.body)
        R, W = given.wheel_radius, required(origin, "half_track", given.half_track)
        wheels = [WheelPart(name, (0.0, y, R), R) for name, y in ((_RIGHT, -W), (_LEFT, W))]
        return body_urdf(body, wheels)


def _parameters(parameters: dict[str, Any], origin: str) -> DifferentialParameters:
    return validate(DifferentialParameters, parameters, f"{origin}: [platform]")


platforms.register("differential", Differential)
