"""Kinematics (9) and reduced dynamics (17) at one state, from Pinocchio's matrices and the platform's.

The paper's symbols: x and alpha are the platform's coordinates and quasi-velocities, N its velocity
map (3), A its constraints (1), C = blkdiag(N, I) of (9), M' and B' the robot's inertia and actuation in
the coordinates q (16), M and B those in z (17).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Columns, Index, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.linalg import apply
from mobman.model.platforms.platform import (
    ArmJoints,
    Motion,
    assemble_constraints,
    assemble_velocity,
    gather,
)


class Buffers:
    """Preallocated buffers for kinematics and dynamics at one state, and what fills them.

    Whoever evaluates a robot at every tick owns one: it puts the state into ``q`` and ``z`` and calls
    the functions below in the order that they need. Nothing is allocated and nothing is copied; results
    are overwritten by the next state's. All that is written to belongs to the buffers, Pinocchio's
    results included, and nothing to the robot: threads do not disturb each other.

    Args:
        robot: A :class:`mobman.model.mobile_manipulator.MobileManipulator`, which has some of its own.

    Attributes:
        data: Pinocchio's results at the state.
        q, z: The state, shapes (nq,) and (nz,).
        x, x_dot, alpha: The platform's part of q, q' and z, shapes (l,), (l,) and (l-k,).
        N, N_rate: (3) and its rate, shape (l, l-k).
        q_dot: C z, shape (nq,).
        C: Shape (nq, nz).
        C_dot_z: C' z, shape (nq,).
        A, A_rate: [A 0] of (16), the rows of joints that follow others below, and its rate, (k, nq).
        A_x, A_x_rate: Derivative of the platform's A by x, and its rate, shape (., l, l).
        M, bias, B: The reduced dynamics (17), shapes (nz, nz), (nz,), (nz, nz).
        tip: Position of the tip (m), shape (3,).
        tip_jacobian, tip_jacobian_rate: World axes, linear rows first, shape (6, nq).
        tip_rotation: Of the tip frame, shape (3, 3); filled by ``tip_orientation``.
        tip_axes: For those of a pointing task, see :mod:`mobman.model.task_map`, shape (4, 3).
        run_dynamics: Pinocchio's part of ``inertia`` and ``bias_terms``; needs q and q_dot.
        run_effects: That of ``bias_terms`` alone, where M' is there.
        run_jacobians: Pinocchio's part of ``tip_kinematics`` and ``inertia``; needs q.
        run_all: Pinocchio's part of all of these; needs q and q_dot.
    """

    def __init__(self, robot: Any) -> None:
        l, p, k, nq, nz = len(robot.platform_index), robot.n_alpha, robot.k, robot.nq, robot.nz
        self._robot = robot
        self.q, self.z = robot.q_rest.copy(), np.zeros(nz)
        self.x, self.x_dot, self.alpha = np.zeros(l), np.zeros(l), np.zeros(p)
        self.N, self.N_rate = np.zeros((l, p)), np.zeros((l, p))
        self.q_dot, self.C_dot_z, self.C = np.zeros(nq), np.zeros(nq), np.zeros((nq, nz))
        self.platform_B, self.platform_A = np.zeros((l, p)), np.zeros((l - p, l))
        self.A_x, self.A_x_rate = np.zeros((l - p, l, l)), np.zeros((l - p, l, l))
        self.A, self.A_rate = np.zeros((k, nq)), np.zeros((k, nq))
        self.A[l - p :] = robot.following_rows
        self.M, self.bias, self.B = np.zeros((nz, nz)), np.zeros(nz), np.eye(nz)
        self.tip, self.tip_jacobian = np.zeros(3), np.zeros((6, nq))
        self.tip_jacobian_rate = np.zeros((6, nq))
        self.tip_rotation, self.tip_axes = np.eye(3), np.zeros((4, 3))

        # Pinocchio's results where they are, instead of copies at every call
        self.data = data = robot.model.createData()
        self.joint_inertia, self.nonlinear = data.M, data.nle
        # In world axes crba computes placements and Jacobians on the way, which spares a pass over the
        # joints, but loses digits with the distance from the origin: 1e-12 at 30 m.
        world = pin.Convention.WORLD
        # local names, since these run many times a tick
        model, q, q_dot = robot.model, self.q, self.q_dot
        effects, crba = pin.nonLinearEffects, pin.crba

        def run_dynamics() -> None:
            effects(model, data, q, q_dot)
            crba(model, data, q)

        def run_all() -> None:
            effects(model, data, q, q_dot)
            crba(model, data, q, world)

        def run_effects() -> None:
            effects(model, data, q, q_dot)

        def run_jacobians() -> None:
            crba(model, data, q, world)

        self.run_dynamics, self.run_all = run_dynamics, run_all
        self.run_effects, self.run_jacobians = run_effects, run_jacobians

    @cached_property
    def _motion(self) -> Motion:
        mine = vars(self) | {"platform_index": self._robot.platform_index, "arm": self._robot.arm}
        return Motion(*(mine[name] for name in Motion._fields))

    @cached_property
    def velocity(self) -> Callable[[], int]:
        """Fills x, alpha, N, x_dot, N_rate, B'', C, q_dot and C_dot_z, from q and z."""
        own, motors = self._robot.platform.equations, self._robot.motors.equations
        at = self._motion
        return sequence(
            bind(gather, at),
            bind(own.velocity_map, own.parameters, at.x, at.N),
            bind(apply, at.N, at.alpha, at.x_dot),
            bind(own.velocity_map_rate, own.parameters, at.x, at.x_dot, at.N_rate),
            bind(motors.actuation, motors.parameters, at.x, at.platform_B),
            bind(assemble_velocity, at),
        )

    @cached_property
    def constraints(self) -> Callable[[], object]:
        """Fills A and its derivatives, after ``velocity``."""
        own, at = self._robot.platform.equations, self._motion
        return sequence(
            bind(own.constraints, own.parameters, at.x, at.platform_A, at.A_x),
            bind(own.constraint_derivative_rate, own.parameters, at.x, at.x_dot, at.A_x_rate),
            bind(assemble_constraints, at),
            join=False,
        )

    @cached_property
    def inertia(self) -> Callable[[], None]:
        """Fills M and B, after ``velocity`` and ``run_jacobians`` or ``run_dynamics``."""
        index, arm = self._robot.platform_index, self._robot.arm
        given = (self.joint_inertia, index, arm, self.N, self.platform_B)
        return bind(reduced_inertia, *given, self.M, self.B)

    @cached_property
    def bias_terms(self) -> Callable[[], None]:
        """Fills the bias, after ``velocity`` and ``run_dynamics``."""
        given = (self.joint_inertia, self.nonlinear, self._robot.platform_index, self._robot.arm)
        return bind(reduced_bias, *given, self.N, self.C_dot_z, self.bias)

    @cached_property
    def tip_kinematics(self) -> Callable[[], None]:
        """Fills the tip's position, Jacobian and rate, after ``velocity`` and ``run_jacobians``."""
        robot, data = self._robot, self.data
        placement = data.oMi[robot.model.frames[robot.tip_frame].parentJoint]
        return bind(
            tip_kinematics,
            *(placement.rotation, placement.translation, robot.tip_offset, robot.tip_chain),
            *(data.J, self.q_dot, self.tip, self.tip_jacobian, self.tip_jacobian_rate),
        )

    @cached_property
    def tip_orientation(self) -> Callable[[], None]:
        """Fills the tip's rotation, after ``run_jacobians``."""
        robot = self._robot
        placement = self.data.oMi[robot.model.frames[robot.tip_frame].parentJoint]
        return bind(tip_orientation, placement.rotation, robot.tip_rotation, self.tip_rotation)


@kernel
def symmetric(matrix: Columns, i: int, j: int) -> float:
    """An entry of the symmetric matrix whose upper triangle is given: what crba writes."""
    return float(matrix[i, j]) if i <= j else float(matrix[j, i])


@kernel
def reduced_inertia(
    inertia: Columns,
    platform_index: Index,
    arm: ArmJoints,
    N: Matrix,
    actuation: Matrix,
    M: Matrix,
    B: Matrix,
) -> None:
    """M = C^T M' C and B = C^T B' of (17), by blocks of C = blkdiag(N, I).

    ``inertia`` is M', its upper triangle, ``actuation`` B'' of the platform, for whose block of B it is;
    the rest of B is that of I.
    """
    l, p = N.shape
    n = arm.joints.shape[0]
    for a in range(M.shape[0]):
        for b in range(M.shape[0]):
            M[a, b] = 0.0
    for a in range(p):
        for b in range(p):
            B[a, b] = 0.0
            for i in range(l):
                B[a, b] += N[i, a] * actuation[i, b]
    for i in range(l):
        row = platform_index[i]
        for j in range(i + 1):
            entry = symmetric(inertia, row, platform_index[j])
            for a in range(p):
                for b in range(p):
                    M[a, b] += N[i, a] * entry * N[j, b]
                    if i != j:
                        M[a, b] += N[j, a] * entry * N[i, b]
        for j in range(n):
            entry = arm.ratio[j] * symmetric(inertia, row, arm.joints[j])
            for a in range(p):
                M[a, p + arm.column[j]] += N[i, a] * entry
    for j in range(p, M.shape[0]):
        for a in range(p):
            M[j, a] = M[a, j]
    for j in range(n):
        column = p + arm.column[j]
        for i in range(j + 1):  # arm.joints increases
            row = p + arm.column[i]
            entry = arm.ratio[i] * arm.ratio[j] * inertia[arm.joints[i], arm.joints[j]]
            M[row, column] += entry
            if i != j:
                M[column, row] += entry


@kernel
def reduced_bias(
    inertia: Columns,
    nonlinear: Vector,
    platform_index: Index,
    arm: ArmJoints,
    N: Matrix,
    C_dot_z: Vector,
    bias: Vector,
) -> None:
    """Pz + G = C^T (M' C' z + nonlinear) of (17); C' z has entries in the platform's rows only."""
    l, p = N.shape
    for a in range(bias.shape[0]):
        bias[a] = 0.0
    for i in range(l + arm.joints.shape[0]):
        row = platform_index[i] if i < l else arm.joints[i - l]
        entry = nonlinear[row]
        for j in range(l):
            column = platform_index[j]
            entry += symmetric(inertia, row, column) * C_dot_z[column]
        if i < l:
            for a in range(p):
                bias[a] += N[i, a] * entry
        else:
            bias[p + arm.column[i - l]] += arm.ratio[i - l] * entry


@kernel
def tip_kinematics(
    rotation: Columns,
    translation: Vector,
    offset: Vector,
    chain: Vector,
    jacobian_origin: Columns,
    q_dot: Vector,
    position: Vector,
    jacobian: Matrix,
    rate: Matrix,
) -> None:
    """The tip's position p, and its Jacobian and the rate of that in world axes, linear rows first.

    Pinocchio keeps the columns (v, w) of all joints for a point at the world's origin: the tip's
    velocity is v + w x p, its rate v' + w' x p + w x p', for the joints that carry it (``chain`` is 1
    for these, else 0). A joint's axis moves with the body that carries it, of the velocity (V, W) at the
    origin: v' = W x v + V x w, w' = W x w. Rotation and translation are of the joint that carries the
    tip, offset the tip in its axes.
    """
    for i in range(3):
        position[i] = translation[i]
        for j in range(3):
            position[i] += rotation[i, j] * offset[j]
    x, y, z = position[0], position[1], position[2]
    x_dot = y_dot = z_dot = 0.0
    for j in range(chain.shape[0]):
        on = chain[j]
        w0, w1, w2 = jacobian_origin[3, j], jacobian_origin[4, j], jacobian_origin[5, j]
        jacobian[0, j] = on * (jacobian_origin[0, j] + w1 * z - w2 * y)
        jacobian[1, j] = on * (jacobian_origin[1, j] + w2 * x - w0 * z)
        jacobian[2, j] = on * (jacobian_origin[2, j] + w0 * y - w1 * x)
        jacobian[3, j], jacobian[4, j], jacobian[5, j] = on * w0, on * w1, on * w2
        x_dot += jacobian[0, j] * q_dot[j]
        y_dot += jacobian[1, j] * q_dot[j]
        z_dot += jacobian[2, j] * q_dot[j]
    V0 = V1 = V2 = W0 = W1 = W2 = 0.0
    for j in range(chain.shape[0]):  # from the base to the tip
        on, by = chain[j], chain[j] * q_dot[j]
        v0, v1, v2 = jacobian_origin[0, j], jacobian_origin[1, j], jacobian_origin[2, j]
        w0, w1, w2 = jacobian_origin[3, j], jacobian_origin[4, j], jacobian_origin[5, j]
        V0, V1, V2 = V0 + by * v0, V1 + by * v1, V2 + by * v2
        W0, W1, W2 = W0 + by * w0, W1 + by * w1, W2 + by * w2
        r0, r1, r2 = W1 * w2 - W2 * w1, W2 * w0 - W0 * w2, W0 * w1 - W1 * w0
        v0_dot = W1 * v2 - W2 * v1 + V1 * w2 - V2 * w1
        v1_dot = W2 * v0 - W0 * v2 + V2 * w0 - V0 * w2
        v2_dot = W0 * v1 - W1 * v0 + V0 * w1 - V1 * w0
        rate[0, j] = on * (v0_dot + r1 * z - r2 * y + w1 * z_dot - w2 * y_dot)
        rate[1, j] = on * (v1_dot + r2 * x - r0 * z + w2 * x_dot - w0 * z_dot)
        rate[2, j] = on * (v2_dot + r0 * y - r1 * x + w0 * y_dot - w1 * x_dot)
        rate[3, j], rate[4, j], rate[5, j] = on * r0, on * r1, on * r2


@kernel
def tip_orientation(joint: Columns, frame: Matrix, rotation: Matrix) -> None:
    """The tip frame's rotation, from that of its joint and its own in the joint's axes."""
    for i in range(3):
        for j in range(3):
            rotation[i, j] = 0.0
            for k in range(3):
                rotation[i, j] += joint[i, k] * frame[k, j]
