"""Traction: the accelerations that the ground gives a robot at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import null_space
from scipy.spatial import ConvexHull

from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.contact import ContactPlant, MuJoCo
from mobman.simulation.pieces import Setting

_DIRECTIONS = 24  # of half a turn, in which traction is looked at


class Traction(NamedTuple):
    """Largest accelerations that the ground gives a platform at rest, in its worst direction (m/s^2)."""

    grip: float
    """By friction of the driven wheels under their static load."""
    tipping: float
    """Beyond which what it stands on behind it carries nothing."""

    def a_max(self, share: float = 0.5) -> float:
        """The gain ``a_max`` of a sliding law that claims a share of it (m/s^2).

        Half by default: a cap is on a norm, which may be exceeded by m^(2/9), and the arm's motion and
        turning take their part.
        """
        return share * min(self.grip, self.tipping)


def traction(robot: MobileManipulator, ground: MuJoCo | None = None) -> Traction:
    """Traction of a robot at ``q_rest``, in any direction in which its platform can drive straight on,
    on friction and tyres that are those of :class:`MuJoCo` by default.

    Raises:
        SpecError: If the robot has no driven wheels, or falls over.
        UsageError: If MuJoCo is not installed.
    """
    given = MuJoCo() if ground is None else ground
    plant = given.start(Setting(robot, given.step, np.random.default_rng(0)))(robot)
    assert isinstance(plant, ContactPlant)
    plant.own_state(robot.q_rest, given.step)
    straight = plant.now.N[:2] @ null_space(plant.now.N[2:3])
    basis, size, _ = np.linalg.svd(straight)
    angles = np.linspace(0.0, np.pi, _DIRECTIONS, endpoint=False)
    turned = np.array([np.cos(angles), np.sin(angles)])
    ways = (basis @ turned).T if np.sum(size > 1e-6 * size[0]) > 1 else basis[:, :1].T
    force = plant.grip(ways)
    feet, centre = plant.stance()
    edges = ConvexHull(feet[:, :2]).equations
    leaning = np.abs(ways @ edges[:, :2].T).max(axis=0)
    room = -(edges[:, :2] @ centre[:2] + edges[:, 2])
    g = float(np.linalg.norm(robot.model.gravity.linear))
    with np.errstate(divide="ignore"):
        tipping = g * room / (centre[2] * leaning)
    mass = pin.computeTotalMass(robot.model)
    return Traction(float(force.min()) / mass, float(tipping.min()))
