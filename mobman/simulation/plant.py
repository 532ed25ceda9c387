"""The plant: the true robot under its disturbances."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from mobman.arrays import Array, Matrix, Vector
from mobman.errors import SingularityError, SpecError
from mobman.kernels import cholesky
from mobman.kernels.dense import apply, copy, dot
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, Program, call, program
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.workspace import Workspace
from mobman.simulation.disturbances.disturbance import Torque
from mobman.simulation.friction.friction import Resistance, rate_step
from mobman.simulation.sensors.sensor import pose_index
from mobman.simulation.slip.slip import add_step, begin_step

_factor, _solve = cholesky.factor, cholesky.solve

_LARGEST_DECAY = 2.5
"""What Runge-Kutta's step may be at most, in time constants of the friction; it is stable to 2.78."""

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
        slips: Whether q' is not C z alone. The slip moves the platform and nothing else: (17) is that
            of rolling, and nothing in it depends on where a platform is on a floor.
    """

    def __init__(self, robot: MobileManipulator, disturbance: Torque | None = None) -> None:
        self.robot = robot
        self.now = Workspace(robot)
        self.v = np.zeros(robot.nz)
        self.disturbed = disturbance is not None
        self.slips = False
        self._disturbance = disturbance
        self._external = self._d = np.zeros(robot.nz)
        self._rate = np.zeros(robot.nz)
        self._friction: list[Resistance] = []
        self._base = np.array(pose_index(robot), dtype=np.int64)
        self._pose, self._rolling, self._slipping = np.zeros((3, 3))
        self._slip: list[Call] = []
        self._lower = np.zeros((robot.nz, robot.nz))
        self._z_dot = np.zeros(robot.nz)
        self._acceleration: Program | None = None
        self._velocity = program(self.now.velocity_steps())

    def resist(self, friction: Callable[[Array, Array], Resistance]) -> None:
        """Add a friction; before any steps are asked for.

        Args:
            friction: Makes it from the axes' rates and the torques to subtract from, see
                :class:`mobman.simulation.friction.friction.Friction`.
        """
        if not self._friction:
            self._d = np.zeros_like(self._external)  # that of now: the external one less friction
        self._friction.append(friction(self._rate, self._d))

    def slide(self, slip: Callable[[Array, Array, Array], Call | None]) -> None:
        """Add a slip, if the platform has a pose; before any steps are asked for.

        Args:
            slip: Makes it from the pose, its rate and the slip to add to, see
                :class:`mobman.simulation.slip.slip.Slip`.
        """
        step = slip(self._pose, self._rolling, self._slipping)
        if step is not None and len(self._base):
            self._slip.append(step)
            self.slips = True

    def disturb(self, t: float) -> None:
        """Let the disturbance of time t (s) act."""
        if self._disturbance is not None:
            self._external[:] = self._disturbance(t)

    def friction_decay(self, q: Array) -> float:
        """The fastest rate at which friction alone slows a motion at q (1/s); 0 if there is none."""
        if not self._friction:
            return 0.0
        m, _, b = self.robot.dynamics(q, np.zeros(self.robot.nz))
        slope = sum(part.slope for part in self._friction)
        rates = np.linalg.eigvals(np.linalg.solve(m, b @ np.diag(slope) @ b.T))
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
            rate_step(self.now.B, self.now.z, self._rate),
            call(copy, self._external, self._d),
            *(part.step for part in self._friction),
        ]

    def motion_steps(self, q_dot: Array) -> list[Call]:
        """The true q', shape (nq,): C z, and the slip; after the workspace's velocity steps."""
        steps = [call(copy, self.now.q_dot, q_dot)]
        if self._slip:
            place = (self._pose, self._rolling, self._slipping)
            steps += [
                begin_step(self._base, self.now.q, self.now.q_dot, *place),
                *self._slip,
                add_step(self._base, self._slipping, q_dot),
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
