"""The baselines: resolved acceleration and computed torque, ``pseudo-inverse``,
``damped-least-squares`` and ``extended-jacobian``. What laws are from is cited by author and year;
``docs/controllers.md`` has the references."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Matrix, Vector
from mobman.compiled import kernel, sequence
from mobman.controllers.gains import CriterionGains, NotNegative, Positive, as_settings, gain
from mobman.controllers.protocol import TaskSpaceLaw, controllers
from mobman.controllers.task_errors import (
    Entry,
    Stop,
    TaskSpace,
    Tracking,
    desired,
    error,
    error_rate,
)
from mobman.linalg import (
    apply,
    apply_transpose,
    cholesky,
    cholesky_solve,
    copy,
    gram,
    solve,
    well_posed,
)
from mobman.model.criterion import criterion_entry
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


@dataclass(frozen=True, kw_only=True)
class TrackingGains(CriterionGains):
    """Gains of the resolved acceleration p_d'' - K_v e' - K_p e, and of the criterion."""

    K_p: Positive = gain(25.0, "s^-2", "stiffness of the task error")
    K_v: Positive = gain(10.0, "s^-1", "damping of the task error; 2 sqrt(K_p) is critical")


@dataclass(frozen=True, kw_only=True)
class RedundancyGains(TrackingGains):
    """Gains of a descent of the criterion F in the null space of the task."""

    k_0: NotNegative = gain(20.0, "s^-2", "null-space descent of the criterion, -k_0 C^T dF/dq")
    k_d: NotNegative = gain(4.0, "s^-1", "null-space damping, -k_d z")


Kernels = tuple[Callable[..., Any], ...]


class ResolvedAcceleration(TaskSpaceLaw):
    """A law that chooses an acceleration z' and gives it to the nominal robot.

    A tick calls its ``kernels`` in order, once the task space and the nominal robot are evaluated:
    functions that return None, 0 or a :class:`Stop`, usually one that writes ``wanted``, one that makes
    ``z_dot`` of it, and one that makes ``v`` of that. Their arguments are found by their names among
    those of :meth:`TaskSpaceLaw.begin`, what the law adds to them in :meth:`entries`, ``wanted``, the
    value wanted of J z', shape (p,), ``z_dot``, the acceleration that is chosen, and the torque ``v``,
    shape (nz,) each.
    """

    uses: tuple[str, ...] = ("M", "bias", "J'")
    kernels: Kernels

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again, with the axes of e^a, integrals and estimates as new."""
        self._dt = dt
        self.criterion = self.gains.criterion(robot, task)
        self._settings = as_settings(self.gains) | {"K_F": self.criterion.weights.tolist()}
        self.begin(TaskSpace(robot, task, self.criterion if self.extended else None), dt)
        now = self._space.now
        z_dot, self._v = np.zeros((2, robot.nz))
        self.values |= {"wanted": np.zeros(self._space.p), "z_dot": z_dot, "v": self._v}
        bias = [now.run_effects, now.bias_terms] if "bias" in self.uses else []
        self._law = sequence(now.inertia, *bias, *self.entries(robot, task))

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        """The kernels with their arguments, and what else a law calls in a tick."""
        return [self.entry(function) for function in self.kernels]


@kernel
def tracking_acceleration(at: Tracking, K_p: float, K_v: float, wanted: Vector) -> None:
    """The value wanted of J z': p_d'' - K_v e' - K_p e - J' z."""
    for i in range(wanted.shape[0]):
        p_ddot = desired(at.p_d, 2, i)
        wanted[i] = p_ddot - K_v * error_rate(at, i) - K_p * error(at, i) - at.J_dot_z[i]


@kernel
def computed_torque(
    M: Matrix, bias: Vector, B: Matrix, z_dot: Vector, v: Vector, force: Vector, work: Matrix
) -> int:
    """v that gives the nominal robot the acceleration z': B v = M z' + Pz + G, (17)."""
    apply(M, z_dot, force)
    for i in range(force.shape[0]):
        force[i] += bias[i]
    return Stop.NO_INVERSE if solve(B, force, v, work) != 0 else 0


@kernel
def least_norm_acceleration(
    J: Matrix,
    z: Vector,
    C: Matrix,
    g: Vector,
    k_0: float,
    k_d: float,
    mu: float,
    wanted: Vector,
    z_dot: Vector,
    descent: Vector,
    exact: Matrix,
    damped: Matrix,
) -> int:
    """z' = j_e^T (j_e j_e^T + mu^2 I)^-1 wanted + (I - j_e^+ j_e) descent, with
    j_e^+ = j_e^T (j_e j_e^T)^-1, damped where j_e is singular; wanted is overwritten, the last three are
    work space."""
    gram(J, exact)
    gram(J, damped)
    for i in range(wanted.shape[0]):
        damped[i, i] += mu**2
    if cholesky(damped, damped) != 0:
        return Stop.NO_ACCELERATION
    if cholesky(exact, exact) != 0 or not well_posed(exact):
        if mu == 0.0:
            return Stop.NO_ACCELERATION
        copy(damped, exact)
    cholesky_solve(damped, wanted, wanted)
    apply_transpose(J, wanted, z_dot)
    # descent = -k_0 C^T dF/dq - k_d z, and what the task must not see of it
    apply_transpose(C, g, descent)
    for i in range(z.shape[0]):
        descent[i] = -k_0 * descent[i] - k_d * z[i]
        z_dot[i] += descent[i]
    apply(J, descent, wanted)
    cholesky_solve(exact, wanted, wanted)
    apply_transpose(J, wanted, descent)
    for i in range(z.shape[0]):
        z_dot[i] -= descent[i]
    return 0


@controllers.register("pseudo-inverse")
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

    kernels = (tracking_acceleration, least_norm_acceleration, computed_torque)

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        now, p, nq = self._space.now, self._space.p, robot.nq
        g, H, H_rate = np.zeros(nq), np.zeros((nq, nq)), np.zeros((nq, nq))
        self.values = {"mu": 0.0, **self.values, "g": g, "descent": np.zeros(robot.nz)}
        self.values |= {"exact": np.zeros((p, p)), "damped": np.zeros((p, p))}
        gradient = criterion_entry(self.criterion, now.q, now.q_dot, g, H, H_rate)
        return [gradient, *super().entries(robot, task)]


@dataclass(frozen=True, kw_only=True)
class DampedGains(RedundancyGains):
    """Gains of :class:`PseudoInverse`, and the damping."""

    mu: Positive = gain(0.01, "1", "damping of the inverse, j_e^T (j_e j_e^T + mu^2 I)^-1")


@controllers.register("damped-least-squares")
class DampedLeastSquares(PseudoInverse):
    """Law ``pseudo-inverse`` with j_e^T (j_e j_e^T + mu^2 I)^-1 in the place of j_e^+ for the task
    (Nakamura and Hanafusa; Wampler): bounded at singularities, inexact everywhere else. The
    damping is constant, Nakamura and Hanafusa's grows near singularities. The null-space projector keeps
    the exact j_e^+ but at a singularity, since a damped one leaks the descent into the task."""

    name = "damped-least-squares"
    Gains = DampedGains


@kernel
def inverse_acceleration(J: Matrix, wanted: Vector, z_dot: Vector, work: Matrix) -> int:
    """z' = J^-1 wanted; the last is work space."""
    return Stop.NO_ACCELERATION if solve(J, wanted, z_dot, work) != 0 else 0


@controllers.register("extended-jacobian")
class ExtendedJacobianControl(ResolvedAcceleration):
    r"""Input-output linearisation of the extended task (13), and computed torque:

    .. math:: \dot z = J^{-1}(\ddot p_d - K_v \dot e - K_p e - \dot J z),
        \quad B v = M \dot z + Pz + G.

    The usual baseline of the paper's first group (its references 5-9): it needs the dynamic model,
    and the inverse of the extended Jacobian, which fails at algorithmic singularities.
    """

    name = "extended-jacobian"
    Gains = TrackingGains
    extended = True

    kernels: Kernels = (tracking_acceleration, inverse_acceleration, computed_torque)
