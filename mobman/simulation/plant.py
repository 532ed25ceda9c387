"""The plant: the true robot under its disturbances."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Matrix, Vector
from mobman.errors import SingularityError
from mobman.kernels import cholesky
from mobman.kernels.dense import apply, dot
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call, program
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.workspace import Workspace
from mobman.simulation.disturbances.disturbance import Torque

_factor, _solve = cholesky.factor, cholesky.solve

NOT_DEFINITE = 3
"""Status: the plant's inertia is not positive definite."""


class Plant:
    """What the controller acts on: M z' + Pz + G + D = B v (17) with the true inertias.

    Args:
        robot: The true robot.
        disturbance: Torque added to the motors', D = -B d; none by default.

    Attributes:
        now: The robot's matrices at the state.
        v: The motors' torque that acts, shape (nz,).
        disturbed: Whether there is a disturbance.
    """

    def __init__(self, robot: MobileManipulator, disturbance: Torque | None = None) -> None:
        self.robot = robot
        self.now = Workspace(robot)
        self.v = np.zeros(robot.nz)
        self.disturbed = disturbance is not None
        self._disturbance = disturbance
        self._d = np.zeros(robot.nz)
        self._lower = np.zeros((robot.nz, robot.nz))
        self._z_dot = np.zeros(robot.nz)
        self._velocity = program(self.now.velocity_steps())
        self._acceleration = program(
            [*self.dynamics_steps(), self.acceleration_step(self._z_dot, np.zeros(1))]
        )

    def disturb(self, t: float) -> None:
        """Let the disturbance of time t (s) act."""
        if self._disturbance is not None:
            self._d[:] = self._disturbance(t)

    def dynamics_steps(self) -> list[Call]:
        """M, its factor, bias and B, after the workspace's velocity steps and ``run_dynamics``."""
        now = self.now
        return [
            *now.inertia_steps(),
            *now.bias_steps(),
            call(_factorise, now.M, self._lower),
        ]

    def acceleration_step(self, z_dot: Array, power: Array) -> Call:
        """z' of (20) under the torques that act, and their power, after the dynamics' steps.

        Args:
            z_dot: For the result, shape (nz,).
            power: For z^T (B v - D) (W), shape (1,).
        """
        now = self.now
        return call(
            _accelerate,
            *(self._lower, now.bias, now.B, self.v, self._d, now.z),
            *(z_dot, power, np.zeros_like(self.v)),
        )

    def acceleration(self, t: float, q: Array, z: Array, torque: Array) -> Array:
        """z' of (20) at time t and state (q, z) under a torque, shape (nz,).

        Raises:
            SingularityError: If M is not positive definite.
        """
        now = self.now
        now.q[:] = q
        now.z[:] = z
        self.v[:] = torque
        self.disturb(t)
        self._velocity()
        now.run_dynamics()
        require_success(self._acceleration())
        return self._z_dot.copy()


def require_success(status: int) -> None:
    """
    Raises:
        SingularityError: If a step failed because M is not positive definite.
    """
    if status:
        raise SingularityError("the plant's inertia M is not positive definite")


@kernel
def _factorise(M: Matrix, lower: Matrix) -> int:
    """The factor of M; not a number if M is not, so that a state that has diverged shows as that."""
    if _factor(M, lower) == 0:
        return 0
    for i in range(M.shape[0]):
        for j in range(i + 1):
            if not math.isfinite(M[i, j]):
                lower[0, 0] = math.nan
                return 0
    return NOT_DEFINITE


@kernel
def _accelerate(
    lower: Matrix,
    bias: Vector,
    B: Matrix,
    v: Vector,
    d: Vector,
    z: Vector,
    z_dot: Vector,
    power: Vector,
    total: Vector,
) -> None:
    """M z' = B (v + d) - (Pz + G) of (17), with D = -B d; the last one is work space, shape (nz,)."""
    for i in range(v.shape[0]):
        total[i] = v[i] + d[i]
    apply(B, total, z_dot)
    power[0] = dot(z, z_dot)
    for i in range(z.shape[0]):
        z_dot[i] -= bias[i]
    _solve(lower, z_dot, z_dot)


def true_robot(
    robot: MobileManipulator,
    mass_factor: float = 1.0,
    inertia_factor: float | None = None,
    payload: float = 0.0,
) -> MobileManipulator:
    """The robot with other inertias; the same object if nothing changes.

    Args:
        robot: The nominal robot.
        mass_factor: Factor of every link's mass.
        inertia_factor: Factor of every link's inertia about its centre of mass; the mass's by default.
        payload: Point mass at the tip (kg).
    """
    turning = mass_factor if inertia_factor is None else inertia_factor
    if mass_factor == 1.0 and turning == 1.0 and payload == 0.0:
        return robot
    model = robot.model.copy()
    for i in range(1, model.njoints):
        link = model.inertias[i]
        model.inertias[i] = pin.Inertia(link.mass * mass_factor, link.lever, link.inertia * turning)
    if payload > 0.0:
        tip = model.frames[robot.tip_frame]
        mass = pin.Inertia(payload, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(tip.parentJoint, mass, tip.placement)
    return robot.with_model(model)
