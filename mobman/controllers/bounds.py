r"""The constants w_1 to w_9, a and A that Theorems 1 and 2 suppose of a robot, by sampling; a and A also
by themselves, which ``"auto"`` stands for.

What they bound, with :math:`h = Pz + G` of (17) and :math:`h_2 = Pz`, which is quadratic in z:

- w_1, w_2: :math:`|J|_F, |\partial J/\partial q|_F, |\partial^2 J/\partial q^2|_F \le w_1 + w_2 |q -
  q_{rest}|` (21), J with the axes of :math:`f_a` carried along straight lines, so that none of the norms
  depends on them;
- w_3 to w_9, term by term of (53) for :math:`|z| = 1`, where :math:`M\mathcal U + \dot M S/2 =
  \dot B v - \dot M\dot z - \dot h - \dot D + M(\Lambda_0 E^{\alpha_1} + \Lambda_1 \dot E^{\alpha_2} -
  J^T u_{ref}) + \dot M S/2`: w_3 :math:`|\dot B|`; w_4 :math:`|\partial h_2/\partial q\,C z|`; w_5
  :math:`|\partial G/\partial q\,C z|`; w_6 = 1, since :math:`|\dot D| \le \beta_1` (18); w_7
  :math:`|M|`; w_8 :math:`|\dot M|/2`; w_9 :math:`|\dot M + \partial h_2/\partial z|`;
- a :math:`\le \lambda_{min}(JJ^T)` (22), and A :math:`\le \lambda_{min}(BB^T)` (54), or (64).

Each term is homogeneous in z, so that directions of z are sampled, and no speeds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.controllers.gains import CriterionGains
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import SingularityError
from mobman.model.criterion import Criterion
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task, task_map_of, time_of

_SAMPLES = 200
SPREAD = 0.5  # rad or m: how far sampled arm coordinates are from rest
_AUTO_MARGIN = 0.1
"""Part of the sampled minimum that "auto" uses, since sampling sees the worst state rarely."""
FLOOR = 1e-12
"""Below it, the samples are singular to the precision of J. Rows of J are as large as the criterion's
weights, so that a sound robot may have 1e-9: the platform's part of an omnidirectional one."""
_HORIZON = 10.0  # s: the part that is sampled of a task that does not say how long it is
SEED = 20_240_607
_RATE_STEP = 1e-4  # rad or m: of central differences along the motion
_CONSTANT = 1e-12  # part of a matrix below which a difference is rounding


def sampled_states(robot: MobileManipulator, task: Task) -> list[tuple[float, Array]]:
    """Times and configurations that the task may lead through.

    The arm near its rest posture and inside its limits, any heading, and the platform where the tip
    is above the desired point of a random time: within the task's ``duration`` or ``period`` if it
    has one, else its first 10 s.
    """
    random = np.random.default_rng(SEED)
    horizon = time_of(task, "duration") or time_of(task, "period") or _HORIZON
    lower, upper = _near_rest(robot)
    heading = np.flatnonzero(np.isin(robot.joint_names, "base_theta"))
    position = np.flatnonzero(np.isin(robot.joint_names, ("base_x", "base_y")))
    states = []
    for _ in range(_SAMPLES):
        t = random.uniform(0.0, horizon)
        q = robot.q_rest.copy()
        q[robot.arm_index] = random.uniform(lower, upper)[robot.arm_index]
        q = robot.consistent(q)
        q[heading] = random.uniform(-math.pi, math.pi, len(heading))
        if len(position) == 2:
            desired = np.asarray(task.desired(t)[0], dtype=float)
            tip = np.asarray(robot.tip_pose(q).translation)
            q[position] += desired[:2] - tip[:2]
        states.append((t, q))
    return states


def _near_rest(robot: MobileManipulator) -> tuple[Array, Array]:
    """The least and the largest coordinates of sampled states."""
    lower = np.maximum(robot.model.lowerPositionLimit, robot.q_rest - SPREAD)
    return lower, np.minimum(robot.model.upperPositionLimit, robot.q_rest + SPREAD)


def jacobian_bound(
    robot: MobileManipulator, task: Task, space: TaskSpace, metric: Array | None = None
) -> float:
    """``a = "auto"``: a tenth of the least lambda_min(J J^T) over :func:`sampled_states`, (22).

    With a ``metric``, the diagonal of Omega of shape (nz,), it is that of J Omega J^T.

    In the implicit form a bound that is lower than need be costs nothing; one above
    lambda_min(J J^T) lets the state fall off the manifold.
    """
    none = np.zeros(robot.nz)
    root = np.sqrt(np.ones(robot.nz) if metric is None else metric)
    least = math.inf
    for i, (t, q) in enumerate([(0.0, robot.q_rest), *sampled_states(robot, task)]):
        try:
            space.at(t, q, none)
        except SingularityError:
            continue  # (15) supposes that such configurations are not met
        # a turned platform is no orientation error that is met: the largest is at the start
        J = space.J if i == 0 else space.aligned_jacobian()
        least = min(least, _least(J * root))
    return max(_AUTO_MARGIN * least, FLOOR) if math.isfinite(least) else FLOOR


def actuation_bound(robot: MobileManipulator, task: Task, w_7: float) -> float:
    r"""``A = "auto"``: a lower bound of lambda_min(B B^T), (54), for a robot of any mass.

    Theorem 2 asks that chi bounds :math:`|M U + \dot M S/2|` (53), so that w_7 bounds
    :math:`|M|`; the paper's w_7 = 6 does so for light arms only. The gain C/A is what makes up for
    it: A is the least :math:`\lambda_{min}(B B^T)\min(1, w_7/\lambda_{max}(M))` over
    :func:`sampled_states`, times a margin.
    """
    none = np.zeros(robot.nz)
    least = math.inf
    for _, q in sampled_states(robot, task):
        M, _, B = robot.dynamics(q, none)
        covered = min(1.0, w_7 / float(np.linalg.eigvalsh(M)[-1]))
        least = min(least, covered * _least(B))
    return max(_AUTO_MARGIN * least, FLOOR)


def inertia_bound(robot: MobileManipulator, task: Task) -> float:
    """``A`` of the inverse-actuation law when ``"auto"``: a lower bound A' of lambda_min(M^-1), (64),
    the least 1/lambda_max(M) over :func:`sampled_states`, times a margin."""
    none = np.zeros(robot.nz)
    return _AUTO_MARGIN / max(
        float(np.linalg.eigvalsh(robot.dynamics(q, none).M)[-1])
        for _, q in sampled_states(robot, task)
    )


def _least(matrix: Array) -> float:
    """lambda_min(matrix matrix^T)."""
    return float(np.linalg.svd(matrix, compute_uv=False)[-1] ** 2)


def rate_along(
    robot: MobileManipulator, q: Array, z: Array, value: Callable[[Array], Array]
) -> Array:
    """d/dt of a matrix of q along q' = C z, by central differences; for z of a length near 1."""
    step = _RATE_STEP * (robot.velocity_map(q) @ z)
    before, after = value(q - step), value(q + step)
    change = after - before
    if np.abs(change).max() <= _CONSTANT * max(np.abs(after).max(), np.abs(before).max()):
        return np.zeros_like(change)
    return change / (2.0 * _RATE_STEP)


# All of them ------------------------------------------------------------------------------------------

_CONSTANTS = {
    "w_1": (1.5, "|J|, |dJ/dq|, |d2J/dq2| <= w_1 + w_2 |q - q_rest| (21)"),
    "w_2": (0.001, "growth with |q - q_rest| (21)"),
    "w_3": (3.0, "|B'| / |z|"),
    "w_4": (9.0, "|d(Pz)/dq C z| / |z|^3"),
    "w_5": (12.0, "|dG/dq C z| / |z|"),
    "w_6": (0.0, "|D'| / beta_1 (18)"),
    "w_7": (6.0, "|M|"),
    "w_8": (0.011, "|M'| / (2 |z|)"),
    "w_9": (6.0, "|M' + d(Pz)/dz| / |z|"),
    "a": (0.2, "below lambda_min(J J^T) (22)"),
    "A": (0.2, "below lambda_min(B B^T) (54)"),
}
PAPER = {name: value for name, (value, _) in _CONSTANTS.items()}
"""The paper's constants for its youBot, section 4, which calls them rough."""
BOUNDED = {name: term for name, (_, term) in _CONSTANTS.items()}
"""The term that each constant bounds, in words; w_3 to w_9 those of (53)."""
MARGIN = 0.1
"""By which bounds lie beyond the largest value found, as a part of it."""
CONFIDENCE = 0.95
_STEP_J = 1e-3  # rad or m: of J's, of which there are second ones
_WITH_DERIVATIVES = 60  # states at which the derivatives of J are computed, nq^2 + nq J each
_STARTS = 2  # of the local search: the worst samples
_ITERATIONS = 25  # of the local search

_State = tuple[Array, Array]
"""(q, z), with a z of length 1."""
_Term = Callable[[Array, Array], float]


class ComputedBounds(NamedTuple):
    """See the module."""

    values: dict[str, float]
    """w_1 to w_9, a and A, with their margin."""
    found: dict[str, float]
    """The extreme value found for each but w_1, w_2 and w_6, after the local search."""
    sampled: dict[str, float]
    """That of the samples alone."""
    exceeded: dict[str, float]
    """Share of the states that at most lies beyond the sampled value, with :data:`CONFIDENCE`."""
    states: int
    """Number of sampled states at which J exists."""
    singular: int
    """Number of those at which it does not, which (15) excludes."""
    regular: bool
    """False if the search for a ended where J is singular: then no a > 0 holds for all these states,
    and ``values`` has a tenth of the samples' least, as the laws' ``a = "auto"``."""


def computed_bounds(
    robot: MobileManipulator, task: Task, criterion: Criterion | None = None
) -> ComputedBounds:
    """w_1 to w_9, a and A over the states that a task may lead through, see the module.

    The states are those of :func:`sampled_states`, steered wheels within 0.5 rad of rest too, each with
    a random direction of z. From the worst ones a local search (L-BFGS-B) goes on over arm, heading,
    steering and direction of z, inside the same limits.

    Args:
        robot: The robot.
        task: The task.
        criterion: F; by default that of the laws, with the task's weights or the robot's.

    Raises:
        SingularityError: If J exists at none of them.
    """
    random, region = np.random.default_rng(SEED), _Region(robot)
    states: list[_State] = [(robot.q_rest, _unit(random.standard_normal(robot.nz)))]
    for _, q in sampled_states(robot, task):
        states.append((region.steered(q, random), _unit(random.standard_normal(robot.nz))))
    sampled: dict[str, float] = {}
    found: dict[str, float] = {}
    for name, term in _terms(robot).items():
        sign, still = -1.0 if name == "A" else 1.0, name in ("w_7", "A")
        sampled[name], found[name] = region.extreme(term, sign, states, still)
    own = CriterionGains().criterion(robot, task) if criterion is None else criterion
    J = _Jacobian(robot, task, own)
    regular = [state for state in states if J.exists(state[0])]
    if not regular:
        what = f"robot {robot.name!r}: J exists at none of the sampled states"
        raise SingularityError(what, "J")
    sampled["a"], found["a"] = region.extreme(lambda q, z: _least(J.at(q)), -1.0, regular, True)
    w_1, w_2 = _line(robot, J, region, regular)
    values = {"w_1": w_1, "w_2": w_2, "w_6": 1.0}
    values |= {f"w_{i}": (1.0 + MARGIN) * found[f"w_{i}"] for i in (3, 4, 5, 7, 8, 9)}
    values |= {name: found[name] / (1.0 + MARGIN) for name in ("a", "A")}
    if not (all_regular := found["a"] > FLOOR):
        values["a"] = _AUTO_MARGIN * sampled["a"]
    exceeded = dict.fromkeys(sampled, _exceeded(1, len(states)))
    exceeded["a"] = _exceeded(1, len(regular))
    exceeded["w_1"] = exceeded["w_2"] = _exceeded(2, min(len(regular), _WITH_DERIVATIVES))
    values, found, sampled, exceeded = (
        {name: one[name] for name in PAPER if name in one}
        for one in (values, found, sampled, exceeded)
    )
    singular = len(states) - len(regular)
    return ComputedBounds(values, found, sampled, exceeded, len(regular), singular, all_regular)


def _unit(z: Array) -> Array:
    return z / max(float(np.linalg.norm(z)), 1e-300)


def _norm(matrix: Array) -> float:
    """Euclidean norm of a vector, the largest singular value of a matrix."""
    return float(np.linalg.norm(matrix, 2))


def _exceeded(parameters: int, samples: int) -> float:
    """Share of the states that may lie beyond a bound of so many parameters which covers so many
    independent samples (Campi and Garatti, SIAM J. Optimization 19(3), 2008, theorem 1)."""
    from scipy.stats import beta  # with the next a third of a second, and no run needs them

    return float(beta.ppf(CONFIDENCE, parameters, samples - parameters + 1))


def _terms(robot: MobileManipulator) -> dict[str, _Term]:
    """The terms of (53) and (54) at (q, z), |z| = 1, by the constant that bounds them."""
    rest, inertia = np.zeros(robot.nz), robot.reduced_inertia

    def at(q: Array) -> Any:
        return robot.dynamics(q, rest)

    def along(q: Array, z: Array, value: Callable[[Array], Array]) -> Array:
        return rate_along(robot, q, z, value)

    def quadratic(q: Array, z: Array) -> Array:
        """Pz of (17)."""
        difference: Array = robot.dynamics(q, z).bias - at(q).bias
        return difference

    def by_velocity(q: Array, z: Array) -> Array:
        """d(Pz)/dz; central differences of what is quadratic are exact."""
        ends = [
            (robot.dynamics(q, z + e).bias, robot.dynamics(q, z - e).bias) for e in np.eye(len(z))
        ]
        return np.stack([(ahead - behind) / 2.0 for ahead, behind in ends], axis=1)

    return {
        "w_3": lambda q, z: _norm(along(q, z, lambda x: at(x).B)),
        "w_4": lambda q, z: _norm(along(q, z, lambda x: quadratic(x, z))),
        "w_5": lambda q, z: _norm(along(q, z, lambda x: at(x).bias)),
        "w_7": lambda q, z: _norm(at(q).M),
        "w_8": lambda q, z: _norm(along(q, z, inertia)) / 2.0,
        "w_9": lambda q, z: _norm(along(q, z, inertia) + by_velocity(q, z)),
        "A": lambda q, z: _least(at(q).B),
    }


class _Region:
    """Region of the local search: arm, heading and steering, and all directions of z."""

    def __init__(self, robot: MobileManipulator) -> None:
        self.robot = robot
        base = robot.platform.base_joints
        heading = [i for i, name in enumerate(robot.joint_names) if name == "base_theta"]
        wheels = [int(i) for i in robot.platform_index if robot.joint_names[i] not in base]
        self.steering = np.array([i for i in wheels if self._steers(i)], dtype=np.int64)
        self.free = np.concatenate([robot.arm_index, self.steering, heading]).astype(np.int64)
        self.lower, self.upper = _near_rest(robot)
        self.lower[heading], self.upper[heading] = -math.pi, math.pi

    def _steers(self, i: int) -> bool:
        """True if the directions of motion C depend on a coordinate."""
        moved = self.robot.q_rest.copy()
        moved[i] += _RATE_STEP
        change = self.robot.velocity_map(moved) - self.robot.velocity_map(self.robot.q_rest)
        return bool(np.abs(change).max() > _CONSTANT)

    def steered(self, q: Array, random: np.random.Generator) -> Array:
        q = q.copy()
        q[self.steering] = random.uniform(self.lower, self.upper)[self.steering]
        return self.robot.consistent(q)

    def extreme(
        self, term: _Term, sign: float, states: Sequence[_State], still: bool
    ) -> tuple[float, float]:
        """The largest value (the least if the sign is -1) of the states, and after the search;
        ``still`` if the term does not depend on z."""
        values = np.array([term(*state) for state in states])
        worst = np.argsort(-sign * values)[:_STARTS]
        sampled = float(values[worst[0]])
        ends = [self.search(term, sign, states[i], still)[1] for i in worst]
        return sampled, sign * max(sign * value for value in (sampled, *ends))

    def search(self, term: _Term, sign: float, start: _State, still: bool) -> tuple[Array, float]:
        """The end q of a local search for a larger (or smaller) value, and the value there."""
        (q_start, z_start), n, value = start, len(self.free), term(*start)
        if (scale := abs(value)) == 0.0:
            return q_start, value
        best = (q_start, value)

        def cost(x: Array) -> float:
            nonlocal best
            q = q_start.copy()
            q[self.free] = x[:n]
            q = self.robot.consistent(q)
            try:
                value = term(q, z_start if still else _unit(x[n:]))
            except SingularityError:
                return 1e3
            if sign * value > sign * best[1]:
                best = (q, value)
            return -sign * value / scale

        from scipy.optimize import Bounds, minimize

        direction = z_start[:0] if still else z_start
        lower = np.concatenate([self.lower[self.free], np.full(len(direction), -1.0)])
        upper = np.concatenate([self.upper[self.free], np.full(len(direction), 1.0)])
        x = np.clip(np.concatenate([q_start[self.free], direction]), lower, upper)
        options: Any = {"maxiter": _ITERATIONS, "eps": 1e-6}
        minimize(cost, x, method="L-BFGS-B", bounds=Bounds(lower, upper), options=options)
        return best


class _Jacobian:
    """J of (13), and its derivatives with respect to q."""

    def __init__(self, robot: MobileManipulator, task: Task, criterion: Criterion) -> None:
        self.extended = ExtendedJacobian(robot, task_map_of(task), criterion)
        self.rest = np.zeros(robot.nz)

    def at(self, q: Array) -> Array:
        self.extended.at(q, self.rest)
        return self.extended.J.copy()

    def exists(self, q: Array) -> bool:
        try:
            self.at(q)
        except SingularityError:
            return False
        return True

    def size(self, q: Array, z: Array) -> float:
        return float(np.linalg.norm(self.at(q)))

    def norms(self, q: Array) -> list[float]:
        """The three Frobenius norms of (21)."""
        J = self.at(q)
        axes = self.extended.complement.copy()

        def along(direction: Array) -> tuple[Array, Array]:
            ends = []
            for sign in (1.0, -1.0):
                self.extended.complement[:] = axes
                ends.append(self.at(q + sign * _STEP_J * direction))
            first = (ends[0] - ends[1]) / (2.0 * _STEP_J)
            return first, (ends[0] - 2.0 * J + ends[1]) / _STEP_J**2

        units = np.eye(len(q))
        straight = [along(e) for e in units]
        squares = sum(float(np.sum(second**2)) for _, second in straight)
        for i, (_, by_i) in enumerate(straight):
            for k, (_, by_k) in enumerate(straight[:i]):
                mixed = (along(units[i] + units[k])[1] - by_i - by_k) / 2.0
                squares += 2.0 * float(np.sum(mixed**2))  # both orders
        first = math.sqrt(sum(float(np.sum(by**2)) for by, _ in straight))
        return [float(np.linalg.norm(J)), first, math.sqrt(squares)]


def _line(
    robot: MobileManipulator, J: _Jacobian, region: _Region, states: Sequence[_State]
) -> tuple[float, float]:
    """w_1 and w_2 of (21): the line over all norms found that is the least on average, w_1 and w_2
    not negative, with the margin."""
    points = []
    for i, (q, z) in enumerate(states):
        norms = J.norms(q) if i < _WITH_DERIVATIVES else [J.size(q, z)]
        points += [(q, norm) for norm in norms]
    for start in sorted(states, key=lambda state: -J.size(*state))[:_STARTS]:
        points.append(region.search(J.size, 1.0, start, still=True))
    rows = np.array([(1.0, np.linalg.norm(q - robot.q_rest)) for q, _ in points])
    norms = [norm for _, norm in points]
    from scipy.optimize import linprog

    found = linprog(rows.mean(axis=0), A_ub=-rows, b_ub=-np.array(norms), bounds=[(0.0, None)] * 2)
    w_1, w_2 = (1.0 + MARGIN) * np.asarray(found.x, dtype=float)
    return float(w_1), float(w_2)
