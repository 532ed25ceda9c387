"""A load at the tip."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from mobman.arrays import Array
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.inertias.inertia import inertias
from mobman.simulation.pieces import Piece, some_given


class Payload(Piece):
    """A rigid body that is fixed to the tip, of which the controller does not know."""

    mass: float | None = Field(None, ge=0)
    """kg."""
    share: float | None = Field(None, ge=0)
    """Mass over that of the links between the platform and the tip: instead of ``mass``, for a
    scenario that means the same to a small arm and to a large one."""
    offset: Annotated[list[float], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    """Centre of mass in the tip's frame (m)."""
    inertia: Annotated[list[float], Field(min_length=3, max_length=6)] | None = None
    """About the centre of mass, in the tip's axes (kg m^2): ixx, iyy, izz, or the six of a URDF, ixx,
    ixy, ixz, iyy, iyz, izz. A point mass by default."""

    @model_validator(mode="after")
    def _physical(self) -> Self:
        some_given({"mass": self.mass, "share": self.share}, most=1)
        if self.inertia is None:
            return self
        if len(self.inertia) not in (3, 6):
            raise ValueError("'inertia' has 3 entries (ixx, iyy, izz) or 6, as in a URDF")
        moments = np.linalg.eigvalsh(self._tensor())
        # no body has a moment above the sum of the others
        if moments[0] < 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
            listing = ", ".join(f"{moment:.3g}" for moment in moments)
            raise ValueError(
                f"'inertia' is that of no body: its principal moments are {listing} kg m^2; none may "
                "be negative or above the sum of the others"
            )
        return self

    def _tensor(self) -> Array:
        if self.inertia is None:
            return np.zeros((3, 3))
        if len(self.inertia) == 3:
            return np.diag(self.inertia)
        xx, xy, xz, yy, yz, zz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def change(
        self, model: pin.Model, robot: MobileManipulator, random: np.random.Generator
    ) -> None:
        """See :class:`Inertia`."""
        mass = self.mass if self.share is None else self.share * carried_mass(robot)
        if mass:
            load = pin.Inertia(mass, np.array(self.offset), self._tensor())
            tip = model.frames[robot.tip_frame]
            model.appendBodyToJoint(tip.parentJoint, load, tip.placement)


def carried_mass(robot: MobileManipulator) -> float:
    """Mass of the links between the platform and the tip (kg)."""
    model, arm = robot.model, set(robot.arm_index)
    chain = model.supports[model.frames[robot.tip_frame].parentJoint]
    return float(sum(model.inertias[i].mass for i in chain if model.joints[i].idx_q in arm))


inertias.register("payload", Payload)
