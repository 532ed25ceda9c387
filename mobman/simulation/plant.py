"""The plant: the true robot under its disturbances."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from mobman.arrays import Array, Columns, Index, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.errors import SingularityError, SpecError
from mobman.linalg import apply, apply_transpose, cholesky, cholesky_solve, dot
from mobman.model.dynamics import Buffers, reduced_bias, reduced_inertia
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.platforms.platform import ArmJoints
from mobman.simulation.disturbances import Contact, Resistance, Torque
from mobman.simulation.pieces import Piece, Setting, some_given, types_of
from mobman.simulation.sensors import pose_index

_LARGEST_DECAY = 2.5
"""Longest Runge-Kutta step, in time constants of the friction; it is stable to 2.78."""
_SHORTEST_STEP = 2e-5
"""Integration step (s) that steep friction may ask for: fifty a millisecond."""

Slip = Callable[[Array, Array, Array], Callable[[], None]]
"""Gives a function that adds to the third: the pose (x1, x2, theta) (m, m, rad), its rate if the wheels
roll (the pose's part of C z), and its rate by slip; shapes (3,), read in place."""
slips = types_of("slip type", "mobman.slip")
"""Types of slip; each starts as a :data:`Slip`, or None."""
NOT_DEFINITE = 3
"""Status: the plant's inertia is not positive definite."""


class Forces(NamedTuple):
    """Terms of z' in (17): L of M = L L^T, the sum d of what acts on the motors' axes besides v, with
    D = -B d, and the total v + d."""

    lower: Matrix
    bias: Vector
    B: Matrix
    v: Vector
    d: Vector
    z: Vector
    total: Vector


class Plant:
    """The plant: M z' + Pz + G + D = B v (17) with the true inertias.

    Args:
        robot: The true robot.
        disturbance: Torque added to the motors', D = -B d; none by default.
        friction: On the motors' axes; they add up.
        slip: Of the platform, if it has a pose; they add up.
        stops: At limits of the joints; they add up.

    Attributes:
        now: The robot's matrices at the state.
        v: The motors' torque that acts, shape (nz,).
        q_dot: The true q', shape (nq,): C z and the slip.
        forces: What acts at the state.
        disturbed: Whether :meth:`disturb` changes anything.
        slips: Whether q' is not C z alone. The slip moves the platform and nothing else: (17) is that
            of rolling, and nothing in it depends on where a platform is on a floor.
    """

    def __init__(
        self,
        robot: MobileManipulator,
        disturbance: Torque | None = None,
        friction: Sequence[Resistance] = (),
        slip: Sequence[Slip] = (),
        stops: Sequence[Contact] = (),
    ) -> None:
        self.robot, nz = robot, robot.nz
        self.now = now = Buffers(robot)
        self.v, self._longest = np.zeros(nz), math.inf
        self._disturbance, self._friction, self._stops = disturbance, friction, stops
        self.disturbed = disturbance is not None
        self._slip = slip if robot.platform.base_joints else ()
        self.slips = bool(self._slip)
        self.q_dot = np.zeros(robot.nq) if self.slips else now.q_dot
        self._external = d = np.zeros(nz)
        if friction or stops:
            d = np.zeros(nz)  # that of now: the external one less friction, and the stops'
        self.forces = Forces(np.zeros((nz, nz)), now.bias, now.B, self.v, d, now.z, np.zeros(nz))
        self._z_dot, self._power = np.zeros(nz), np.zeros(1)

    def disturb(self, t: float) -> None:
        """Let the disturbance of time t (s) act."""
        if self._disturbance is not None:
            self._external[:] = self._disturbance(t)

    def friction_decay(self, q: Array) -> float:
        """The fastest rate at which friction alone slows a motion at q (1/s); 0 if there is none."""
        if not self._friction:
            return 0.0
        m, _, b = self.robot.dynamics(q, np.zeros(self.robot.nz))
        slope = np.diag(sum(part.slope for part in self._friction))
        rates = np.linalg.eigvals(np.linalg.solve(m, b @ slope @ b.T))
        return float(np.abs(rates).max())

    def longest_step(self, h: float) -> float:
        """The longest integration step from the state on (s): h, or less where friction is steep, or a
        joint at a stop."""
        if not self._stops:
            return min(h, self._longest)
        now = self.now
        near = [part.step for part in self._stops if part.near(now.q, now.q_dot, h)]
        return min(h, self._longest, *near)

    def follow_friction(self, q: Array, h: float) -> None:
        """Take steps that follow the friction, from q on, shape (nq,), instead of h (s).

        Raises:
            SpecError: If friction is too steep to be integrated in steps that are worth their time.
        """
        decay = self.friction_decay(q)
        if decay * h <= _LARGEST_DECAY:
            return
        # inertias, and with them the decay, change on the way
        self._longest = 0.5 * _LARGEST_DECAY / decay
        if not self._longest >= _SHORTEST_STEP:
            raise SpecError(
                f"friction slows a motion of {self.robot.name!r} at up to {decay:.3g} 1/s, which steps "
                f"of {_SHORTEST_STEP:g} s cannot follow (at most "
                f"{0.5 * _LARGEST_DECAY / _SHORTEST_STEP:g} 1/s): make it weaker, the 'velocity' of dry "
                "friction larger, or the inertia of what it brakes what it is with its motor's"
            )

    def accelerations(self, z_dot: Array) -> list[Callable[[], Any]]:
        """Entries that fill z' of the state and the torque, shape (nz,), after ``run_dynamics``."""
        return [self.dynamics, bind(accelerate, self.forces, z_dot, np.zeros(1))]

    def signals(self) -> dict[str, Array]:
        """Signals of the plant that a run records at every tick, by name; overwritten in place."""
        return {}

    def own_state(self, q: Array, h: float) -> Any:
        """Its state at rest at q where it is not integrated by
        :class:`mobman.simulation.integrator.RungeKutta`, with that class's interface; else None."""
        return None

    @cached_property
    def dynamics(self) -> Callable[[], int]:
        """Fills M, its factor, bias, B and what friction there is, after the buffers' ``velocity`` and
        ``run_dynamics``. NOT_DEFINITE if M is not positive definite."""
        now, robot = self.now, self.robot
        dynamics = bind(
            _dynamics,
            *(now.joint_inertia, now.nonlinear, robot.platform_index, robot.arm),
            *(now.N, now.platform_B, now.C_dot_z, now.M, now.B, now.bias, self.forces.lower),
        )
        return sequence(dynamics, *self.resistances(), join=False)

    def resistances(self) -> list[Callable[[], Any]]:
        """Entries that add friction and stops to the disturbance, once B is there; none without."""
        if not self._friction and not self._stops:
            return []
        # the axes' rates B^T z: by them the motors' torques v have the power z^T B v
        now, d, rate = self.now, self.forces.d, np.zeros(self.robot.nz)
        return [
            bind(apply_transpose, now.B, now.z, rate),
            partial(np.copyto, d, self._external),
            *(part.entry(rate, d) for part in self._friction),
            *(part.entry(now, d) for part in self._stops),
        ]

    @cached_property
    def motion(self) -> Callable[[], int]:
        """Fills the true q', after the buffers' ``velocity``; where the platform slips."""
        index = np.array(pose_index(self.robot), dtype=np.int64)
        place = pose, rolling, slipping = np.zeros((3, 3))
        return sequence(
            bind(_look_at_pose, index, self.now.q, self.now.q_dot, *place),
            *(entry(pose, rolling, slipping) for entry in self._slip),
            bind(_add_slip, index, slipping, self.now.q_dot, self.q_dot),
            join=False,
        )

    def acceleration(self, t: float, q: Array, z: Array, torque: Array) -> Array:
        """z' of (20) at time t and state (q, z) under a torque, shape (nz,).

        Raises:
            SingularityError: If M is not positive definite.
        """
        now = self.now
        now.q[:], now.z[:], self.v[:] = q, z, torque
        self.disturb(t)
        now.velocity()
        now.run_dynamics()
        require_success(self.dynamics())
        accelerate(self.forces, self._z_dot, self._power)
        return self._z_dot.copy()


MakePlant = Callable[..., Plant]
"""Makes a plant, with the arguments of :class:`Plant`."""

plants = types_of("plant", "mobman.plants")
"""Types of plants; each starts as a :data:`MakePlant`."""


class Ideal(Piece):
    """Wheels that roll and do nothing else: (17), integrated by Runge-Kutta."""

    def start(self, setting: Setting) -> MakePlant:
        return Plant


class Longitudinal(Piece):
    """All wheels slip by one ratio: the platform drives and turns at 1 - ``ratio`` of what they
    roll."""

    ratio: float = Field(gt=-1, lt=1)
    """(R omega - v)/(R omega); negative where the wheels slide, as in braking."""

    def start(self, setting: Setting) -> Slip | None:
        ratio = self.ratio
        if not ratio:
            return None
        return lambda pose, rolling, slipping: bind(_longitudinal, ratio, rolling, slipping)


class Lateral(Piece):
    """A velocity across the heading, to the left."""

    angle: float | None = Field(None, gt=-1.5, lt=1.5)
    """Slip angle (rad): tan(angle) of the velocity along the heading."""
    velocity: float | None = None
    """m/s, also at rest: as on a slope."""

    @model_validator(mode="after")
    def _given(self) -> Self:
        some_given(self, "angle", "velocity")
        return self

    def start(self, setting: Setting) -> Slip | None:
        tangent, velocity = math.tan(self.angle or 0.0), self.velocity or 0.0
        if tangent == velocity == 0.0:
            return None
        return lambda *arrays: bind(_lateral, tangent, velocity, *arrays)


def require_success(status: int) -> None:
    """
    Raises:
        SingularityError: If a step failed because M is not positive definite.
    """
    if status:
        raise SingularityError("the plant's inertia M is not positive definite", "M")


@kernel
def _dynamics(
    inertia: Columns,
    nonlinear: Vector,
    platform_index: Index,
    arm: ArmJoints,
    N: Matrix,
    platform_B: Matrix,
    C_dot_z: Vector,
    M: Matrix,
    B: Matrix,
    bias: Vector,
    lower: Matrix,
) -> int:
    """M, B and Pz + G of (17), and the factor of M; not a number if M is not, so that a state that has
    diverged shows as that."""
    reduced_inertia(inertia, platform_index, arm, N, platform_B, M, B)
    reduced_bias(inertia, nonlinear, platform_index, arm, N, C_dot_z, bias)
    if cholesky(M, lower) == 0:
        return 0
    for i in range(M.shape[0]):
        for j in range(i + 1):
            if not math.isfinite(M[i, j]):
                lower[0, 0] = math.nan
                return 0
    return NOT_DEFINITE


@kernel
def accelerate(at: Forces, z_dot: Vector, power: Vector) -> None:
    """M z' = B (v + d) - (Pz + G) of (17), with D = -B d, and the power z^T (B v - D) (W)."""
    for i in range(z_dot.shape[0]):
        at.total[i] = at.v[i] + at.d[i]
    apply(at.B, at.total, z_dot)
    power[0] = dot(at.z, z_dot)
    for i in range(z_dot.shape[0]):
        z_dot[i] -= at.bias[i]
    cholesky_solve(at.lower, z_dot, z_dot)


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
def _add_slip(index: Index, slipping: Vector, rolling: Vector, q_dot: Vector) -> None:
    """q' = C z and the slip of the pose."""
    for i in range(q_dot.shape[0]):
        q_dot[i] = rolling[i]
    for i in range(index.shape[0]):
        q_dot[index[i]] += slipping[i]


@kernel
def _longitudinal(ratio: float, rolling: Vector, slipping: Vector) -> None:
    for i in range(rolling.shape[0]):
        slipping[i] -= ratio * rolling[i]


@kernel
def _lateral(
    tangent: float, velocity: float, pose: Vector, rolling: Vector, slipping: Vector
) -> None:
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    across = tangent * (cosine * rolling[0] + sine * rolling[1]) + velocity
    slipping[0] -= sine * across
    slipping[1] += cosine * across


slips.register("longitudinal", Longitudinal)
slips.register("lateral", Lateral)
plants.register("ideal", Ideal)
