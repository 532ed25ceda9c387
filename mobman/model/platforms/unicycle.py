"""The unicycle: a heading, a speed and a turning rate, without wheels."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from mobman.model.platforms.body import Body, body_urdf, required_body
from mobman.model.platforms.body_frame import BodyFramePlatform, offset_of
from mobman.model.platforms.platform import Fields, Site, platforms
from mobman.toml_model import validate


class UnicycleParameters(Fields):
    """The fields of ``[platform]`` for ``type = "unicycle"``."""

    axle: tuple[float, float] = (0.0, 0.0)
    """The point that does not slip sideways, in the root link's frame (m)."""
    height: float = 0.0
    """Height of the root link's origin above the ground (m)."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of that point."""
    body: Body | None = None
    """The platform by its numbers instead of by a URDF."""


@platforms.register("unicycle")
class Unicycle(BodyFramePlatform):
    r"""A platform that moves along its heading and turns, :math:`l = 3`, :math:`k = 1`.

    Coordinates :math:`x = (x_1, x_2, \theta)`, :math:`\alpha = (v, \omega)` (m/s, rad/s); the commands
    are the force along the heading (N) and the torque about the vertical (N m) through the point that
    does not slip sideways, so that B is the identity. What the differential platform is if its wheels
    are left out: they have no inertia of their own and no place in the criterion.

    Args:
        offset: a (m).
        **place: ``root_offset`` and ``heading``, see :class:`Platform`.
    """

    def __init__(self, offset: float = 0.0, **place: Any) -> None:
        self.offset = offset
        A_b = np.array([[0.0, -1.0, offset]])
        N_b = np.array([[1.0, 0.0], [0.0, offset], [0.0, 1.0]])
        # a force through the axle turns nothing about the reference point ahead of it
        B_b = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
        super().__init__((), ("v", "omega"), A_b, N_b, B_b, **place)

    @classmethod
    def build(cls, site: Site) -> Unicycle:
        given = site.read(UnicycleParameters)
        offset = offset_of(*given.axle, given.height, given.heading)
        offset[0] -= given.reference_offset
        return cls(given.reference_offset, root_offset=offset, heading=given.heading)

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box."""
        given = validate(UnicycleParameters, parameters, f"{origin}: [platform]")
        return body_urdf(required_body(origin, given.body))
