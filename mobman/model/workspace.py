"""Preallocated buffers for kinematics and dynamics at one state."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Index
from mobman.kernels.dense import apply
from mobman.kernels.program import Call, call
from mobman.model.kernels import (
    assemble_constraints,
    assemble_velocity,
    gather,
    reduced_bias,
    reduced_inertia,
    tip_kinematics,
    tip_position,
)
from mobman.model.platforms.platform import Platform


class Structure(Protocol):
    """Model and indices of a :class:`mobman.model.mobile_manipulator.MobileManipulator`."""

    model: pin.Model
    platform: Platform
    platform_index: Index
    arm_index: Index
    q_rest: Array
    nq: int
    nz: int
    n_alpha: int
    k: int
    tip_frame: int
    tip_offset: Array
    tip_chain: Array


class Workspace:
    """The matrices of a robot at one state, and the steps that compute them.

    Whoever evaluates a robot at every tick owns one: it puts the state into ``q`` and ``z``, runs
    programs made of the steps below and, between them, the algorithms of Pinocchio that they need.
    Nothing is allocated and nothing is copied; results are overwritten by the next state's. Steps
    of :class:`mobman.model.mobile_manipulator.MobileManipulator`'s own methods are these, too.

    All that is written to belongs to the workspace, Pinocchio's results included, and nothing to the
    robot: what one owner computes cannot come between the steps of another, in whatever thread.

    Attributes:
        data: Pinocchio's results at the state.
        q, z: The state, shapes (nq,) and (nz,).
        q_dot: C z, shape (nq,).
        C: Shape (nq, nz).
        C_dot_z: C' z, shape (nq,).
        A, A_rate: [A 0] of (16) and its rate, shape (k, nq).
        A_x, A_x_rate: Derivative of A by x, and its rate, shape (k, l, l).
        M, bias, B: The reduced dynamics (17), shapes (nz, nz), (nz,), (nz, nz).
        tip: Position of the tip (m), shape (3,).
        tip_jacobian, tip_jacobian_rate: World axes, linear rows first, shape (6, nq).
        run_dynamics: Pinocchio's part of :meth:`inertia_steps` and :meth:`bias_steps`; needs q and
            q_dot.
        run_all: The same, leaving the joints' placements and Jacobians (not their rates) behind.
        run_inertia: Pinocchio's part of :meth:`inertia_steps`; needs q.
        run_jacobians: Pinocchio's part of :meth:`tip_steps`; needs q and q_dot.
    """

    def __init__(self, robot: Structure) -> None:
        l, p = len(robot.platform_index), robot.n_alpha
        self._robot = robot
        self.data = robot.model.createData()
        self.q = robot.q_rest.copy()
        self.z = np.zeros(robot.nz)
        self.x, self.x_dot, self.alpha = np.zeros(l), np.zeros(l), np.zeros(p)
        self.N, self.N_rate = np.zeros((l, p)), np.zeros((l, p))
        self.q_dot, self.C_dot_z = np.zeros(robot.nq), np.zeros(robot.nq)
        self.C = np.zeros((robot.nq, robot.nz))
        self.platform_B = np.zeros((l, p))
        self.platform_A = np.zeros((robot.k, l))
        self.A_x, self.A_x_rate = np.zeros((robot.k, l, l)), np.zeros((robot.k, l, l))
        self.A, self.A_rate = np.zeros((robot.k, robot.nq)), np.zeros((robot.k, robot.nq))
        self.M, self.bias = np.zeros((robot.nz, robot.nz)), np.zeros(robot.nz)
        self.B = np.eye(robot.nz)
        self.tip = np.zeros(3)
        self.tip_jacobian = np.zeros((6, robot.nq))
        self.tip_jacobian_rate = np.zeros((6, robot.nq))
        self._view_pinocchio()
        self._bind_pinocchio()

    def _view_pinocchio(self) -> None:
        """Look at Pinocchio's results where they are, instead of copying them at every call."""
        data, model = self.data, self._robot.model
        tip = data.oMi[model.frames[self._robot.tip_frame].parentJoint]
        self._joint_inertia, self._nonlinear = data.M, data.nle
        self._joint_jacobian, self._joint_jacobian_rate = data.J, data.dJ
        self._tip_rotation, self._tip_translation = tip.rotation, tip.translation

    def _bind_pinocchio(self) -> None:
        # local names, since these run many times a tick
        model, data, q, q_dot = self._robot.model, self.data, self.q, self.q_dot
        nonlinear_effects, crba = pin.nonLinearEffects, pin.crba
        jacobians = pin.computeJointJacobiansTimeVariation
        # In world axes crba computes placements and Jacobians on the way, but loses digits with the
        # distance from the origin: 1e-12 at 30 m.
        world = pin.Convention.WORLD

        def run_dynamics() -> None:
            nonlinear_effects(model, data, q, q_dot)
            crba(model, data, q)

        def run_all() -> None:
            nonlinear_effects(model, data, q, q_dot)
            crba(model, data, q, world)

        def run_inertia() -> None:
            crba(model, data, q)

        def run_jacobians() -> None:
            jacobians(model, data, q, q_dot)

        self.run_dynamics, self.run_all = run_dynamics, run_all
        self.run_inertia, self.run_jacobians = run_inertia, run_jacobians

    # Steps -------------------------------------------------------------------------------------

    def velocity_steps(self) -> list[Call]:
        """C, q_dot and C_dot_z, from q and z."""
        robot, equations = self._robot, self._robot.platform.equations
        return [
            call(gather, robot.platform_index, self.q, self.z, self.x, self.alpha),
            call(equations.velocity_map, equations.parameters, self.x, self.N),
            call(apply, self.N, self.alpha, self.x_dot),
            call(
                equations.velocity_map_rate, equations.parameters, self.x, self.x_dot, self.N_rate
            ),
            call(
                assemble_velocity,
                robot.platform_index,
                robot.arm_index,
                self.alpha,
                self.z,
                self.x_dot,
                self.N,
                self.N_rate,
                self.q_dot,
                self.C,
                self.C_dot_z,
            ),
        ]

    def constraint_steps(self) -> list[Call]:
        """A and its derivatives, after :meth:`velocity_steps`."""
        robot, equations = self._robot, self._robot.platform.equations
        return [
            call(equations.constraints, equations.parameters, self.x, self.platform_A, self.A_x),
            call(
                equations.constraint_derivative_rate,
                equations.parameters,
                self.x,
                self.x_dot,
                self.A_x_rate,
            ),
            call(
                assemble_constraints,
                robot.platform_index,
                self.x_dot,
                self.platform_A,
                self.A_x,
                self.A,
                self.A_rate,
            ),
        ]

    def inertia_steps(self) -> list[Call]:
        """M and B, after :meth:`velocity_steps` and :meth:`run_inertia` or :meth:`run_dynamics`."""
        robot, equations = self._robot, self._robot.platform.equations
        return [
            call(equations.actuation, equations.parameters, self.x, self.platform_B),
            call(
                reduced_inertia,
                self._joint_inertia,
                robot.platform_index,
                robot.arm_index,
                self.N,
                self.platform_B,
                self.M,
                self.B,
            ),
        ]

    def bias_steps(self) -> list[Call]:
        """The bias, after :meth:`velocity_steps` and :meth:`run_dynamics`."""
        robot = self._robot
        return [
            call(
                reduced_bias,
                self._joint_inertia,
                self._nonlinear,
                robot.platform_index,
                robot.arm_index,
                self.N,
                self.C_dot_z,
                self.bias,
            )
        ]

    def tip_steps(self) -> list[Call]:
        """Tip position, Jacobian and rate, after :meth:`velocity_steps`, :meth:`run_jacobians`."""
        robot = self._robot
        return [
            call(
                tip_position, self._tip_rotation, self._tip_translation, robot.tip_offset, self.tip
            ),
            call(
                tip_kinematics,
                self._joint_jacobian,
                self._joint_jacobian_rate,
                robot.tip_chain,
                self.tip,
                self.q_dot,
                self.tip_jacobian,
                self.tip_jacobian_rate,
            ),
        ]
