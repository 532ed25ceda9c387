"""Full-model computed torque: what the baselines turn an acceleration into a torque with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.controllers.gains import (
    Diagonal,
    gain,
    require_not_negative,
    require_positive,
    require_positive_diagonal,
)
from mobman.model.mobile_manipulator import MobileManipulator, Velocity


@dataclass(frozen=True, kw_only=True)
class TrackingGains:
    """Gains of the resolved acceleration p_d'' - K_v e' - K_p e."""

    K_p: float = gain(25.0, "s^-2", "stiffness of the task error")
    K_v: float = gain(10.0, "s^-1", "damping of the task error; 2 sqrt(K_p) is critical")

    def __post_init__(self) -> None:
        require_positive(self, "K_p", "K_v")


@dataclass(frozen=True, kw_only=True)
class RedundancyGains(TrackingGains):
    """Gains of a descent of the criterion F in the null space of the task."""

    k_0: float = gain(20.0, "s^-2", "null-space descent of the criterion, -k_0 C^T dF/dq")
    k_d: float = gain(4.0, "s^-1", "null-space damping, -k_d z")
    c_F: float = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_not_negative(self, "k_0", "k_d")
        require_positive(self, "c_F")
        if self.K_F is not None:
            require_positive_diagonal(self, "K_F")


def computed_torque(
    robot: MobileManipulator, q: Array, z: Array, z_dot: Array, velocity: Velocity
) -> Array:
    """v that gives the nominal robot the acceleration z' at (q, z): B v = M z' + Pz + G, (17).

    Args:
        robot: The nominal robot.
        q: Configuration, shape (nq,).
        z: Reduced velocity, shape (nz,).
        z_dot: Wanted reduced acceleration, shape (nz,).
        velocity: ``robot.velocity(q, z)``.
    """
    m, bias, b = robot.dynamics(q, z, velocity)
    return np.asarray(np.linalg.solve(b, m @ z_dot + bias), dtype=float)
