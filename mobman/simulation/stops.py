"""Stops at the joints' limits: stiff, and dissipative."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.linalg import apply_transpose, solve
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.pieces import Piece, Setting, types_of

_SAMPLES = 64
_FINE = 0.5  # of a stop's own time constant: an integration step in contact
_FASTEST = 3000.0  # rad/s: a stop that swings faster would take steps of a few microseconds

stops = types_of("stop type")
"""Types of stops; each starts as a :class:`Contact`, or None."""


class Contact(NamedTuple):
    """Stops of one run, on the coordinates q: their places (rad, m), -inf and inf where there is none,
    stiffness (N m/rad, N/m) and damping (N m s/rad, N s/m), shapes (nq,), and the longest integration
    step while a coordinate is beyond (s)."""

    lower: Array
    upper: Array
    stiffness: Array
    damping: Array
    step: float

    def entry(self, now: Buffers, torque: Array) -> Callable[[], int]:
        """A function that adds the stops' forces to the torques of the motors' axes, shape (nz,), once
        B and q' of a state are in the robot's buffers."""
        nz = torque.size
        work = np.zeros(self.lower.size), np.zeros(nz), np.zeros(nz), np.zeros((nz, nz))
        return bind(_press, self, now.q, now.q_dot, now.C, now.B, torque, *work)

    def near(self, q: Array, q_dot: Array, h: float) -> bool:
        """True if a coordinate is beyond its limit, or will be within h (s)."""
        ahead = q + h * q_dot
        return bool(
            (np.minimum(q, ahead) < self.lower).any() or (np.maximum(q, ahead) > self.upper).any()
        )


@stops.register("joint-limits")
class JointLimits(Piece):
    r"""A spring and a damper at each position limit of the URDF, which only push:
    :math:`\max(0, k\,d + c\,\dot d)` at a depth d > 0, so that no stop gives more energy than it took.

    They are as stiff as ``frequency`` with the least inertia that the joint has anywhere within its
    limits, and stiff enough to hold the joint's own motor within ``depth``, up to 3000 rad/s.
    """

    frequency: float = Field(300.0, gt=0)
    """Least natural frequency on the stop (rad/s)."""
    depth: float = Field(2e-3, gt=0)
    """Depth to which the motor's largest torque presses the joint in at rest (rad, m); where the URDF
    states one."""
    damping: float = Field(1.0, ge=0)
    """Damping ratio: 1 is critical."""

    def start(self, setting: Setting) -> Contact | None:
        robot, limits = setting.robot, setting.robot.limits
        lower, upper, inertia = limits.lower, limits.upper, least_inertia(robot)
        stopped = (np.isfinite(lower) | np.isfinite(upper)) & np.isfinite(inertia)
        if not stopped.any():
            return None
        inertia[~stopped] = 1.0
        torque = np.zeros(robot.nq)  # of what moves by a motor of its own
        torque[robot.arm_index] = limits.torque[robot.n_alpha :]
        stiffness = self.frequency**2 * inertia
        held = np.isfinite(torque)
        stiffness[held] = np.maximum(stiffness[held], torque[held] / self.depth)
        stiffness = np.where(stopped, np.minimum(stiffness, _FASTEST**2 * inertia), 0.0)
        damping = 2.0 * self.damping * np.sqrt(stiffness * inertia)
        # of critical damping both roots are the frequency; of more, the faster is about twice as much
        rate = max(1.0, 2.0 * self.damping) * np.sqrt(stiffness / inertia).max()
        return Contact(lower, upper, stiffness, damping, _FINE / float(rate))


def least_inertia(robot: MobileManipulator) -> Array:
    """Least inertia that each coordinate has when it alone is pushed (kg m^2, kg), shape (nq,).

    1/(C M^-1 C^T)_ii over configurations within the limits; inf for a coordinate that does not move.
    """
    random, limits = np.random.default_rng(0), robot.limits
    low = np.maximum(limits.lower, robot.q_rest - np.pi)
    high = np.minimum(limits.upper, robot.q_rest + np.pi)
    mobility = np.zeros(robot.nq)
    for sample in range(_SAMPLES + 1):
        q = random.uniform(low, high) if sample else robot.q_rest
        C, M = robot.velocity_map(q), robot.dynamics(q, np.zeros(robot.nz)).M
        np.maximum(mobility, np.einsum("ij,ji->i", C, np.linalg.solve(M, C.T)), out=mobility)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / mobility)


@kernel
def _press(
    at: Contact,
    q: Vector,
    q_dot: Vector,
    C: Matrix,
    B: Matrix,
    torque: Vector,
    force: Vector,
    reduced: Vector,
    added: Vector,
    work: Matrix,
) -> int:
    """torque += B^-1 C^T f with f of the stops; the last four are work space."""
    lower, upper, k, c, touching = at.lower, at.upper, at.stiffness, at.damping, False
    for i in range(q.shape[0]):
        force[i] = 0.0
        if q[i] > upper[i]:
            force[i] = -max(0.0, k[i] * (q[i] - upper[i]) + c[i] * q_dot[i])
        elif q[i] < lower[i]:
            force[i] = max(0.0, k[i] * (lower[i] - q[i]) - c[i] * q_dot[i])
        touching = touching or force[i] != 0.0
    if not touching:
        return 0
    apply_transpose(C, force, reduced)
    status = solve(B, reduced, added, work)
    for i in range(torque.shape[0]):
        torque[i] += added[i]
    return status
