"""The plant: the true robot under its disturbances."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mobman.arrays import Array, Index, Matrix, Vector
from mobman.errors import SingularityError, SpecError
from mobman.kernels import cholesky
from mobman.kernels.dense import apply, apply_transpose, copy, dot
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, Program, call, program
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.workspace import Workspace
from mobman.simulation.disturbances import Torque
from mobman.simulation.friction import Resistance
from mobman.simulation.sensors import pose_index
from mobman.simulation.slip import Slip

_factor, _solve = cholesky.factor, cholesky.solve

_LARGEST_DECAY = 2.5
"""Longest Runge-Kutta step, in time constants of the friction; it is stable to 2.78."""

NOT_DEFINITE = 3
"""Status: the plant's inertia is not positive definite."""


class Plant:
    """The plant: M z' + Pz + G + D = B v (17) with the true inertias.

    Args:
        robot: The true robot.
        disturbance: Torque added to the motors', D = -B d; none by default.
        friction: On the motors' axes; they add up.
        slip: Of the platform, if it has a pose; they add up.

    Attributes:
        now: The robot's matrices at the state.
        v: The motors' torque that acts, shape (nz,).
        disturbed: Whether there is a disturbance.
        slips: Whether q' is not C z alone. The slip moves the platform and nothing else: (17) is that
            of rolling, and nothing in it depends on where a platform is on a floor.
    """

    def __init__(
        self,
        robot: MobileManipulator,
        disturbance: Torque | None = None,
        friction: Sequence[Resistance] = (),
        slip: Sequence[Slip] = (),
    ) -> None:
        self.robot = robot
        self.now = Workspace(robot)
        self.v = np.zeros(robot.nz)
        self.disturbed = disturbance is not None
        self._disturbance = disturbance
        self._external = self._d = np.zeros(robot.nz)
        if friction:
            self._d = np.zeros(robot.nz)  # that of now: the external one less friction
        self._rate = np.zeros(robot.nz)
        self._slope = sum(part.slope for part in friction)
        self._friction = [part.step(self._rate, self._d) for part in friction]
        self._base = np.array(pose_index(robot), dtype=np.int64)
        self._pose, self._rolling, self._slipping = place = np.zeros((3, 3))
        self._slip = [step(*place) for step in slip] if len(self._base) else []
        self.slips = bool(self._slip)
        self._lower = np.zeros((robot.nz, robot.nz))
        self._z_dot = np.zeros(robot.nz)
        self._acceleration: Program | None = None
        self._velocity = program(self.now.velocity_steps())

    def disturb(self, t: float) -> None:
        """Let the disturbance of time t (s) act."""
        if self._disturbance is not None:
            self._external[:] = self._disturbance(t)

    def friction_decay(self, q: Array) -> float:
        """The fastest rate at which friction alone slows a motion at q (1/s); 0 if there is none."""
        if not self._friction:
            return 0.0
        m, _, b = self.robot.dynamics(q, np.zeros(self.robot.nz))
        rates = np.linalg.eigvals(np.linalg.solve(m, b @ np.diag(self._slope) @ b.T))
        return float(np.abs(rates).max())

    def require_followed(self, q: Array, h: float) -> None:
        """
        Args:
            q: Where the run starts, shape (nq,).
            h: Length of an integration step (s).

        Raises:
            SpecError: If friction is too steep to be integrated in steps of h.
        """
        decay = self.friction_decay(q)
        if not decay * h <= _LARGEST_DECAY:
            raise SpecError(
                f"friction slows a motion of {self.robot.name!r} at up to {decay:.3g} 1/s, which steps "
                f"of {h:g} s cannot follow (at most {_LARGEST_DECAY / h:g} 1/s): make it weaker, or "
                "the 'velocity' of Coulomb friction larger"
            )

    def dynamics_steps(self) -> list[Call]:
        """M, its factor, bias and B, after the workspace's velocity steps and ``run_dynamics``."""
        now = self.now
        return [
            *now.inertia_steps(),
            *now.bias_steps(),
            call(_factorise, now.M, self._lower),
        ]

    def friction_steps(self) -> list[Call]:
        """The friction at the state, after the dynamics' steps; none if there is none."""
        if not self._friction:
            return []
        return [
            # the axes' rates B^T z: by them the motors' torques v have the power z^T B v
            call(apply_transpose, self.now.B, self.now.z, self._rate),
            call(copy, self._external, self._d),
            *self._friction,
        ]

    def motion_steps(self, q_dot: Array) -> list[Call]:
        """The true q', shape (nq,): C z, and the slip; after the workspace's velocity steps."""
        steps = [call(copy, self.now.q_dot, q_dot)]
        if self._slip:
            place = (self._pose, self._rolling, self._slipping)
            steps += [
                call(_look_at_pose, self._base, self.now.q, self.now.q_dot, *place),
                *self._slip,
                call(_add_slip, self._base, self._slipping, q_dot),
            ]
        return steps

    def acceleration_step(self, z_dot: Array, power: Array) -> Call:
        """z' of (20) under the torques that act, and their power, after those of the friction.

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
        if self._acceleration is None:
            self._acceleration = program(
                [
                    *self.dynamics_steps(),
                    *self.friction_steps(),
                    self.acceleration_step(self._z_dot, np.zeros(1)),
                ]
            )
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


@kernel
def _look_at_pose(
    index: Index, q: Vector, q_dot: Vector, pose: Vector, rolling: Vector, slipping: Vector
) -> None:
    """The pose and its rate by rolling; no slip yet."""
    for i in range(index.shape[0]):
        pose[i] = q[index[i]]
        rolling[i] = q_dot[index[i]]
        slipping[i] = 0.0


@kernel
def _add_slip(index: Index, slipping: Vector, q_dot: Vector) -> None:
    for i in range(index.shape[0]):
        q_dot[index[i]] += slipping[i]
