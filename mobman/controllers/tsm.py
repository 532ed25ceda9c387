"""The terminal sliding mode laws: ``tsm`` (34)-(35) and (55)-(56), ``tsm-simplified`` (43)-(44) and
(55)-(56), ``tsm-inverse-actuation`` (34)-(35) and (65)-(66).

A kinematic stage makes of the task errors a reference acceleration, v_ref' = J^T u_ref; a dynamic
stage makes z' follow v_ref, v' = B^T u or B^-1 u. A tick goes from one to the other, then
advances the integrals of both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import kernel, sequence
from mobman.controllers.bounds import (
    actuation_bound,
    computed_bounds,
    inertia_bound,
    jacobian_bound,
)
from mobman.controllers.damped import Damping, damp
from mobman.controllers.gains import (
    Auto,
    CriterionGains,
    Diagonal,
    NotNegative,
    Positive,
    as_settings,
    at_least_one,
    bound,
    diagonal,
    gain,
    odd_ratio,
    whole,
)
from mobman.controllers.motors import (
    Cap,
    LimitedMotors,
    TorqueLimits,
    automatic_metric_scale,
    cap,
    caps_of,
    hedge,
    plain_limits,
    predict_acceleration,
)
from mobman.controllers.protocol import TaskSpaceLaw, controllers
from mobman.controllers.task_errors import (
    Entry,
    Stop,
    TaskSpace,
    Tracking,
    desired,
    error,
    error_rate,
)
from mobman.controllers.unit_vector import explicit_unit_vector, implicit_unit_vector
from mobman.errors import GainError
from mobman.linalg import apply_transpose, dot, gram, norm, solve
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_MIXED = "mixed, see docs/theory.md"


@dataclass(frozen=True, kw_only=True)
class CascadeGains(CriterionGains):
    """Gains of both stages, and how they are sampled, but for the powers; defaults are the paper's,
    section 4, but for ``a`` and ``A``."""

    Lambda_0: Diagonal = gain(11.0, _MIXED, "Lambda_0 of (51)")
    Lambda_1: Diagonal = gain(6.0, _MIXED, "Lambda_1 of (51)")
    C: Annotated[float, at_least_one("Theorem 2")] = gain(2.0, "1", "C of (55), at least 1")
    C_0: Positive = gain(1.0, "N m/s", "C_0 of (55)")
    A: Annotated[float | Auto, bound("0 < A <= lambda_min(B B^T) (54)")] = gain(
        "auto", "1", "lower bound of lambda_min(B B^T), (54), or A' of (64)"
    )
    w_3: NotNegative = gain(3.0, "rad^-1", "factor of |v||z| in chi, (53)")
    w_4: NotNegative = gain(9.0, "kg m^2", "factor of |z|^3 in chi, (53)")
    w_5: NotNegative = gain(12.0, "N m/rad", "factor of |z| + |z| beta_0 in chi, (53)")
    w_6: NotNegative = gain(0.0, "1", "factor of beta_1 in chi, (53)")
    w_7: NotNegative = gain(
        6.0, "kg m^2", "factor of |Lambda_0 E^a1 + Lambda_1 E'^a2 - v_ref'| in chi, (53)"
    )
    w_8: NotNegative = gain(0.011, "kg m^2", "factor of |z||S| in chi, (53)")
    w_9: NotNegative = gain(6.0, "kg m^2", "factor of |z||z'| in chi, (53)")
    beta_0: NotNegative = gain(0.0, "N m", "bound of |D|, (18)")
    beta_1: NotNegative = gain(0.0, "N m/s", "bound of |D'|, (18)")
    lambda_0: Diagonal = gain(1.0, _MIXED, "lambda_0 of (31)")
    lambda_1: Diagonal = gain(11.0, _MIXED, "lambda_1 of (31)")
    lambda_2: Diagonal = gain(6.0, _MIXED, "lambda_2 of (31)")
    c: Annotated[float, at_least_one("Theorem 1")] = gain(2.0, "1", "c of (34), at least 1")
    c_0: Positive = gain(1.0, "m/s^3", "c_0 of (34)")
    a: Annotated[float | Auto, bound("0 < a <= lambda_min(J J^T) (22)")] = gain(
        "auto", "1", "lower bound of lambda_min(J J^T), (22)"
    )
    w_1: Positive = gain(1.5, "1", "bound of |J|, |dJ/dq|, |d2J/dq2|, (21)")
    w_2: NotNegative = gain(0.001, "rad^-1", "growth of that bound with |q - q_rest|, (21)")
    w_3k: Positive = gain(2.0, "1", "factor of |v_ref||z| in W, (34)")
    w_4k: Positive = gain(3.0, "1", "factor of |z|^3 in W, (34)")
    bounds: Literal["given", "computed"] = gain(
        "given", "", "w_1 to w_9, a and A: given, computed (as `mobman robots bounds`, when reset)"
    )
    discretization: Literal["implicit", "explicit"] = gain(
        "implicit", "", "of the unit vectors: implicit, explicit"
    )
    boundary_layer: NotNegative = gain(
        0.0, "that of s, of S", "width in which s/|s| becomes s/width; 0: none"
    )
    metric_scale: Annotated[float | Auto, bound("it is a factor of an inertia")] = gain(
        "auto", "1", "factor of the nominal M in the implicit form's metric"
    )
    delay_ticks: Annotated[int, whole(0, 100, " of ticks")] | None = gain(
        None, "ticks", "how late torques act, which is predicted; None: not told, and 1 is borne"
    )
    lightest: Positive = gain(
        1.0, "1", "least true inertia over the nominal one, for metric_scale = 'auto'"
    )
    damping: NotNegative = gain(
        0.0, "1", "J J^T is damped below so many times its bound (22), see theory; 0: never"
    )
    saturation: Literal["none", "hedge"] = gain(
        "none", "", "what is done where a motor's limit is reached: none, hedge"
    )
    torque_limits: TorqueLimits = gain(
        None, "N m, N", "limits that the hedge keeps to, by default those that act"
    )
    v_max: Cap = gain(
        None, "m/s, rad/s", "cap on the speed of approach; one number, or one for each unit"
    )
    a_max: Cap = gain(
        None, "m/s^2, rad/s^2", "cap on its acceleration; one number, or one for each unit"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.damping and self.discretization != "implicit":
            raise GainError(
                f"damping = {self.damping!r}: only the implicit form has a damped stage; allowed: 0"
            )


@dataclass(frozen=True, kw_only=True)
class SlidingGains(CascadeGains):
    """Gains of both stages, with the terminal powers."""

    alpha_1: Fraction | float | str = gain("3/5", "1", "n1/n2 of (51), both odd, n1 < n2 < 2 n1")

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "alpha_1", odd_ratio("alpha_1", self.alpha_1))


# The law as the paper has it --------------------------------------------------------------------------

POWERS = {"p_0": 9 / 7, "p_1": 1 / 3, "p_2": 3 / 5}
"""Exponents of (31): of e' and of the bracket in which it stands, and of e''."""
_NUMBERS = ["a", "A", "dt", "alpha_1", "alpha_2", "metric_scale", *POWERS] + [
    one.name
    for one in fields(CascadeGains)
    if type(one.default) is float and one.type != "Diagonal"
]
_FLAGS = ["implicit", "inverse"]
IN_FORCE = np.dtype([*((name, float) for name in _NUMBERS), *((name, bool) for name in _FLAGS)])
"""The gains as the law has them; those that are diagonal are with the stages."""


class SlidingStage(NamedTuple):
    """A sliding variable of p components and its unit vector."""

    s: Vector
    """s of (31), or S of (51)."""
    g: Vector
    """The integrand in it."""
    integral: Vector
    """The integral of g."""
    drift: Vector
    """The part of s' that W, or chi, does not bound."""
    b: Vector
    n: Vector
    """The unit vector; for b, metric, gram and work see :func:`implicit_unit_vector`."""
    gains: Matrix
    """Diagonals: lambda_0 to lambda_2, lambda_0^p_0 and lambda_1^p_2, or Lambda_0 and Lambda_1."""
    caps: Matrix
    """v_max and a_max in (31): of positions and of orientations, inf for none; shape (2, 2)."""
    metric: Matrix
    gram: Matrix
    work: Matrix

    @classmethod
    def of(cls, gains: CascadeGains, p: int, *names: str) -> SlidingStage:
        """A stage with an empty integral, I for the metric, and the named gains.

        Raises:
            GainError: If one of them has another length than p.
        """
        rows = [diagonal(name, getattr(gains, name), p).tolist() for name in names]
        # powers that (31) takes at every tick
        taken = {"lambda_0": powers_of(gains)["p_0"], "lambda_1": powers_of(gains)["p_2"]}
        given = [(row, taken[name]) for row, name in zip(rows, names, strict=True) if name in taken]
        diagonals = np.array(rows + [[x**power for x in row] for row, power in given])
        caps = np.array([caps_of(gains.v_max), caps_of(gains.a_max)])
        square, work = np.zeros((p, p)), np.zeros((p + 2, p))
        s, g, integral, drift, b, n = np.zeros((6, p))
        return cls(s, g, integral, drift, b, n, diagonals, caps, np.eye(p), square, work)


class Held(NamedTuple):
    """Integrals of the law, and their rates over the tick; shapes (nz,)."""

    integral_v_ref: Vector
    v_ref: Vector
    v_ref_dot: Vector
    v: Vector
    v_dot: Vector


@kernel
def kinematic_gain(
    gains: Any, stage: SlidingStage, held: Held, at: Tracking, q_rest: Vector
) -> float:
    """Fill s, g and the drift: c/a (W + c_0) of (34), or of (44) where f and J are the tip's."""
    k, s, g, v_ref, lambda_2 = gains[0], stage.s, stage.g, held.v_ref, stage.gains[2]
    lambda_0_p_0, lambda_1, lambda_1_p_2 = stage.gains[3], stage.gains[1], stage.gains[4]
    # the bracket of (31), with caps on both of its parts that are not there near the target
    bracket, m = stage.b, at.p_d.shape[1]
    for i in range(s.shape[0]):
        bracket[i] = lambda_0_p_0[i] * error(at, i)
    cap(bracket, m, stage.caps[0], k.p_0, lambda_1, 0.0)
    for i in range(s.shape[0]):
        bracket[i] += power(error_rate(at, i), k.p_0)
    cap(bracket, m, stage.caps[1], k.p_2 / k.p_1, lambda_1, k.p_2 / k.p_1)
    for i in range(s.shape[0]):
        # errors of (26), the second derivative along the reference
        e_ddot = dot(at.J[i], v_ref) + at.J_dot_z[i] - desired(at.p_d, 2, i)
        # s and the integrand g in it (31)
        g[i] = lambda_2[i] * power(e_ddot, k.p_2)
        g[i] += lambda_2[i] * lambda_1_p_2[i] * power(bracket[i], k.p_1)
        s[i] = e_ddot + stage.integral[i]
        stage.drift[i] = g[i] - desired(at.p_d, 3, i)
    # W under (34), with the bound of (21)
    size_z, deviation = norm(at.z), 0.0
    for i in range(q_rest.shape[0]):
        deviation += (at.q[i] - q_rest[i]) ** 2
    bound = k.w_1 + k.w_2 * math.sqrt(deviation)
    W = norm(stage.drift) + bound * (k.w_3k * norm(v_ref) * size_z + k.w_4k * size_z**3)
    return float(k.c / k.a * (W + k.c_0))


@kernel
def kinematic_stage(
    gains: Any, stage: SlidingStage, held: Held, at: Tracking, q_rest: Vector
) -> int:
    """v_ref' = J^T u_ref (35) of u_ref (34); (43) of (44) where f and J are the tip's."""
    gain = kinematic_gain(gains, stage, held, at, q_rest)
    gram(at.J, stage.gram)
    # u_ref = -c/a (W + c_0) n (34)
    if not unit_vector(gains[0], stage, gain):
        return Stop.NOT_DEFINITE
    apply_transpose(at.J, stage.n, held.v_ref_dot)
    for i in range(held.v_ref_dot.shape[0]):
        held.v_ref_dot[i] *= -gain
    return 0


@kernel
def damped_stage(
    gains: Any, stage: SlidingStage, held: Held, at: Tracking, q_rest: Vector, own: Damping
) -> int:
    """v_ref' as in :func:`kinematic_stage`, with J J^T + R where J J^T is nearly singular, and y in the
    directions that it leaves, see :mod:`mobman.controllers.damped`."""
    k = gains[0]
    gain = kinematic_gain(gains, stage, held, at, q_rest)
    gram(at.J, stage.gram)
    damp(k.dt, stage.gram, stage.drift, own, held.v_ref, at.J, at.z, at.p_d.shape[1])
    if not unit_vector(k, stage, gain):
        return Stop.NOT_DEFINITE
    apply_transpose(at.J, stage.n, held.v_ref_dot)
    for j in range(at.z.shape[0]):
        held.v_ref_dot[j] = own.y[j] - gain * held.v_ref_dot[j]
    for i in range(stage.s.shape[0]):
        stage.integral[i] -= k.dt * gain * own.R[i] * stage.n[i]  # what R leaves of s
    return 0


@kernel
def dynamic_stage(
    gains: Any, stage: SlidingStage, held: Held, z: Vector, z_dot: Vector, M: Matrix, B: Matrix
) -> int:
    """v' = B^T u (56) of u (55), or B^-1 u (65) of u (66)."""
    k, S, G = gains[0], stage.s, stage.g
    nz, Lambda_0, Lambda_1 = S.shape[0], stage.gains[0], stage.gains[1]
    for i in range(nz):
        E = z[i] - held.integral_v_ref[i]  # (45)
        E_dot = z_dot[i] - held.v_ref[i]
        # S and the integrand G in it (51)
        G[i] = Lambda_0[i] * power(E, k.alpha_1) + Lambda_1[i] * power(E_dot, k.alpha_2)
        S[i] = E_dot + stage.integral[i]
        stage.drift[i] = G[i] - held.v_ref_dot[i]
    # chi under (53)
    size_z = norm(z)
    chi = (
        k.w_3 * norm(held.v) * size_z
        + k.w_4 * size_z**3
        + k.w_5 * (size_z + size_z * k.beta_0)
        + k.w_6 * k.beta_1
        + k.w_7 * norm(stage.drift)
        + k.w_8 * size_z * norm(S)
        + k.w_9 * size_z * norm(z_dot)
    )
    # u = -C/A (chi + C_0) n (55); the inverse takes M^-1 n away from S, the transpose M^-1 B B^T n
    gain = k.C / k.A * (chi + k.C_0)
    if not k.inverse:
        gram(B, stage.gram)
    for i in range(nz):
        for j in range(nz):
            stage.metric[i, j] = k.metric_scale * M[i, j]
            if k.inverse:
                stage.gram[i, j] = 1.0 if i == j else 0.0
    if not unit_vector(k, stage, gain):
        return Stop.NOT_DEFINITE
    if not k.inverse:
        apply_transpose(B, stage.n, held.v_dot)
    elif solve(B, stage.n, held.v_dot, stage.work) != 0:
        return Stop.NO_INVERSE
    for i in range(nz):
        held.v_dot[i] *= -gain
    return 0


@kernel
def unit_vector(k: Any, stage: SlidingStage, gain: float) -> bool:
    """n of a stage, whose ``gram`` is not yet multiplied by dt times the gain; False: no metric."""
    if not k.implicit:
        explicit_unit_vector(stage.s, k.boundary_layer, stage.n)
        return True
    for i in range(stage.s.shape[0]):
        stage.b[i] = stage.s[i] + k.dt * stage.drift[i]
        for j in range(stage.s.shape[0]):
            stage.gram[i, j] *= k.dt * gain
    return implicit_unit_vector(
        stage.metric, stage.gram, stage.b, k.boundary_layer, stage.n, stage.work
    )


@kernel
def integrate(gains: Any, kinematic: SlidingStage, dynamic: SlidingStage, held: Held) -> None:
    """Advance all integrals over the tick, in which v_ref' and v' are constant."""
    dt = gains[0].dt
    for i in range(kinematic.g.shape[0]):
        kinematic.integral[i] += dt * kinematic.g[i]
    for i in range(dynamic.g.shape[0]):
        dynamic.integral[i] += dt * dynamic.g[i]
        held.integral_v_ref[i] += dt * held.v_ref[i] + 0.5 * dt**2 * held.v_ref_dot[i]
        held.v_ref[i] += dt * held.v_ref_dot[i]
        held.v[i] += dt * held.v_dot[i]


@kernel
def power(x: float, exponent: float) -> float:
    """sign(x) |x|^exponent: the paper's odd roots."""
    return math.copysign(math.pow(abs(x), exponent), x)


def powers_of(gains: CascadeGains) -> dict[str, float]:
    """Exponents of (31); all are 1 where the gains have no terminal powers."""
    return POWERS if isinstance(gains, SlidingGains) else dict.fromkeys(POWERS, 1.0)


def metric_scale(gains: CascadeGains) -> float:
    """The factor of M in the metric, also where it is "auto"."""
    if isinstance(gains.metric_scale, str):
        return automatic_metric_scale(gains.delay_ticks, gains.lightest)
    return gains.metric_scale


def in_force(gains: CascadeGains, dt: float, a: float, A: float, inverse: bool) -> Any:
    """The other gains, with the bounds (22) and (54) or (64), shape (1,)."""
    alpha_1 = float(Fraction(gains.alpha_1)) if isinstance(gains, SlidingGains) else 1.0
    values = vars(gains) | powers_of(gains) | {"a": a, "A": A, "dt": dt, "inverse": inverse}
    values |= {"alpha_1": alpha_1, "alpha_2": 2.0 * alpha_1 / (1.0 + alpha_1)}
    values["implicit"] = gains.discretization == "implicit"
    values["metric_scale"] = metric_scale(gains)
    if inverse:  # chi' of (66)
        values |= {"w_7": 1.0, "w_8": 0.0}
    found = np.recarray(1, IN_FORCE)
    found[0] = tuple(values[name] for name in _NUMBERS + _FLAGS)
    return found


# The controllers --------------------------------------------------------------------------------------


@controllers.register("tsm")
class TerminalSlidingMode(LimitedMotors, TaskSpaceLaw):
    """Kinematic stage on the extended Jacobian's transpose, v_ref' = J^T u_ref (34)-(35); dynamic
    stage on the actuation matrix's transpose, v' = B^T u (55)-(56)."""

    name = "tsm"
    Gains: type[CascadeGains] = SlidingGains
    uses: tuple[str, ...] = ("z'", "M", "J'")
    signals_in_place = True
    extended = True
    inverse_actuation = False
    """True if the dynamic stage uses B^-1, (65)-(66)."""

    def __init__(self, gains: CascadeGains) -> None:
        super().__init__(gains)
        self.uses = self.uses_with(self._settings)

    @classmethod
    def uses_with(cls, gains: Mapping[str, Any]) -> tuple[str, ...]:
        """Information that it uses with some gains: the hedge the limits, too."""
        return cls.uses + ("limits",) * (gains.get("saturation") == "hedge")

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again with v = 0, v_ref = 0 and empty integrals; "auto" bounds are found here.

        Raises:
            GainError: If a gain has the wrong length for the robot.
        """
        self.criterion = self.gains.criterion(robot, task)
        gains = self._used = self._with_bounds(robot, task)
        self.begin(self.task_space(robot, task), dt)
        a, A = self._bounds(robot, task)
        K_F = self.criterion.weights.tolist()
        self._settings = as_settings(gains) | {"a": a, "A": A, "K_F": K_F}
        self._settings["metric_scale"] = metric_scale(gains)
        now, nz, names = self._space.now, robot.nz, ("lambda_0", "lambda_1", "lambda_2")
        kinematic = self._kinematic = SlidingStage.of(gains, self._space.p, *names)
        dynamic = self._dynamic = SlidingStage.of(gains, nz, "Lambda_0", "Lambda_1")
        held = self._held = Held(*np.zeros((5, nz)))
        self._v = held.v
        self.values |= {"gains": in_force(gains, dt, a, A, self.inverse_actuation), "held": held}
        self.values |= {"kinematic": kinematic, "dynamic": dynamic, "stage": kinematic}
        self.values |= {"z_dot": self._measured, "v": held.v, "q_rest": robot.q_rest}
        entries = [now.inertia, *self._reference(robot, task)]
        inside, change = np.zeros((2, nz))
        if gains.delay_ticks:
            late = np.zeros((gains.delay_ticks + 1, nz))
            entries.append(self.entry(predict_acceleration, late=late, change=change))
        entries += [self.entry(dynamic_stage, stage=dynamic), self.entry(integrate)]
        if gains.saturation == "hedge":
            limits = self.torque_limits(robot, gains.torque_limits)
            self._settings["torque_limits"] = plain_limits(limits)
            if np.isfinite(limits).any():
                entries.append(self.entry(hedge, limit=limits, inside=inside, change=change))
        self._law = sequence(*entries)

    def reference(self) -> tuple[Array, Array]:
        """z and z' that the kinematic stage wants at the end of the tick, the integral of v_ref and
        v_ref; shape (nz,) each. The first is what a base is commanded that takes velocities."""
        return self._held.integral_v_ref.copy(), self._held.v_ref.copy()

    def signals(self) -> dict[str, Array]:
        """The sliding variables of the last tick: s of (31) and S of (51)."""
        return {"sliding/s": self._kinematic.s, "sliding/S": self._dynamic.s}

    def monitored_signals(self) -> dict[str, Array]:
        """The signals of a monitored run: in addition, what the theorems speak of. v_ref is that of the
        tick's end; z' is as the law takes it, and v' as it is before a motor's limit."""
        kinematic, dynamic, held = self._kinematic, self._dynamic, self._held
        return self.signals() | {
            "sliding/g": kinematic.g,
            "sliding/n": kinematic.n,
            "sliding/v_ref": held.v_ref,
            "sliding/v_ref_dot": held.v_ref_dot,
            "sliding/G": dynamic.g,
            "sliding/n_d": dynamic.n,
            "sliding/v_dot": held.v_dot,
            "sliding/z_dot": self._measured,
        }

    def _reference(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        """Entries that give v_ref'."""
        if not self.gains.damping:
            return [self.entry(kinematic_stage)]
        tip = TaskSpace(robot, task)
        bounds = self._settings["a"], jacobian_bound(robot, task, tip, self.metric(robot))
        own = Damping.of(float(self.gains.damping), bounds, self._space.p, robot.nz)
        return [self.entry(damped_stage, own=own)]

    def _with_bounds(self, robot: MobileManipulator, task: Task) -> CascadeGains:
        """The gains, with the constants of the theorems computed where that is asked for."""
        gains: CascadeGains = self.gains
        if gains.bounds == "given":
            return gains
        others = set() if self.extended else {"w_1", "w_2", "a"}  # those are of the J of (13)
        others |= {"A"} if self.inverse_actuation else set()  # that is of B B^T
        found: dict[str, Any] = dict(computed_bounds(robot, task, self.criterion).values)
        return replace(gains, **{n: x for n, x in found.items() if n not in others})

    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """The coordinates f of (31), or of (44)."""
        return TaskSpace(robot, task, self.criterion if self.extended else None)

    def metric(self, robot: MobileManipulator) -> Array:
        """Diagonal of the Omega in J Omega J^T, whose least eigenvalue ``a`` lies below; shape (nz,)."""
        return np.ones(robot.nz)

    def _bounds(self, robot: MobileManipulator, task: Task) -> tuple[float, float]:
        a, A = self._used.a, self._used.A
        if isinstance(a, str):
            a = jacobian_bound(robot, task, self.task_space(robot, task), self.metric(robot))
        if isinstance(A, str) and self.inverse_actuation:
            A = inertia_bound(robot, task)
        elif isinstance(A, str):
            A = actuation_bound(robot, task, self._used.w_7)
        return a, A


@controllers.register("tsm-simplified")
class SimplifiedTerminalSlidingMode(TerminalSlidingMode):
    """Kinematic stage on the tip Jacobian's transpose, v_ref' = j_e^T u_ref (43)-(44); dynamic stage
    as in ``tsm`` (55)-(56). What the tip leaves free is not controlled: ``c_F`` and ``K_F`` have no
    effect here but on what is reported of the criterion."""

    name = "tsm-simplified"
    extended = False


@controllers.register("tsm-inverse-actuation")
class InverseActuationSlidingMode(TerminalSlidingMode):
    """Kinematic stage as in ``tsm`` (34)-(35); dynamic stage v' = B^-1 u (65)-(66), with the gain
    ``A`` in the place of A' of (64)."""

    name = "tsm-inverse-actuation"
    inverse_actuation = True
