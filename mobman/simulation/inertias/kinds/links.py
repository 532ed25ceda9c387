"""Links that are heavier, lighter or otherwise balanced than the controller supposes."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.errors import SpecError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.inertias.inertia import inertias
from mobman.simulation.pieces import Piece


class Links(Piece):
    """Factors of the masses and inertias of some links, fixed or at random, and their balance.

    Links that are fixed to each other move as one body and are treated as one. What results could be
    built: a body's inertia about its centre of mass is scaled as a whole, and the centre is moved.
    """

    links: str | Annotated[list[str], Field(min_length=1)] = "*"
    """Names of links or of the joints that move them; ``*``, ``?`` and ``[...]`` as in file names."""
    part: Literal["all", "platform", "arm"] = "all"
    """Only those of the arm or of the platform, whatever their names."""
    mass_factor: float = Field(1.0, gt=0)
    """Of each body's mass and inertia."""
    mass_spread: float = Field(0.0, ge=0, lt=1)
    """The mass factor times a number from [1 - spread, 1 + spread], for each body its own."""
    inertia_factor: float = Field(1.0, gt=0)
    """Of each body's inertia about its centre of mass, besides the mass factor."""
    inertia_spread: float = Field(0.0, ge=0, lt=1)
    """The inertia factor times such a number."""
    centre_offset: Annotated[list[float], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    """Of the centre of mass, in the axes of the joint that moves the body (m)."""
    centre_spread: float = Field(0.0, ge=0)
    """The centre of mass is also moved at random by up to so many of the body's radii of gyration,
    along each axis."""

    def change(
        self, model: pin.Model, robot: MobileManipulator, random: np.random.Generator
    ) -> None:
        """See :class:`Inertia`."""
        chosen = self._chosen(robot)
        for i in range(1, model.njoints):
            # drawn for all bodies, so that a choice of fewer leaves the others' as they are
            mass_draw, inertia_draw, *shift = random.uniform(-1.0, 1.0, 5)
            body = model.inertias[i]
            if i not in chosen or body.mass <= 0.0:
                continue
            mass = self.mass_factor * (1.0 + self.mass_spread * mass_draw)
            turning = mass * self.inertia_factor * (1.0 + self.inertia_spread * inertia_draw)
            gyration = np.sqrt(max(np.trace(body.inertia), 0.0) / (2.0 * body.mass))
            moved = np.array(self.centre_offset) + self.centre_spread * gyration * np.array(shift)
            model.inertias[i] = pin.Inertia(
                body.mass * mass, body.lever + moved, body.inertia * turning
            )

    def _chosen(self, robot: MobileManipulator) -> set[int]:
        """The joints that move the chosen bodies.

        Raises:
            SpecError: If a name fits none.
        """
        model = robot.model
        names = {i: {model.names[i]} for i in range(1, model.njoints) if model.inertias[i].mass > 0}
        for frame in model.frames:
            if frame.type == pin.FrameType.BODY and frame.parentJoint in names:
                names[frame.parentJoint].add(frame.name)
        patterns = [self.links] if isinstance(self.links, str) else self.links
        chosen: set[int] = set()
        for pattern in patterns:
            fits = {i for i in names if any(fnmatchcase(name, pattern) for name in names[i])}
            if not fits:
                listing = ", ".join(sorted({name for some in names.values() for name in some}))
                raise SpecError(
                    f"field 'links': {pattern!r} fits no link that has a mass and no joint of robot "
                    f"{robot.name!r}, which has {listing}"
                )
            chosen |= fits
        arm = {int(i) for i in robot.arm_index}
        moves_arm = {i for i in chosen if model.joints[i].idx_q in arm}
        return {"all": chosen, "arm": moves_arm, "platform": chosen - moves_arm}[self.part]


inertias.register("links", Links)
