"""The plant: the true robot under its disturbances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.model.cholesky import Cholesky
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.disturbances.disturbance import Torque


class Instant(NamedTuple):
    """The reduced dynamics at one (t, q, z), ready for any torque."""

    q_dot: Array
    """C z, shape (nq,)."""
    factor: Cholesky
    """Of M."""
    bias: Array
    """Pz + G, shape (nz,)."""
    B: Array
    """Shape (nz, nz)."""
    disturbance: Array | None
    """Torque added to the motors', shape (nz,)."""

    def force(self, torque: Array) -> Array:
        """B v - D: what the motors and the disturbance do along z, shape (nz,)."""
        if self.disturbance is not None:
            torque = torque + self.disturbance
        return self.B @ torque

    def acceleration(self, torque: Array) -> Array:
        """z' of (20), shape (nz,)."""
        return self.factor.solve(self.force(torque) - self.bias)


class Plant:
    """What the controller acts on: M z' + Pz + G + D = B v (17) with the true inertias.

    Args:
        robot: The true robot.
        disturbance: Torque added to the motors', D = -B d; none by default.
    """

    def __init__(self, robot: MobileManipulator, disturbance: Torque | None = None) -> None:
        self.robot = robot
        self._disturbance = disturbance

    def at(self, t: float, q: Array, z: Array) -> Instant:
        """The dynamics at time t and state (q, z)."""
        velocity = self.robot.velocity(q, z)
        m, bias, b = self.robot.dynamics(q, z, velocity)
        added = None if self._disturbance is None else self._disturbance(t)
        factor = Cholesky(m, "the plant's inertia M")
        return Instant(velocity.q_dot, factor, bias, b, added)


def true_robot(
    robot: MobileManipulator,
    mass_factor: float = 1.0,
    inertia_factor: float | None = None,
    payload: float = 0.0,
) -> MobileManipulator:
    """The robot with other inertias; the same object if nothing changes.

    Args:
        robot: The nominal robot.
        mass_factor: Factor of every link's mass.
        inertia_factor: Factor of every link's inertia about its centre of mass; the mass's by default.
        payload: Point mass at the tip (kg).
    """
    turning = mass_factor if inertia_factor is None else inertia_factor
    if mass_factor == 1.0 and turning == 1.0 and payload == 0.0:
        return robot
    model = robot.model.copy()
    for i in range(1, model.njoints):
        link = model.inertias[i]
        model.inertias[i] = pin.Inertia(link.mass * mass_factor, link.lever, link.inertia * turning)
    if payload > 0.0:
        tip = model.frames[model.getFrameId(robot.tip)]
        mass = pin.Inertia(payload, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(tip.parentJoint, mass, tip.placement)
    return robot.with_model(model)
