r"""The extended Jacobian J of (13) and its rate, in closed form for any robot.

With :math:`j = [J_f; A\,0]`, :math:`g = \partial F/\partial q`, multipliers
:math:`\lambda = -(j^+)^T g` and :math:`D(\lambda) = \partial(j^T\lambda)/\partial q` at fixed
:math:`\lambda`, the auxiliary map :math:`f_a = \mathcal N g` (11) has the rate
:math:`\dot f_a = \mathcal N (H + D)\dot q` when the orthonormal rows of :math:`\mathcal N` are
carried along the motion by parallel transport,
:math:`\dot{\mathcal N} = -\mathcal N \dot j^T (j^+)^T`.

Sizes: s = m + k rows of j, nq coordinates, nz velocities, nz - m auxiliary coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from mobman.arrays import Array, Index, Matrix, Tensor, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.errors import SingularityError
from mobman.linalg import (
    apply,
    apply_transpose,
    cholesky,
    cholesky_solve,
    cholesky_solve_columns,
    copy,
    dot,
    gram,
    multiply,
    well_posed,
)
from mobman.model.criterion import Criterion, criterion_entry
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import REASONS
from mobman.model.platforms.platform import ArmJoints
from mobman.model.task_map import (
    TaskMap,
    add_task_hessian,
    add_task_hessian_rate,
    add_turning_hessian,
    add_turning_hessian_rate,
)

SINGULAR = 1
"""Status: j has lost its rank."""
GAUGE_LOST = 2
"""Status: the complement is too far from ker j to be carried there."""

_NO_DIRECTION = 1e-6  # singular value of N Proj_ker j below which a row's direction means nothing
_NEWTON_SCHULZ = 1e-2  # |X X^T - I| below which the polar factor is found by iteration
_ROUNDING = 1e-15  # |X X^T - I| of an orthonormal complement
_QUADRATIC = 1e-8  # below it one iteration more leaves rounding only


class ExtendedKinematics(NamedTuple):
    """f = (f_e, f_a) and its derivatives at one (q, z)."""

    f_e: Array
    """Tip coordinates of the task (m), shape (m,); 0 in the rows of an orientation."""
    f_a: Array
    """Auxiliary coordinates (11), shape (nz - m,); their axes are the rows of ``complement``."""
    J: Array
    """Extended Jacobian of (13), p' = J z, shape (nz, nz); its first m rows are j_e of (43)."""
    J_dot_z: Array
    """J' z, shape (nz,)."""
    complement: Array
    """Orthonormal rows of ker j, the N of (11), shape (nz - m, nq)."""


class Given(NamedTuple):
    """The robot and the criterion at a state, see :class:`mobman.model.dynamics.Buffers`."""

    platform_index: Index
    arm: ArmJoints
    tip: Vector
    tip_jacobian: Matrix
    tip_jacobian_rate: Matrix
    J_f: Matrix
    J_f_rate: Matrix
    axes: Matrix
    A: Matrix
    A_rate: Matrix
    A_x: Tensor
    A_x_rate: Tensor
    N: Matrix
    q_dot: Vector
    C_dot_z: Vector
    g: Vector
    H: Matrix
    H_rate: Matrix


class Found(NamedTuple):
    """Results of :func:`coordinates` and :func:`rates`, and their work space."""

    f: Vector
    J: Matrix
    J_dot_z: Vector
    complement: Matrix
    j: Matrix
    j_rate: Matrix
    lower: Matrix
    """L of j j^T = L L^T, shape (s, s)."""
    K: Matrix
    """H + D(lam), shape (nq, nq)."""
    K_rate: Matrix
    """Its rate at fixed lam."""
    rows: Matrix
    """N Proj_ker j where the gauge is lost, else work space, shape (nz - m, nq)."""
    defect: Matrix
    """Work space, shape (nz - m, nz - m)."""
    work: Matrix
    """Work space, shape (4, nq)."""


class ExtendedJacobian:
    """f, J and J' z along a motion, in memory that stays where it is; see the module.

    Args:
        robot: The robot.
        task_map: f_e.
        criterion: F.
        buffers: The robot's matrices at the state, if somebody computes them already.

    Attributes:
        buffers: The robot's matrices at the state.
        f, J, J_dot_z, complement: As of :class:`ExtendedKinematics`, with f = (f_e, f_a); the rows of
            the complement are carried from state to state.
    """

    def __init__(
        self,
        robot: MobileManipulator,
        task_map: TaskMap,
        criterion: Criterion,
        buffers: Buffers | None = None,
    ) -> None:
        self.buffers = now = Buffers(robot) if buffers is None else buffers
        self._criterion = criterion
        nq, nz, m, s = robot.nq, robot.nz, task_map.m, task_map.m + robot.k
        self.f, self.J, self.J_dot_z = np.zeros(nz), np.zeros((nz, nz)), np.zeros(nz)
        self.complement = first_axes(nz - m, nq)
        J_f, J_f_rate, self._rows = task_map.rows_of(now)
        self._at = Given(
            *(robot.platform_index, robot.arm),
            *(now.tip, now.tip_jacobian, now.tip_jacobian_rate, J_f, J_f_rate, now.tip_axes),
            *(now.A, now.A_rate, now.A_x, now.A_x_rate, now.N, now.q_dot, now.C_dot_z),
            *(np.zeros(nq), np.zeros((nq, nq)), np.zeros((nq, nq))),
        )
        self._own = Found(
            *(self.f, self.J, self.J_dot_z, self.complement),
            *(np.zeros((s, nq)), np.zeros((s, nq)), np.zeros((s, s))),
            *(np.zeros((nq, nq)), np.zeros((nq, nq))),
            *(np.zeros((nz - m, nq)), np.zeros((nz - m, nz - m)), np.zeros((4, nq))),
        )

    @cached_property
    def coordinates(self) -> Callable[[], int]:
        """Fills f and the complement, after the buffers' ``constraints`` and ``tip_kinematics``;
        SINGULAR, or GAUGE_LOST where :meth:`auxiliary` has to do it."""
        now, at = self.buffers, self._at
        criterion = criterion_entry(self._criterion, now.q, now.q_dot, at.g, at.H, at.H_rate)
        return sequence(*self._rows, criterion, bind(coordinates, at, self._own), join=False)

    @cached_property
    def _update(self) -> Callable[[], int]:
        now = self.buffers
        rest = bind(rates, self._at, self._own)
        return sequence(now.constraints, now.tip_kinematics, self.coordinates, rest)

    def auxiliary(self) -> None:
        """Fill f and the complement, after the buffers' ``constraints`` and ``tip_kinematics``.

        Raises:
            SingularityError: If j has lost its rank.
        """
        while status := self.coordinates():
            self._resolve(status)

    def update(self) -> None:
        """Fill f, J and J' z, after the buffers' ``velocity`` and ``run_jacobians``.

        Raises:
            SingularityError: If j has lost its rank.
        """
        while status := self._update():
            self._resolve(status)

    def _resolve(self, status: int) -> None:
        if status != GAUGE_LOST:
            singular = "j j^T is singular to working precision: a kinematic singularity", "j"
            raise SingularityError(*((REASONS[status],) if status in REASONS else singular))
        # the first state, or one far from the last
        self.complement[:] = _nearest_complement(self._own.j, self._own.rows)

    def at(self, q: Array, z: Array) -> None:
        """Compute f, J and J' z at (q, z).

        Raises:
            SingularityError: If j has lost its rank.
        """
        now = self.buffers
        now.q[...] = q
        now.z[...] = z
        now.velocity()
        now.run_jacobians()
        self.update()


@kernel
def coordinates(at: Given, own: Found) -> int:
    """f = (f_e, f_a) of (13), on the rows of ker j that are nearest to those before."""
    k = at.A.shape[0]
    m = own.j.shape[0] - k
    copy(at.J_f, own.j)  # j = [J_f; A 0] under (11)
    copy(at.A, own.j[m:])
    gram(own.j, own.lower)  # j j^T = L L^T
    if cholesky(own.lower, own.lower) != 0 or not well_posed(own.lower):
        return SINGULAR
    if carry(own.j, own.lower, own.complement, own.rows, own.defect, own.j_rate) != 0:
        return GAUGE_LOST
    for i in range(m):
        own.f[i] = at.tip[i] if i < 3 else 0.0  # an orientation has no coordinates, but an error
    apply(own.complement, at.g, own.f[m:])  # f_a = N g (11)
    return 0


@kernel
def rates(at: Given, own: Found) -> None:
    """J of (13) and J' z, after :func:`coordinates`."""
    g, j, j_rate, K, K_rate, N = at.g, own.j, own.j_rate, own.K, own.K_rate, own.complement
    s = j.shape[0]
    m = s - at.A.shape[0]
    lam, lam_rate, transport = own.work[0, :s], own.work[1, :s], own.work[2, :s]
    total = own.work[3]
    copy(at.J_f_rate, j_rate)
    copy(at.A_rate, j_rate[m:])
    # lam = -(j^+)^T g = -(j j^T)^-1 j g
    apply(j, g, lam)
    cholesky_solve(own.lower, lam, lam)
    for i in range(s):
        lam[i] = -lam[i]
    # K = H + D(lam), and its rate at fixed lam
    copy(at.H, K)
    add_task_hessian(at.tip_jacobian, lam, min(m, 3), K)
    if m > 3:
        add_turning_hessian(at.tip_jacobian, lam[3:m], at.axes, K)
    _add_constraint_hessian(at.platform_index, at.A_x, lam[m:], K)
    copy(at.H_rate, K_rate)
    add_task_hessian_rate(at.tip_jacobian, at.tip_jacobian_rate, lam, min(m, 3), K_rate)
    if m > 3:
        add_turning_hessian_rate(at.tip_jacobian, at.tip_jacobian_rate, lam[3:m], at.axes, K_rate)
    _add_constraint_hessian(at.platform_index, at.A_x_rate, lam[m:], K_rate)
    # j_e = J_f C of (43), J_a = N K C
    _times_C(j[:m], at, own.J[:m])
    multiply(N, K, own.rows)
    _times_C(own.rows, at, own.J[m:])
    # J_e' z = J_f' q' + J_f C' z
    for i in range(m):
        own.J_dot_z[i] = dot(j_rate[i], at.q_dot) + dot(j[i], at.C_dot_z)
    # N' K q' = -N j'^T transport, since N' = -N j'^T (j^+)^T
    apply(K, at.q_dot, total)
    apply(j, total, transport)
    cholesky_solve(own.lower, transport, transport)
    # lam' = -(j j^T)^-1 (j' (g + j^T lam) + j K q')
    apply_transpose(j, lam, total)
    for i in range(total.shape[0]):
        total[i] += g[i]
    apply(j_rate, total, lam_rate)
    cholesky_solve(own.lower, lam_rate, lam_rate)
    # D(lam') q' = j'^T lam'; with the transport above, both through j'^T
    for i in range(s):
        lam_rate[i] = -lam_rate[i] - 2.0 * transport[i]
    apply_transpose(j_rate, lam_rate, total)
    # J_a' z = N (K' q' + K C' z + D(lam') q') + N' K q'
    for i in range(total.shape[0]):
        total[i] += dot(K_rate[i], at.q_dot) + dot(K[i], at.C_dot_z)
    apply(N, total, own.J_dot_z[m:])


@kernel
def carry(
    j: Matrix, lower: Matrix, complement: Matrix, projected: Matrix, defect: Matrix, work: Matrix
) -> int:
    r"""The orthonormal rows of ker j nearest to ``complement``: polar(N Proj_ker j), in its place.

    Near the last configuration N N^T is I to second order in the step, and a few Newton-Schulz
    iterations give the polar factor to working precision. GAUGE_LOST if it is not near. The work space
    has the shape of j.
    """
    rows, nq = complement.shape
    for i in range(j.shape[0]):
        apply(complement, j[i], work[i])  # j N^T
    cholesky_solve_columns(lower, work, rows)
    for i in range(rows):
        for c in range(nq):
            projected[i, c] = 0.0
        for k in range(j.shape[0]):
            for c in range(nq):
                projected[i, c] += j[k, c] * work[k, i]
        for c in range(nq):
            projected[i, c] = complement[i, c] - projected[i, c]
    for _ in range(4):
        gram(projected, defect)
        size = 0.0
        for i in range(rows):
            defect[i, i] -= 1.0
            for k in range(rows):
                size = max(size, abs(defect[i, k]))
        if not size <= _NEWTON_SCHULZ:
            return GAUGE_LOST
        if size < _ROUNDING:
            break
        # X - (X X^T - I) X / 2
        multiply(defect, projected, complement)
        for i in range(rows):
            for c in range(nq):
                projected[i, c] -= 0.5 * complement[i, c]
        if size < _QUADRATIC:
            break
    copy(projected, complement)
    return 0


@kernel
def _add_constraint_hessian(
    platform_index: Index, A_x: Tensor, multiplier: Vector, hessian: Matrix
) -> None:
    """Add d([A 0]^T lam_A)/dq, or its rate."""
    k, l, _ = A_x.shape
    for row in range(k):
        for i in range(l):
            for c in range(l):
                entry = multiplier[row] * A_x[row, i, c]
                hessian[platform_index[i], platform_index[c]] += entry


@kernel
def _times_C(rows: Matrix, at: Given, reduced: Matrix) -> None:
    """rows C, for C = blkdiag(N, I) of (9)."""
    l, p = at.N.shape
    for i in range(rows.shape[0]):
        for a in range(p):
            entry = 0.0
            for c in range(l):
                entry += rows[i, at.platform_index[c]] * at.N[c, a]
            reduced[i, a] = entry
        for c in range(p, reduced.shape[1]):
            reduced[i, c] = 0.0
        for c in range(at.arm.joints.shape[0]):
            reduced[i, p + at.arm.column[c]] += at.arm.ratio[c] * rows[i, at.arm.joints[c]]


def extended_kinematics(
    robot: MobileManipulator,
    task_map: TaskMap,
    criterion: Criterion,
    q: Array,
    z: Array,
    complement: Array | None = None,
) -> ExtendedKinematics:
    r"""f, J and J' z at one (q, z); :class:`ExtendedJacobian` is for many.

    Args:
        robot: The robot.
        task_map: f_e.
        criterion: F.
        q: Configuration, shape (nq,).
        z: Reduced velocity, shape (nz,).
        complement: :math:`\mathcal N` at a configuration nearby (the last tick's), which is carried
            over to this one; without it some orthonormal complement is chosen. The norm of f_a and
            the singular values of J do not depend on it.

    Raises:
        SingularityError: If j has lost its rank.
    """
    extended, m = ExtendedJacobian(robot, task_map, criterion), task_map.m
    if complement is not None:
        extended.complement[:] = complement
    extended.at(q, z)
    return ExtendedKinematics(
        extended.f[:m], extended.f[m:], extended.J, extended.J_dot_z, extended.complement
    )


def auxiliary_coordinates(
    robot: MobileManipulator,
    task_map: TaskMap,
    criterion: Criterion,
    q: Array,
    complement: Array | None = None,
) -> tuple[Array, Array]:
    """f_a of (11) alone, shape (nz - m,), and the complement whose rows are its axes.

    Arguments and errors as for :func:`extended_kinematics`.
    """
    now = extended_kinematics(robot, task_map, criterion, q, np.zeros(robot.nz), complement)
    return now.f_a, now.complement


def orthonormal_complement(j: Array) -> Array:
    """Some orthonormal rows of ker j, shape (nq - rows, nq).

    Raises:
        SingularityError: If j has not full row rank.
    """
    complement: Array = null_space(j).T
    if len(complement) != j.shape[1] - j.shape[0]:
        raise SingularityError("j = [df_e/dq; A 0] has lost its rank: a kinematic singularity", "j")
    return complement


def first_axes(rows: int, nq: int) -> Array:
    """Any rows in general position, always the same: the first complement is that nearest to them.

    A null space has no axes of its own, so those that a decomposition gives turn with its rounding.
    """
    i, j = np.meshgrid(np.arange(1, rows + 1), np.arange(1, nq + 1), indexing="ij")
    axes: Array = np.cos(i * np.sqrt(j + 1.0) + i**2)
    return axes


def _nearest_complement(j: Array, projected: Array) -> Array:
    """The orthonormal rows of ker j nearest to those of N Proj_ker j, however far that is."""
    left, singular, right = np.linalg.svd(projected, full_matrices=False)
    if not np.all(singular > _NO_DIRECTION):
        return orthonormal_complement(j)
    polar: Array = left @ right
    return polar
