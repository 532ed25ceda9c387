"""``pseudo-inverse``: resolved acceleration on the Jacobian's pseudo-inverse."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.computed_torque import (
    NO_ACCELERATION,
    RedundancyGains,
    ResolvedAcceleration,
    tracking_acceleration,
)
from mobman.controllers.protocol import controllers
from mobman.controllers.task_space import TaskSpace, TipTaskSpace
from mobman.kernels import cholesky
from mobman.kernels.dense import apply, apply_transpose, gram
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call
from mobman.model.criterion import criterion_steps
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_factor, _solve, _well_posed = cholesky.factor, cholesky.solve, cholesky.well_posed


class PseudoInverse(ResolvedAcceleration):
    r"""Resolved acceleration with null-space descent of the criterion, and computed torque:

    .. math:: \dot z = j_e^+ (\ddot p_d - K_v \dot e - K_p e - \dot j_e z)
        + (I - j_e^+ j_e)(-k_0 C^T \partial F/\partial q - k_d z),
        \quad B v = M \dot z + Pz + G.

    The usual baseline of the paper's second group (its references 12-18): it needs the dynamic
    model, and the (pseudo-)inverse of the Jacobian at every tick.
    """

    name = "pseudo-inverse"
    Gains = RedundancyGains
    damping = 0.0
    """mu in j_e^T (j_e j_e^T + mu^2 I)^-1, which resolves the task's acceleration."""

    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """e = e^e: the tip's errors alone."""
        return TipTaskSpace(robot, task)

    def acceleration_steps(
        self, robot: MobileManipulator, space: TaskSpace, z_dot: Array
    ) -> list[Call]:
        """See :class:`ResolvedAcceleration`."""
        gains, now, errors = self.gains, space.workspace, space.errors
        nq, nz, m = robot.nq, robot.nz, space.p
        g, H, H_rate = np.zeros(nq), np.zeros((nq, nq)), np.zeros((nq, nq))
        wanted, descent = np.zeros(m), np.zeros(nz)
        work = (np.zeros((m, m)), np.zeros((m, m)), np.zeros(m), np.zeros(nz))
        return [
            *criterion_steps(self.criterion, now.q, now.q_dot, g, H, H_rate),
            call(
                tracking_acceleration,
                *(errors.p_ddot, errors.e, errors.e_dot, errors.J_dot_z),
                *(float(gains.K_p), float(gains.K_v), wanted),
            ),
            call(_descent, now.C, g, now.z, float(gains.k_0), float(gains.k_d), descent),
            call(_resolve, errors.J, wanted, descent, float(self.damping), z_dot, *work),
        ]


@kernel
def _descent(C: Matrix, g: Vector, z: Vector, k_0: float, k_d: float, descent: Vector) -> None:
    """-k_0 C^T dF/dq - k_d z."""
    apply_transpose(C, g, descent)
    for i in range(z.shape[0]):
        descent[i] = -k_0 * descent[i] - k_d * z[i]


@kernel
def _resolve(
    J: Matrix,
    wanted: Vector,
    descent: Vector,
    mu: float,
    z_dot: Vector,
    exact: Matrix,
    damped: Matrix,
    row: Vector,
    column: Vector,
) -> int:
    """z' = j_e^T (j_e j_e^T + mu^2 I)^-1 wanted + (I - j_e^+ j_e) descent, with
    j_e^+ = j_e^T (j_e j_e^T)^-1. The last four are work space: shapes (m, m), (m, m), (m,), (nz,)."""
    gram(J, exact)
    for i in range(exact.shape[0]):
        for j in range(exact.shape[1]):
            damped[i, j] = exact[i, j]
        damped[i, i] += mu**2
    if _factor(damped, damped) != 0 or _factor(exact, exact) != 0 or not _well_posed(exact):
        return NO_ACCELERATION
    _solve(damped, wanted, row)
    apply_transpose(J, row, z_dot)
    apply(J, descent, row)
    _solve(exact, row, row)
    apply_transpose(J, row, column)
    for i in range(z_dot.shape[0]):
        z_dot[i] += descent[i] - column[i]
    return 0


controllers.register(PseudoInverse.name, PseudoInverse)
