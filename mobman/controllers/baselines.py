"""The baselines: resolved acceleration and computed torque, ``pseudo-inverse``,
``damped-least-squares`` and ``extended-jacobian``.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.gains import (
    Diagonal,
    as_settings,
    gain,
    require_not_negative,
    require_positive,
    require_positive_diagonal,
)
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import (
    ExtendedTaskSpace,
    TaskSpace,
    TipTaskSpace,
    posture_criterion,
)
from mobman.errors import SingularityError
from mobman.kernels import cholesky, lu
from mobman.kernels.dense import apply, apply_transpose, gram
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call, program
from mobman.model.criterion import criterion_steps
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

NO_INVERSE = 4
"""Status: B has no inverse."""
NO_ACCELERATION = 5
"""Status: no acceleration does what the task asks for."""

_REASONS = {
    NO_INVERSE: "the actuation matrix B has no inverse",
    NO_ACCELERATION: "the task's Jacobian is singular",
}

_solve = lu.solve
_cholesky_factor, _cholesky_solve = cholesky.factor, cholesky.solve
_well_posed = cholesky.well_posed


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


class ResolvedAcceleration:
    """A law that chooses an acceleration z' and gives it to the nominal robot.

    Subclasses say what errors it looks at (:meth:`task_space`) and what acceleration it wants
    (:meth:`acceleration_steps`).
    """

    def __init__(self, gains: Any) -> None:
        self.gains = gains

    @abstractmethod
    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """The errors that the law drives to zero."""

    @abstractmethod
    def acceleration_steps(
        self, robot: MobileManipulator, space: TaskSpace, z_dot: Array
    ) -> list[Call]:
        """The steps that write the wanted acceleration, shape (nz,), once the errors are known."""

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again; the law's only state is the axes of e^a, where it has them."""
        self.criterion = posture_criterion(robot, self.gains.c_F, self.gains.K_F)
        space = self.task_space(robot, task)
        now, nz = space.workspace, robot.nz
        wanted, force, work = np.zeros(nz), np.zeros(nz), np.zeros((nz, nz))
        self._space, self._v = space, np.zeros(nz)
        self._velocity = program(now.velocity_steps())
        self._law = program(
            [
                *space.steps(),
                *now.inertia_steps(),
                *now.bias_steps(),
                *self.acceleration_steps(robot, space, wanted),
                call(computed_torque, now.M, now.bias, now.B, wanted, force, self._v, work),
            ]
        )

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, shape (nz,); see :class:`Controller`."""
        space = self._space
        now = space.workspace
        now.q[:] = q
        now.z[:] = z
        space.t[0] = t
        self._velocity()
        now.run_jacobians()
        now.run_dynamics()
        while status := self._law():
            if reason := _REASONS.get(status):
                raise SingularityError(reason)
            space.resolve(status)
        return self._v.copy()

    def settings(self) -> dict[str, Any]:
        """The gains."""
        return as_settings(self.gains)


@kernel
def tracking_acceleration(
    p_ddot: Vector,
    e: Vector,
    e_dot: Vector,
    J_dot_z: Vector,
    K_p: float,
    K_v: float,
    wanted: Vector,
) -> None:
    """The value wanted of J z': p_d'' - K_v e' - K_p e - J' z."""
    for i in range(wanted.shape[0]):
        wanted[i] = p_ddot[i] - K_v * e_dot[i] - K_p * e[i] - J_dot_z[i]


@kernel
def computed_torque(
    M: Matrix, bias: Vector, B: Matrix, z_dot: Vector, force: Vector, v: Vector, work: Matrix
) -> int:
    """v that gives the nominal robot the acceleration z': B v = M z' + Pz + G, (17)."""
    apply(M, z_dot, force)
    for i in range(force.shape[0]):
        force[i] += bias[i]
    return NO_INVERSE if _solve(B, force, v, work) != 0 else 0


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
            call(_least_norm, errors.J, wanted, descent, float(self.damping), z_dot, *work),
        ]


@kernel
def _descent(C: Matrix, g: Vector, z: Vector, k_0: float, k_d: float, descent: Vector) -> None:
    """-k_0 C^T dF/dq - k_d z."""
    apply_transpose(C, g, descent)
    for i in range(z.shape[0]):
        descent[i] = -k_0 * descent[i] - k_d * z[i]


@kernel
def _least_norm(
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
    if (
        _cholesky_factor(damped, damped) != 0
        or _cholesky_factor(exact, exact) != 0
        or not _well_posed(exact)
    ):
        return NO_ACCELERATION
    _cholesky_solve(damped, wanted, row)
    apply_transpose(J, row, z_dot)
    apply(J, descent, row)
    _cholesky_solve(exact, row, row)
    apply_transpose(J, row, column)
    for i in range(z_dot.shape[0]):
        z_dot[i] += descent[i] - column[i]
    return 0


controllers.register(PseudoInverse.name, PseudoInverse)


@dataclass(frozen=True, kw_only=True)
class DampedGains(RedundancyGains):
    """Gains of :class:`PseudoInverse`, and the damping."""

    mu: float = gain(0.01, "1", "damping of the inverse, j_e^T (j_e j_e^T + mu^2 I)^-1")

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "mu")


class DampedLeastSquares(PseudoInverse):
    """As ``pseudo-inverse``, with j_e^T (j_e j_e^T + mu^2 I)^-1 in the place of j_e^+ for the task
    (Nakamura and Hanafusa; Wampler): bounded at singularities, inexact everywhere else. The
    null-space projector keeps the exact j_e^+, since a damped one leaks the descent into the task."""

    name = "damped-least-squares"
    Gains = DampedGains
    gains: DampedGains

    @property
    def damping(self) -> float:  # type: ignore[override]
        """mu."""
        return float(self.gains.mu)


controllers.register(DampedLeastSquares.name, DampedLeastSquares)


@dataclass(frozen=True, kw_only=True)
class ExtendedGains(TrackingGains):
    """Gains of the resolved acceleration, and the criterion that extends the task."""

    c_F: float = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "c_F")
        if self.K_F is not None:
            require_positive_diagonal(self, "K_F")


class ExtendedJacobianControl(ResolvedAcceleration):
    r"""Input-output linearisation of the extended task (13), and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - \dot J z),
        \quad B v = M \dot z + Pz + G.

    The usual baseline of the paper's first group (its references 5-9): it needs the dynamic model,
    and the inverse of the extended Jacobian, which fails at algorithmic singularities.
    """

    name = "extended-jacobian"
    Gains = ExtendedGains

    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """e = (e^e, e^a) of (13)."""
        return ExtendedTaskSpace(robot, task, self.criterion)

    def acceleration_steps(
        self, robot: MobileManipulator, space: TaskSpace, z_dot: Array
    ) -> list[Call]:
        """See :class:`ResolvedAcceleration`."""
        gains, errors, nz = self.gains, space.errors, robot.nz
        wanted = np.zeros(nz)
        return [
            call(
                tracking_acceleration,
                *(errors.p_ddot, errors.e, errors.e_dot, errors.J_dot_z),
                *(float(gains.K_p), float(gains.K_v), wanted),
            ),
            call(_inverse, errors.J, wanted, z_dot, np.zeros((nz, nz))),
        ]


@kernel
def _inverse(J: Matrix, wanted: Vector, z_dot: Vector, work: Matrix) -> int:
    """z' = J^-1 wanted."""
    return NO_ACCELERATION if _solve(J, wanted, z_dot, work) != 0 else 0


controllers.register(ExtendedJacobianControl.name, ExtendedJacobianControl)
