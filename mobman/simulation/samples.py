"""What the closed loop keeps of every tick."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array, Index, Matrix, Vector
from mobman.kernels.kernel import kernel
from mobman.model.mobile_manipulator import MobileManipulator

Flags = NDArray[np.bool_]


class Samples:
    """What the loop leaves, one row a tick.

    Args:
        rows: Number of ticks.
        robot: The plant's robot.
        m: Dimension of the task space.

    Attributes:
        q: Configuration (m, rad), shape (rows, nq).
        z: Reduced velocity, shape (rows, nz).
        torque: Commanded v, shape (rows, nz).
        tip: Task coordinates of the tip, f_e (m), shape (rows, m).
        desired: p_d (m), shape (rows, m).
        auxiliary: e^a, shape (rows, nz - m); NaN where it is not known.
        compute_time: What the controller took (s), shape (rows,).
        applied: Torque that acts, shape (rows, nz); None where it is the commanded one.
        limited: Whether a limit changed the commanded torque, shape (rows,); None with ``applied``.
        signals: What the controller reports of itself, by name; ``rows`` rows each.
        count: How many rows are filled.
        work: Integral of z^T (B v - D) over the run (J).
        status: As in :class:`mobman.simulation.record.Record`.
        message: The same.
    """

    def __init__(self, rows: int, robot: MobileManipulator, m: int) -> None:
        self.q = np.empty((rows, robot.nq))
        self.z = np.empty((rows, robot.nz))
        self.torque = np.empty((rows, robot.nz))
        self.tip = np.empty((rows, m))
        self.desired = np.empty((rows, m))
        self.auxiliary = np.full((rows, robot.nz - m), np.nan)
        self.compute_time = np.empty(rows)
        self.applied: Array | None = None
        self.limited: Flags | None = None
        self.signals: dict[str, Array] = {}
        self.count = 0
        self.work = 0.0
        self.status = "ok"
        self.message = ""

    def keep_applied(self) -> None:
        """Make room for torques that act, where these are not those that are commanded."""
        self.applied = np.zeros_like(self.torque)
        self.limited = np.zeros(len(self.torque), dtype=bool)

    def diverged(self, t: float, reason: str) -> None:
        """Say that the run ends at t (s) since it diverged."""
        self.status, self.message = "diverged", f"at t = {t:.6g} s: {reason}"


@kernel
def keep(
    tick: Index,
    q: Vector,
    z: Vector,
    tip: Vector,
    p_d: Matrix,
    q_rows: Matrix,
    z_rows: Matrix,
    tip_rows: Matrix,
    desired_rows: Matrix,
) -> None:
    """Write the tick's row of what is kept."""
    row = tick[0]
    for i in range(q.shape[0]):
        q_rows[row, i] = q[i]
    for i in range(z.shape[0]):
        z_rows[row, i] = z[i]
    for i in range(p_d.shape[1]):
        tip_rows[row, i] = tip[i]
        desired_rows[row, i] = p_d[0, i]


@kernel
def keep_finite(tick: Index, vector: Vector, rows: Matrix) -> int:
    """Write the tick's row of a vector; 1 if an entry is not finite."""
    for i in range(vector.shape[0]):
        if not math.isfinite(vector[i]):
            return 1
        rows[tick[0], i] = vector[i]
    return 0


@kernel
def keep_from(tick: Index, vector: Vector, first: int, rows: Matrix) -> None:
    """Write the tick's row of a vector's entries from ``first`` on."""
    for i in range(rows.shape[1]):
        rows[tick[0], i] = vector[first + i]
