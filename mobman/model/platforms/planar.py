"""The planar platform: it moves in every direction and turns, without wheels."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from mobman.model.platforms.body import Body, body_urdf, required_body
from mobman.model.platforms.body_frame import BodyFramePlatform, offset_of
from mobman.model.platforms.platform import Fields, Site, platforms
from mobman.toml_model import validate


class PlanarParameters(Fields):
    """The fields of ``[platform]`` for ``type = "planar"``."""

    centre: tuple[float, float] = (0.0, 0.0)
    """The reference point (x1, x2), on which the commands act, in the root link's frame (m)."""
    height: float = 0.0
    """Height of the root link's origin above the ground (m)."""
    body: Body | None = None
    """The platform by its numbers instead of by a URDF."""


@platforms.register("planar")
class Planar(BodyFramePlatform):
    r"""A platform without constraints, :math:`l = 3`, :math:`k = 0`.

    Coordinates :math:`x = (x_1, x_2, \theta)`, :math:`\alpha = (v_x, v_y, \omega)` in the platform's
    axes (m/s, rad/s); the commands are the force (N) and the torque about the vertical (N m) at the
    reference point, so that B is the identity. What the omnidirectional platform is if its wheels are
    left out: for bases on mecanum, omni or steered wheels whose URDF has no joints for them.

    Args:
        **place: ``root_offset`` and ``heading``, see :class:`Platform`.
    """

    def __init__(self, **place: Any) -> None:
        super().__init__(
            (), ("v_x", "v_y", "omega"), np.zeros((0, 3)), np.eye(3), np.eye(3), **place
        )

    @classmethod
    def build(cls, site: Site) -> Planar:
        given = site.read(PlanarParameters)
        offset = offset_of(*given.centre, given.height, given.heading)
        return cls(root_offset=offset, heading=given.heading)

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box."""
        given = validate(PlanarParameters, parameters, f"{origin}: [platform]")
        return body_urdf(required_body(origin, given.body))
