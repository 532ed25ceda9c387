"""Where the parts of a URDF are: their ``<origin>``."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.robots.urdf.quantities import vector


def placement(part: ET.Element) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (m), shape (3,), of what has an ``<origin>``; else the identity.

    Args:
        part: A joint, an ``<inertial>``, a ``<visual>`` or a ``<collision>`` of a checked URDF.
    """
    origin = part.find("origin")
    return np.array(pin.rpy.rpyToMatrix(vector(origin, "rpy"))), vector(origin, "xyz")
