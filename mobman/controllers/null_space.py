r"""The law ``tsm-null-space``: the simplified law (43)-(44) made stable, in a metric of the base.

(43) drives the tip alone and leaves the rest of z to itself, which drifts away on most platforms. Here
the reference acceleration's part that the tip does not see descends the criterion F, damped:

.. math:: \dot v_{ref} = \Omega j_e^T u_{ref} + (I - \Omega j_e^T (j_e \Omega j_e^T)^{-1} j_e)\,y,
    \quad y = -\kappa (v_{ref} - a_N),
    \quad a_N = -k_v z - \frac{k_0}{\lambda_{max}} \Omega C^T \frac{\partial F}{\partial q},

with :math:`\lambda_{max}` the largest eigenvalue of :math:`\Omega C^T H C` at rest, so that k_0 is the
stiffness of the stiffest motion. Nothing of the extended Jacobian is needed, and its algorithmic
singularities do not exist; F reaches its constrained minimum by descent, not by f_a = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel
from mobman.controllers.gains import NotNegative, Positive, gain
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Stop, Tracking
from mobman.controllers.tsm import (
    Held,
    SlidingGains,
    SlidingStage,
    TerminalSlidingMode,
    kinematic_gain,
    unit_vector,
)
from mobman.errors import GainError
from mobman.linalg import apply, apply_transpose, cholesky, cholesky_solve, copy, dot
from mobman.model.criterion import criterion_entry
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_DAMPING = 1e-8
"""Damping of the projector, over a mean eigenvalue of j_e Omega j_e^T. Where j_e loses rank it
stays finite; elsewhere the tip sees so small a part of y, which the sliding mode takes away."""


@dataclass(frozen=True, kw_only=True)
class NullSpaceGains(SlidingGains):
    """Gains of both stages, and of the descent of the criterion that the tip does not see."""

    kappa: Positive = gain(
        50.0, "s^-1", "rate at which v_ref reaches a_N where the tip does not see it"
    )
    k_v: Positive = gain(4.0, "s^-1", "null-space damping, -k_v z in a_N")
    k_0: NotNegative = gain(
        4.0, "s^-2", "null-space stiffness, that of the stiffest motion, in a_N"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.damping:
            raise GainError(
                f"damping = {self.damping!r}: {NullSpaceSlidingMode.name!r} has no damped stage; "
                "allowed: 0"
            )


@controllers.register("tsm-null-space")
class NullSpaceSlidingMode(TerminalSlidingMode):
    """Kinematic stage (43)-(44) on the tip's Jacobian in a metric of the base, with a damped descent of
    the criterion in the null space; dynamic stage as in ``tsm`` (55)-(56)."""

    name = "tsm-null-space"
    gains: NullSpaceGains
    Gains = NullSpaceGains
    extended = False

    def metric(self, robot: MobileManipulator) -> Array:
        return base_metric(robot)

    def _reference(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        now, p, nq, nz = self._space.now, self._space.p, robot.nq, robot.nz
        g, H, H_rate = np.zeros(nq), np.zeros((nq, nq)), np.zeros((nq, nq))
        gradient = criterion_entry(self.criterion, now.q, now.q_dot, g, H, H_rate)
        self.values |= {"omega": base_metric(robot), "g": g, "y": np.zeros(nz), "seen": np.zeros(p)}
        self.values |= {"J_omega": np.zeros((p, nz)), "lower": np.zeros((p, p))}
        k_0 = self.values["k_0"] * unit_stiffness(robot, self.criterion)
        C = self._space.now.C  # the gain C is the dynamic stage's
        return [gradient, self.entry(null_space_stage, k_0=k_0, C=C)]


@kernel
def null_space_stage(
    gains: Any,
    stage: SlidingStage,
    held: Held,
    at: Tracking,
    q_rest: Vector,
    omega: Vector,
    C: Matrix,
    g: Vector,
    kappa: float,
    k_v: float,
    k_0: float,
    J_omega: Matrix,
    lower: Matrix,
    y: Vector,
    seen: Vector,
) -> int:
    """v_ref' = Omega j_e^T u_ref, with u_ref of (44), plus what the tip does not see of y; ``omega`` is
    the diagonal of Omega, g is dF/dq, the last four are work space."""
    k, J = gains[0], at.J
    p, nz = J.shape
    gain = kinematic_gain(gains, stage, held, at, q_rest)
    trace = 0.0
    for i in range(p):
        for j in range(nz):
            J_omega[i, j] = J[i, j] * omega[j]
        for j in range(i + 1):
            stage.gram[i, j] = stage.gram[j, i] = dot(J_omega[i], J[j])
        trace += stage.gram[i, i]
    copy(stage.gram, lower)
    for i in range(p):
        lower[i, i] += _DAMPING * trace / p
    if cholesky(lower, lower) != 0:
        return Stop.NO_ACCELERATION
    # u_ref = -c/a (W + c_0) n (44)
    if not unit_vector(k, stage, gain):
        return Stop.NOT_DEFINITE
    apply_transpose(J_omega, stage.n, held.v_ref_dot)
    # y = -kappa (v_ref - a_N), at the tick's end: stable for every kappa dt
    rate = kappa / (1.0 + kappa * k.dt)
    apply_transpose(C, g, y)
    for j in range(nz):
        y[j] = -rate * (held.v_ref[j] + k_v * at.z[j] + k_0 * omega[j] * y[j])
    # (I - Omega j_e^T (j_e Omega j_e^T)^-1 j_e) y
    apply(J, y, seen)
    cholesky_solve(lower, seen, seen)
    for j in range(nz):
        held.v_ref_dot[j] = y[j] - gain * held.v_ref_dot[j]
        for i in range(p):
            held.v_ref_dot[j] -= J_omega[i, j] * seen[i]
    return 0
