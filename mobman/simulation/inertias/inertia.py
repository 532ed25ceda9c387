"""What an error of the links' inertias is, and the registry of kinds."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry


class Inertia(Protocol):
    """A kind of difference between the true robot's inertias and the nominal ones."""

    def change(
        self, model: pin.Model, robot: MobileManipulator, random: np.random.Generator
    ) -> None:
        """Change the true robot's inertias.

        Args:
            model: The true robot's, to be changed in place.
            robot: Whose model it was; tells the joints and the tip.
            random: Generator of this piece alone.

        Raises:
            SpecError: If it does not fit the robot.
        """
        ...


inertias: Registry[type[Inertia]] = Registry("type of inertias", "mobman.simulation.inertias.kinds")
"""The kinds of differences; each module registers its own."""
