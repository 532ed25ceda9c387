"""The extended Jacobian as steps of a program, until the laws use the other."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from mobman.arrays import Array
from mobman.errors import SingularityError
from mobman.kernels.program import Call, Program, call, program
from mobman.model.criterion import Criterion, criterion_steps
from mobman.model.extended_kernels import (
    GAUGE_LOST,
    auxiliary_rates,
    carry,
    coordinates,
    curvature,
    curvature_rate,
    factorise,
    multipliers,
    stack,
    task_rates,
)
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.model.workspace import Workspace

_NO_DIRECTION = 1e-6  # singular value of N Proj_ker j below which a row's direction means nothing


class ExtendedJacobian:
    """f, J and J' z along a motion, in memory that stays where it is; see the module.

    Args:
        robot: The robot.
        task_map: f_e.
        criterion: F.
        workspace: The robot's matrices at the state, if somebody computes them already.

    Attributes:
        workspace: The robot's matrices at the state.
        f: (f_e, f_a) of (13), shape (nz,).
        J: Shape (nz, nz).
        J_dot_z: Shape (nz,).
        complement: The axes of f_a, orthonormal rows of ker j, shape (nz - m, nq). They are carried
            from state to state.
    """

    def __init__(
        self,
        robot: MobileManipulator,
        task_map: TaskMap,
        criterion: Criterion,
        workspace: Workspace | None = None,
    ) -> None:
        self.workspace = Workspace(robot) if workspace is None else workspace
        self._robot, self._m, self._criterion = robot, task_map.m, criterion
        m, nq, nz, s = task_map.m, robot.nq, robot.nz, task_map.m + robot.k
        self.f, self.J, self.J_dot_z = np.zeros(nz), np.zeros((nz, nz)), np.zeros(nz)
        self.complement = first_axes(nz - m, nq)
        self._j, self._j_rate, self._lower = np.zeros((s, nq)), np.zeros((s, nq)), np.zeros((s, s))
        self._projected = np.zeros((nz - m, nq))
        self._g, self._H, self._H_rate = np.zeros(nq), np.zeros((nq, nq)), np.zeros((nq, nq))

    def auxiliary_steps(self) -> list[Call]:
        """f and what it takes, after the workspace's velocity steps and ``run_jacobians``.

        Their status is to be given to :meth:`resolve` if it is not 0.
        """
        now, m, s = self.workspace, self._m, len(self._j)
        defect, row = np.zeros((self._robot.nz - m,) * 2), np.zeros(s)
        return [
            *now.constraint_steps(),
            *now.tip_steps(),
            call(stack, now.tip_jacobian, now.A, self._j, m),
            call(factorise, self._j, self._lower),
            call(carry, self._j, self._lower, self.complement, self._projected, defect, row),
            *criterion_steps(self._criterion, now.q, now.q_dot, self._g, self._H, self._H_rate),
            call(coordinates, now.tip, self.complement, self._g, self.f, m),
        ]

    def steps(self) -> list[Call]:
        """f, J and J' z, as :meth:`auxiliary_steps`."""
        now, robot, m, s = self.workspace, self._robot, self._m, len(self._j)
        nq, nz = robot.nq, robot.nz
        multiplier, total, total_rate = np.zeros(s), np.zeros((nq, nq)), np.zeros((nq, nq))
        blocks = (robot.platform_index, robot.arm_index, now.N)
        work = (np.zeros((nz - m, nq)), np.zeros(nq), np.zeros(nq), np.zeros(s), np.zeros(s))
        return [
            *self.auxiliary_steps(),
            call(stack, now.tip_jacobian_rate, now.A_rate, self._j_rate, m),
            call(multipliers, self._lower, self._j, self._g, multiplier),
            call(
                curvature,
                self._H,
                now.tip_jacobian,
                robot.platform_index,
                now.A_x,
                multiplier,
                m,
                total,
            ),
            call(
                curvature_rate,
                self._H_rate,
                now.tip_jacobian,
                now.tip_jacobian_rate,
                robot.platform_index,
                now.A_x_rate,
                multiplier,
                m,
                total_rate,
            ),
            call(
                task_rates,
                self._j,
                self._j_rate,
                *blocks,
                now.q_dot,
                now.C_dot_z,
                m,
                self.J,
                self.J_dot_z,
            ),
            call(
                auxiliary_rates,
                self._lower,
                self._j,
                self._j_rate,
                self.complement,
                self._g,
                multiplier,
                total,
                total_rate,
                *blocks,
                now.q_dot,
                now.C_dot_z,
                m,
                self.J,
                self.J_dot_z,
                *work,
            ),
        ]

    def resolve(self, status: int) -> None:
        """Do what the steps could not, so that they can be run again.

        Raises:
            SingularityError: If j has lost its rank.
        """
        if status == GAUGE_LOST:  # the first state, or one far from the last
            self.complement[:] = _nearest_complement(self._j, self._projected)
        else:
            raise SingularityError(
                "j j^T is singular to working precision: a kinematic singularity"
            )

    def at(self, q: Array, z: Array) -> None:
        """Compute f, J and J' z at (q, z).

        Raises:
            SingularityError: If j has lost its rank.
        """
        now = self.workspace
        now.q[:] = q
        now.z[:] = z
        velocity, everything = self._programs
        velocity()
        now.run_jacobians()
        while status := everything():
            self.resolve(status)

    @cached_property
    def _programs(self) -> tuple[Program, Program]:
        return program(self.workspace.velocity_steps()), program(self.steps())


def orthonormal_complement(j: Array) -> Array:
    """Some orthonormal rows of ker j, shape (nq - rows, nq).

    Raises:
        SingularityError: If j has not full row rank.
    """
    complement: Array = null_space(j).T
    if len(complement) != j.shape[1] - j.shape[0]:
        raise SingularityError("j = [df_e/dq; A 0] has lost its rank: a kinematic singularity")
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
