"""Torques on the motors' axes besides their own: disturbances, D = -B d in (17), friction, and stops at
the joints' limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.errors import SpecError
from mobman.linalg import apply_transpose, dot, solve
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.pieces import Each, Piece, Setting, checked, some_given, types_of

Torque = Callable[[float], Array]
"""Disturbance torque on the motors' axes at time t (N m, N), shape (nz,)."""

disturbances = types_of("disturbance type", "mobman.disturbances")
"""Types of disturbances; each starts as a :data:`Torque`."""

_TONES = 64
_SAMPLES = 64
_FINE = 0.5  # of a stop's own time constant: an integration step in contact
_FASTEST = 3000.0  # rad/s: a stop that swings faster would take steps of a few microseconds


class Amplitude(Piece):
    """Strength of a torque: exactly one of the two, a number for all motors or one for each."""

    torque: Each | None = None
    """N m, N."""
    acceleration: Each | None = None
    """rad/s^2, m/s^2: the torque is what gives each motor's axis this acceleration at rest, so that
    a scenario means the same to a light wrist and to a heavy base."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        return some_given(self, "torque", "acceleration", most=1)

    def torques(self, inertia: Array) -> Array:
        """The amplitude on every motor's axis (N m, N), by the effective inertia at each motor (kg m^2,
        kg), shapes (nz,); SpecError if a list has not one entry for each motor."""
        value = self.acceleration if self.torque is None else self.torque
        if isinstance(value, list) and len(value) != len(inertia):
            raise SpecError(
                f"the amplitude has {len(value)} entries; the robot has {len(inertia)} "
                "motors: give one number, or one for each"
            )
        return np.asarray(value, dtype=float) * (
            inertia if self.torque is None else np.ones_like(inertia)
        )


@disturbances.register("constant")
class Constant(Amplitude):
    """The amplitude on every motor's axis, from the start on."""

    def start(self, setting: Setting) -> Torque:
        torque = self.torques(setting.inertia)
        return lambda t: torque


@disturbances.register("growing")
class Growing(Amplitude):
    """Amplitude times (t / ``time``)^``power`` on every motor's axis, its sign at random.

    The bounds of D and D' in (18) may depend on time and need be finite at each time only: this is a
    D that no constant bounds.
    """

    time: float = Field(gt=0)
    """Time at which the amplitude is reached (s)."""
    power: float = Field(1.0, ge=1)
    """At least 1, since D' has to be bounded at the start too."""

    def start(self, setting: Setting) -> Torque:
        amplitude = self.torques(setting.inertia)
        torque = amplitude * setting.random.choice([-1.0, 1.0], len(amplitude))
        # NumPy's power is infinite where Python's is an error
        return lambda t: torque * np.float64(t / self.time) ** self.power


@disturbances.register("noise")
class BandNoise(Amplitude):
    """The sum of 64 sinusoids, one at random in each 64th of the ``band``, phases at random: the
    amplitude is its root mean square, on every motor's axis its own noise.

    By the central limit theorem nearly Gaussian; a function of time alone, so that the steps within an
    integration see one and the same noise.
    """

    band: Annotated[list[float], Field(min_length=2, max_length=2)]
    """Lowest and highest frequency (Hz)."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not 0.0 <= self.band[0] < self.band[1]:
            raise ValueError("'band' is the lowest and the highest frequency (Hz), 0 <= low < high")
        return self

    def start(self, setting: Setting) -> Torque:
        random, (low, high) = setting.random, self.band
        tone = self.torques(setting.inertia) * math.sqrt(2.0 / _TONES)
        where = np.arange(_TONES) + random.uniform(0.0, 1.0, (len(tone), _TONES))
        rate = 2.0 * math.pi * (low + (high - low) / _TONES * where)
        phase = random.uniform(0.0, 2.0 * math.pi, (len(tone), _TONES))
        return lambda t: np.asarray(tone * np.sin(rate * t + phase).sum(axis=1))


@disturbances.register("sinusoid")
class Sinusoid(Amplitude):
    """Amplitude times sin(2 pi ``frequency`` t + phase) on every motor's axis, phases at random."""

    frequency: float = Field(gt=0)
    """Hz."""

    def start(self, setting: Setting) -> Torque:
        torque = self.torques(setting.inertia)
        phase = setting.random.uniform(0.0, 2.0 * math.pi, len(torque))
        rate = 2.0 * math.pi * self.frequency
        return lambda t: np.asarray(torque * np.sin(rate * t + phase))


@disturbances.register("steps")
class RandomSteps(Amplitude):
    """Levels at random between minus and plus the amplitude, a new one on every motor's axis at each
    ``interval``; 0 before the first."""

    interval: float = Field(ge=1e-3)
    """s."""

    def start(self, setting: Setting) -> Torque:
        torque, random = self.torques(setting.inertia), setting.random
        levels = [np.zeros(len(torque))]

        def at(t: float) -> Array:
            index = int(t / self.interval + 1e-9)
            while len(levels) <= index:  # drawn in order, so the sequence depends on the seed alone
                levels.append(torque * random.uniform(-1.0, 1.0, len(torque)))
            return levels[index]

        return at


# Friction ---------------------------------------------------------------------------------------------


class Resistance(NamedTuple):
    """Friction of one run on what moves at the rates ``share`` times those of the motors' axes."""

    share: Array
    """Shape (n, nz)."""
    damping: Array
    """Friction over the rate (N m s, N s/m), shape (n,)."""
    dry: Array
    """Friction at a rate well above ``velocity`` (N m, N), shape (n,)."""
    velocity: float
    """Rate at which 76 % of ``dry`` is reached (rad/s, m/s)."""

    def entry(self, rate: Array, torque: Array) -> Callable[[], None]:
        """A function that subtracts the friction from torques on the axes (N m, N), by the axes' rates
        B^T z (rad/s, m/s); shapes (nz,), both read in place."""
        return bind(_brake, *self, rate, torque)

    @property
    def slope(self) -> Array:
        """The largest derivative of each axis' friction by its rate (N m s, N s/m), shape (nz,)."""
        share, steepest = np.abs(self.share), self.damping + self.dry / self.velocity
        return np.asarray(share.T @ (steepest * share.sum(axis=1)))


frictions = types_of("friction type", "mobman.friction")
"""Types of friction; each starts as a :class:`Resistance`, or None."""

_Brake = Annotated[Each, checked("must not be negative: friction brakes", zero=True)]


class FrictionLevel(Amplitude):
    """Strength of a friction: an amplitude that is not negative."""

    torque: _Brake | None = None
    """N m, N."""
    acceleration: _Brake | None = None
    """rad/s^2, m/s^2: the torque is what gives each motor's axis this acceleration at rest, so that
    a scenario means the same to a light wrist and to a heavy base."""


@frictions.register("coulomb")
class Coulomb(FrictionLevel):
    """The amplitude against the motion, as amplitude x tanh(rate / ``velocity``).

    The sign function has no solution that an integrator could follow through 0; this has, and an axis
    under less than the amplitude creeps where a real one would stick.
    """

    velocity: float = Field(0.05, gt=0)
    """Rate at which 76 % of the amplitude is reached (rad/s, m/s)."""

    def start(self, setting: Setting) -> Resistance:
        level = self.torques(setting.inertia)
        return Resistance(np.eye(len(level)), np.zeros_like(level), level, self.velocity)


@frictions.register("viscous")
class Viscous(FrictionLevel):
    """The amplitude is that at 1 rad/s (1 m/s)."""

    def start(self, setting: Setting) -> Resistance:
        slope = self.torques(setting.inertia)
        return Resistance(np.eye(len(slope)), slope, np.zeros_like(slope), 1.0)


@frictions.register("urdf")
class UrdfFriction(Piece):
    r"""``<dynamics damping="b" friction="c">`` of every joint that moves.

    A joint of rate :math:`\dot q_i` is braked by
    :math:`b_i\dot q_i + c_i\tanh(\dot q_i/\mathrm{velocity})`. The rates are
    :math:`\dot q = C B^{-T}r` for the motors' axes' rates :math:`r = B^T z`, so that the axes are braked
    by :math:`B^{-1}C^T` times that; C and B are those at rest, which are constant but for the wheels of
    a car, whose share in its speed depends on the steering.
    """

    factor: float = Field(1.0, ge=0)
    """Multiplies what the URDF states."""
    velocity: float = Field(0.05, gt=0)
    """Rate at which 76 % of ``friction`` is reached (rad/s, m/s)."""

    def start(self, setting: Setting) -> Resistance | None:
        robot, velocity = setting.robot, self.velocity
        moved = [i for i, n in enumerate(robot.joint_names) if n not in robot.platform.base_joints]
        damping = self.factor * robot.model.damping[moved]
        dry = self.factor * robot.model.upperDryFrictionLimit[moved]
        if not np.any(damping) and not np.any(dry):
            return None
        C = robot.velocity_map(robot.q_rest)
        B = C.T @ robot.actuation(robot.q_rest)
        share = np.ascontiguousarray(C[moved] @ np.linalg.inv(B).T)
        return Resistance(share, damping, dry, velocity)


@kernel
def _brake(
    share: Matrix, damping: Vector, dry: Vector, velocity: float, rate: Vector, torque: Vector
) -> None:
    for i in range(share.shape[0]):
        own = dot(share[i], rate)
        braked = damping[i] * own + dry[i] * math.tanh(own / velocity)
        for j in range(rate.shape[0]):
            torque[j] -= share[i, j] * braked


# Stops ------------------------------------------------------------------------------------------------

stops = types_of("stop type")
"""Types of stops; each starts as a :class:`Contact`, or None."""


class Contact(NamedTuple):
    """Stops of one run, on the coordinates q: their places (rad, m), -inf and inf where there is none,
    stiffness (N m/rad, N/m) and damping (N m s/rad, N s/m), shapes (nq,), and the longest integration
    step while a coordinate is beyond (s)."""

    lower: Array
    upper: Array
    stiffness: Array
    damping: Array
    step: float

    def entry(self, now: Buffers, torque: Array) -> Callable[[], int]:
        """A function that adds the stops' forces to the torques of the motors' axes, shape (nz,), once
        B and q' of a state are in the robot's buffers."""
        nz = torque.size
        work = np.zeros(self.lower.size), np.zeros(nz), np.zeros(nz), np.zeros((nz, nz))
        return bind(_press, self, now.q, now.q_dot, now.C, now.B, torque, *work)

    def near(self, q: Array, q_dot: Array, h: float) -> bool:
        """True if a coordinate is beyond its limit, or will be within h (s)."""
        ahead = q + h * q_dot
        return bool(
            (np.minimum(q, ahead) < self.lower).any() or (np.maximum(q, ahead) > self.upper).any()
        )


@stops.register("joint-limits")
class JointLimits(Piece):
    r"""A spring and a damper at each position limit of the URDF, which only push:
    :math:`\max(0, k\,d + c\,\dot d)` at a depth d > 0, so that no stop gives more energy than it took.

    They are as stiff as ``frequency`` with the least inertia that the joint has anywhere within its
    limits, and stiff enough to hold the joint's own motor within ``depth``, up to 3000 rad/s.
    """

    frequency: float = Field(300.0, gt=0)
    """Least natural frequency on the stop (rad/s)."""
    depth: float = Field(2e-3, gt=0)
    """Depth to which the motor's largest torque presses the joint in at rest (rad, m); where the URDF
    states one."""
    damping: float = Field(1.0, ge=0)
    """Damping ratio: 1 is critical."""

    def start(self, setting: Setting) -> Contact | None:
        robot, limits = setting.robot, setting.robot.limits
        lower, upper, inertia = limits.lower, limits.upper, least_inertia(robot)
        stopped = (np.isfinite(lower) | np.isfinite(upper)) & np.isfinite(inertia)
        if not stopped.any():
            return None
        inertia[~stopped] = 1.0
        torque = np.zeros(robot.nq)  # of what moves by a motor of its own
        torque[robot.arm_index] = limits.torque[robot.n_alpha :]
        stiffness = self.frequency**2 * inertia
        held = np.isfinite(torque)
        stiffness[held] = np.maximum(stiffness[held], torque[held] / self.depth)
        stiffness = np.where(stopped, np.minimum(stiffness, _FASTEST**2 * inertia), 0.0)
        damping = 2.0 * self.damping * np.sqrt(stiffness * inertia)
        # of critical damping both roots are the frequency; of more, the faster is about twice as much
        rate = max(1.0, 2.0 * self.damping) * np.sqrt(stiffness / inertia).max()
        return Contact(lower, upper, stiffness, damping, _FINE / float(rate))


def least_inertia(robot: MobileManipulator) -> Array:
    """Least inertia that each coordinate has when it alone is pushed (kg m^2, kg), shape (nq,).

    1/(C M^-1 C^T)_ii over configurations within the limits; inf for a coordinate that does not move.
    """
    random, limits = np.random.default_rng(0), robot.limits
    low = np.maximum(limits.lower, robot.q_rest - np.pi)
    high = np.minimum(limits.upper, robot.q_rest + np.pi)
    mobility = np.zeros(robot.nq)
    for sample in range(_SAMPLES + 1):
        q = random.uniform(low, high) if sample else robot.q_rest
        C, M = robot.velocity_map(q), robot.dynamics(q, np.zeros(robot.nz)).M
        np.maximum(mobility, np.einsum("ij,ji->i", C, np.linalg.solve(M, C.T)), out=mobility)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / mobility)


@kernel
def _press(
    at: Contact,
    q: Vector,
    q_dot: Vector,
    C: Matrix,
    B: Matrix,
    torque: Vector,
    force: Vector,
    reduced: Vector,
    added: Vector,
    work: Matrix,
) -> int:
    """torque += B^-1 C^T f with f of the stops; the last four are work space."""
    lower, upper, k, c, touching = at.lower, at.upper, at.stiffness, at.damping, False
    for i in range(q.shape[0]):
        force[i] = 0.0
        if q[i] > upper[i]:
            force[i] = -max(0.0, k[i] * (q[i] - upper[i]) + c[i] * q_dot[i])
        elif q[i] < lower[i]:
            force[i] = max(0.0, k[i] * (lower[i] - q[i]) - c[i] * q_dot[i])
        touching = touching or force[i] != 0.0
    if not touching:
        return 0
    apply_transpose(C, force, reduced)
    status = solve(B, reduced, added, work)
    for i in range(torque.shape[0]):
        torque[i] += added[i]
    return status
