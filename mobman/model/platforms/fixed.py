"""No platform: an arm that stands on the ground."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

from mobman.arrays import Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.model.platforms.body import BASE_LINK, DECK, Body, body_urdf
from mobman.model.platforms.platform import Equations, Platform, Site, platforms
from mobman.toml_model import Strict, validate


class FixedParameters(Strict):
    """The fields of ``[platform]`` for ``type = "fixed"``."""

    body: Body | None = None
    """A pedestal."""


@platforms.register("fixed")
class Fixed(Platform):
    r"""A base that does not move, :math:`l = k = 0`: z is the arm's :math:`\dot y`, B the identity.

    The root link is at the world's origin.
    """

    coordinates = ()
    velocity_names = ()
    base_joints = ()

    def __init__(self) -> None:
        self.root_offset = np.zeros(3)
        self.equations = Equations(np.zeros(0), _none, _none_along, _no_A, _none_along, _none)

    @classmethod
    def build(cls, site: Site) -> Fixed:
        site.read(FixedParameters)
        return cls()

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a pedestal, or nothing but the two links."""
        given = validate(FixedParameters, parameters, f"{origin}: [platform]")
        if given.body is not None:
            return body_urdf(given.body)
        return ET.fromstring(
            f'<robot name="platform"><link name="{BASE_LINK}"/><link name="{DECK}"/>'
            f'<joint name="deck_joint" type="fixed"><parent link="{BASE_LINK}"/>'
            f'<child link="{DECK}"/></joint></robot>'
        )


# There are no coordinates: no entries to write.


@kernel
def _none(parameters: Vector, x: Vector, matrix: Matrix) -> None: ...


@kernel
def _none_along(parameters: Vector, x: Vector, x_dot: Vector, rate: Matrix) -> None: ...


@kernel
def _no_A(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None: ...
