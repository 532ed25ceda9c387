"""Platforms without wheels: a unicycle, a platform that moves in every direction, and none."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from mobman.arrays import Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.model.platforms.body import BASE_LINK, DECK, Body
from mobman.model.platforms.body_frame import BodyFramePlatform, offset_of
from mobman.model.platforms.platform import Equations, Fields, Platform, platforms
from mobman.model.platforms.wheels import Site
from mobman.robots.urdf.compose import add_joint
from mobman.toml_model import Strict


class _PlainFields(Fields):
    height: float = 0.0  # height of the root link's origin above the ground (m)
    body: Body | None = None  # the platform by its numbers instead of by a URDF


class UnicycleParameters(_PlainFields):
    """The fields of ``[platform]`` for ``type = "unicycle"``."""

    axle: tuple[float, float] = (0.0, 0.0)
    """The point that does not slip sideways, in the root link's frame (m)."""
    reference_offset: float = 0.0
    """a (m): the reference point (x1, x2) lies so far ahead of that point."""


@platforms.register("unicycle")
class Unicycle(BodyFramePlatform):
    r"""A platform that moves along its heading and turns, :math:`l = 3`, :math:`k = 1`.

    Coordinates :math:`x = (x_1, x_2, \theta)`, :math:`\alpha = (v, \omega)` (m/s, rad/s); the commands
    are the force along the heading (N) and the torque about the vertical (N m) through the point that
    does not slip sideways, so that B is the identity. What the differential platform is if its wheels
    are left out: they have no inertia of their own and no place in the criterion.
    """

    fields = UnicycleParameters

    def __init__(self, site: Site, given: UnicycleParameters) -> None:
        self.offset = a = given.reference_offset
        A_b = np.array([[0.0, -1.0, a]])
        N_b = np.array([[1.0, 0.0], [0.0, a], [0.0, 1.0]])
        # a force through the axle turns nothing about the reference point ahead of it
        B_b = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
        place = offset_of(*given.axle, given.height, given.heading) - np.array([a, 0.0, 0.0])
        names = "v", "omega"
        super().__init__((), names, A_b, N_b, B_b, root_offset=place, heading=given.heading)


class PlanarParameters(_PlainFields):
    """The fields of ``[platform]`` for ``type = "planar"``."""

    centre: tuple[float, float] = (0.0, 0.0)
    """The reference point (x1, x2), on which the commands act, in the root link's frame (m)."""


@platforms.register("planar")
class Planar(BodyFramePlatform):
    r"""A platform without constraints, :math:`l = 3`, :math:`k = 0`.

    Coordinates :math:`x = (x_1, x_2, \theta)`, :math:`\alpha = (v_x, v_y, \omega)` in the platform's
    axes (m/s, rad/s); the commands are the force (N) and the torque about the vertical (N m) at the
    reference point, so that B is the identity. What the omnidirectional platform is if its wheels are
    left out: for bases on mecanum, omni or steered wheels whose URDF has no joints for them.
    """

    fields = PlanarParameters

    def __init__(self, site: Site, given: PlanarParameters) -> None:
        place = offset_of(*given.centre, given.height, given.heading)
        super().__init__(
            (),
            ("v_x", "v_y", "omega"),
            *(np.zeros((0, 3)), np.eye(3), np.eye(3)),
            root_offset=place,
            heading=given.heading,
        )


class FixedParameters(Strict):
    """The fields of ``[platform]`` for ``type = "fixed"``."""

    body: Body | None = None  # a pedestal


@platforms.register("fixed")
class Fixed(Platform):
    r"""A base that does not move, :math:`l = k = 0`: z is the arm's :math:`\dot y`, B the identity.

    The root link is at the world's origin.
    """

    fields = FixedParameters
    base_joints = ()

    def __init__(self, site: Site, given: FixedParameters) -> None:
        super().__init__((), (), Equations(np.zeros(0), _none, _along, _no_A, _along, _none))

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a pedestal, or nothing but the two links."""
        if parameters:
            return super().describe(parameters, origin)
        robot = ET.Element("robot", name="platform")
        for link in (BASE_LINK, DECK):
            ET.SubElement(robot, "link", name=link)
        add_joint(robot, "deck_joint", "fixed", BASE_LINK, DECK)
        return robot


# There are no coordinates: no entries to write.


@kernel
def _none(parameters: Vector, x: Vector, matrix: Matrix) -> None: ...


@kernel
def _along(parameters: Vector, x: Vector, x_dot: Vector, rate: Matrix) -> None: ...


@kernel
def _no_A(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None: ...
