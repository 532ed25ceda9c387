"""The closed loop: measure, control, hold the torque, integrate the plant; tick by tick."""

from __future__ import annotations

import contextlib
import ctypes
import math
from collections.abc import Callable, Iterator, Mapping
from time import perf_counter
from typing import Any

import numpy as np

from mobman.arrays import Array, Index, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.controllers.protocol import Controller
from mobman.errors import MobmanError, SingularityError, UsageError
from mobman.linalg import dot
from mobman.model.criterion import Criterion, Posture
from mobman.model.extended_jacobian import GAUGE_LOST, SINGULAR, ExtendedJacobian
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.orientation import NOT_UNIT, OrientationError, Turn, pointing_error, pose_error
from mobman.model.task_map import TaskMap
from mobman.simulation.actuation import ActuationChain
from mobman.simulation.integrator import Divergence, TickIntegrator, divergence
from mobman.simulation.pieces import Setting
from mobman.simulation.plant import NOT_DEFINITE, require_success
from mobman.simulation.record_file import APPLIED, OWN_PLACES
from mobman.simulation.scenario import GivenPlant, Scenario, true_plant
from mobman.simulation.sensors import MeasuredTip
from mobman.tasks.task import Task, require_freedom, task_entry, task_map_of

Observer = Callable[[float, Array, Array, Array], None]
"""Is given t (s), q, z and the torque at a tick; the arrays are its own."""


class Samples:
    """Samples of a run, one row a tick; arrays of its record have their names there.

    Args:
        rows: Number of ticks.
        robot: The plant's robot.
        task_map: The task's coordinates.
        actuated: Whether the torque that acts is not the commanded one.

    Attributes:
        tip_orientation, tip_desired_orientation: Without rows for tasks that have none.
        orientation_error: e_o, shape (rows, m - 3).
        auxiliary_error: NaN where it is not known.
        applied: Torque that acts, shape (rows, nz); None where it is the commanded one.
        limited: Whether a limit changed the commanded torque, shape (rows,); None with ``applied``.
        velocity_ratio: Largest |q'| of a joint over its limit, shape (rows,); 0 without limits.
        signals: Signals of the controller by name, ``rows`` rows each; NaN where it gives none.
        count: How many rows are filled.
        work: Integral of z^T (B v - D) over the run (J).
        error: What the law or the plant raised where a matrix had lost its rank.
    """

    def __init__(
        self, rows: int, robot: MobileManipulator, task_map: TaskMap, actuated: bool
    ) -> None:
        m, nz, turned = task_map.m, robot.nz, (rows, task_map.width - 3)
        self.q, self.z, self.torque = (np.empty((rows, n)) for n in (robot.nq, nz, nz))
        self.tip_position, self.tip_desired = np.empty((2, rows, min(m, 3)))
        self.tip_orientation, self.tip_desired_orientation = np.empty(
            (2, *(turned if m > 3 else (0, 0)))
        )
        self.orientation_error = np.empty((rows, max(m - 3, 0)))
        self.auxiliary_error = np.full((rows, nz - m), np.nan)
        self.compute_time, self.velocity_ratio = np.empty(rows), np.zeros(rows)
        self.applied = np.zeros((rows, nz)) if actuated else None
        self.limited = np.zeros(rows, dtype=bool) if actuated else None
        self.signals: dict[str, Array] = {}
        self.count, self.work, self.status, self.message = 0, 0.0, "ok", ""
        self.error: SingularityError | None = None

    def filled(self) -> dict[str, Any]:
        """The rows of the arrays that are filled, by name."""
        arrays = {name: x for name, x in vars(self).items() if isinstance(x, np.ndarray)}
        return {name: array[: self.count] for name, array in arrays.items()}

    def rows_of_signal(self, name: str, shape: tuple[int, ...]) -> Array:
        """The rows of a signal whose values have a shape.

        Raises:
            UsageError: If it has the name of a part of the record, or none for a dataset.
        """
        if name not in self.signals:
            parts = str(name).split("/")
            if parts[0] in {*OWN_PLACES, APPLIED}:
                raise UsageError(f"the signal {name!r} has the name of a record's own part")
            within = [(f"{name}/", f"{one}/") for one in self.signals]
            within = [
                one for one in within if one[0].startswith(one[1]) or one[1].startswith(one[0])
            ]
            if (
                not isinstance(name, str)
                or "\0" in name
                or not all(part.strip(".") for part in parts)
                or within
            ):
                raise UsageError(
                    f"a signal has the name {name!r}; allowed: text, with '/' between parts of which "
                    "none is empty, and the whole no part of another signal's"
                )
            self.signals[name] = np.full((len(self.q), *shape), np.nan)
        return self.signals[name]

    def keep_signal(self, tick: int, name: str, value: Any) -> None:
        """Keep a signal's value at a tick; UsageError if it is no number, or not of its shape."""
        try:
            self.rows_of_signal(name, np.shape(value))[tick] = value
        except MobmanError:
            raise
        except (TypeError, ValueError) as error:
            raise UsageError(
                f"the signal {name!r} is {value!r}: must be numbers, of one shape at every tick"
            ) from error

    def ended(self, t: float, reason: str, status: str = "diverged") -> None:
        """End the run at t (s)."""
        self.status, self.message = status, f"at t = {t:.6g} s: {reason}"


def _round_to_nearest() -> None:
    """Set the rounding of this thread's arithmetic, which a library of a law may have changed."""
    with contextlib.suppress(OSError, AttributeError, TypeError):  # a system without this function
        ctypes.CDLL(None).fesetround(0)  # FE_TONEAREST on x86 and Arm


class Loop:
    """One run of a closed loop; it runs once.

    Args:
        robot, controller, task, scenario, plant, dt, seed, progress: As of :func:`mobman.simulate`, each
            an object.
        q0: Start (m, rad), shape (nq,).
        ticks: How many periods there are.
        observe: Called with the state and the torque at every ``stride``-th tick.
        monitor: Whether the controller gives its ``monitored_signals()`` in the place of ``signals()``.

    Attributes:
        robot: As given; so are ``controller``, ``task``, ``ticks``, ``dt``.
        plant: The true robot and what acts on it.
        constraint_residual: The largest |A(x) x'| at a tick up to now (m/s), shape (1,).
        samples: The samples, one row a tick; whole once :meth:`run` is over.

    Raises:
        UsageError: If a part does not fit the robot.
        SpecError: If the plant's friction is too steep to be integrated.
    """

    def __init__(
        self,
        robot: MobileManipulator,
        controller: Controller,
        task: Task,
        scenario: Scenario,
        plant: GivenPlant = None,
        *,
        q0: Array,
        ticks: int,
        dt: float,
        seed: int,
        progress: Callable[[float], None] | None = None,
        observe: Observer | None = None,
        stride: int = 1,
        monitor: bool = False,
    ) -> None:
        self.robot, self.controller, self.task = robot, controller, task
        self.task_map, self.ticks, self.dt = task_map_of(task), ticks, dt
        setting = Setting(robot, dt, np.random.default_rng(seed))
        true = true_plant(setting, plant, scenario)
        require_freedom(robot, task)
        self.plant = scenario.make_plant(setting, true)
        self._measurement = scenario.measurement(setting, true)
        self._tip = MeasuredTip(task, robot) if scenario.tip == "measured" else None
        self._actuation = actuation = scenario.actuation_chain(setting)
        self.samples = Samples(ticks + 1, self.plant.robot, self.task_map, actuation is not None)
        self._progress, self._observe, self._stride = progress, observe, stride
        self._integrator = TickIntegrator(self.plant, actuation, q0, dt)
        self._command = self.plant.v if actuation is None else np.zeros(robot.nz)
        self._t, self._tick = np.zeros(1), np.zeros(1, dtype=np.int64)
        self._z_dot, self.constraint_residual = np.zeros(robot.nz), np.zeros(1)
        self._look = self._looking()
        report = "monitored_signals" if monitor else "signals"
        self._report: Callable[[], dict[str, Any]] | None = getattr(controller, report, None)

    @property
    def criterion(self) -> Criterion:
        """The criterion that e^a belongs to: the controller's own, or the robot's posture."""
        own: Criterion | None = getattr(self.controller, "criterion", None)
        return Posture.of(self.robot) if own is None else own

    def run(self) -> None:
        """From rest at q0 to the end, or to where it cannot go on: ``samples`` say which.

        Raises:
            UsageError: If the controller's torque or signals are not what they must be.
            MobmanError: If the controller, or other code of the user, calls ``sys.exit``.
        """
        # what overflows is found by its result
        with np.errstate(all="ignore"):
            for _ in self.ticks_ahead():
                pass
        if self._progress is not None:
            self._progress(1.0)

    def ticks_ahead(self) -> Iterator[tuple[Array, Array, Array]]:
        """Do what :meth:`run` does tick by tick: yield the measured q, z and z' of each before the
        controller is asked for its torque."""
        samples = self.samples
        _round_to_nearest()
        try:
            self._begin()
            yield from self._go()
        except (SingularityError, np.linalg.LinAlgError) as error:
            samples.ended(self._tick[0] * self.dt, str(error), "singular")
            samples.error = SingularityError(str(error), getattr(error, "matrix", ""))
        except SystemExit as error:
            raise MobmanError(
                f"at t = {self._tick[0] * self.dt:.6g} s: the code of the controller, the task or the "
                f"platform called sys.exit (SystemExit: {error})"
            ) from error
        finally:
            _round_to_nearest()
            samples.work = self._integrator.work

    def _begin(self) -> None:
        """Keep the start, whatever happens next, so that no record is empty; start the controller."""
        samples, plant = self.samples, self.plant
        plant.now.run_all()
        self._look()
        samples.torque[0], samples.compute_time[0] = plant.v, 0.0
        samples.count = 1
        if (limit_motors := getattr(self.controller, "limit_motors", None)) is not None:
            limit_motors(None if self._actuation is None else self._actuation.level)
        # a law that writes to its robot changes neither the plant nor later runs
        if self._tip is not None:
            self._tip.look(plant.now.q, plant.now.z, plant.now, plant.q_dot)
        self.controller.reset(self.robot.copy(), self._tip or self.task, self.dt)
        self._extended = ExtendedJacobian(plant.robot, self.task_map, self.criterion, plant.now)
        f, m, tick = self._extended.f, self.task_map.m, self._tick
        self._keep_auxiliary = bind(_keep_from, tick, f, m, samples.auxiliary_error)
        keep_command = bind(_keep_finite, tick, self._command, samples.torque)
        self._keep = sequence(keep_command, *self._signal_entries())
        self._look_on = self._with_auxiliary()

    def _go(self) -> Iterator[tuple[Array, Array, Array]]:
        """Tick by tick: look, control, integrate."""
        # local names, since these run at every tick
        samples, plant, now = self.samples, self.plant, self.plant.now
        ticks, dt, t_now, tick_now = self.ticks, self.dt, self._t, self._tick
        run_all, measure, step = now.run_all, self._measurement, self.controller.step
        look, tip, disturbed = self._look_on, self._tip, plant.disturbed
        q, z, z_dot, v = now.q, now.z, self._z_dot, self._command
        keep_row, advance, shape, double = self._keep, self._integrator.advance, v.shape, v.dtype
        every, compute_time = max(1, ticks // 100), samples.compute_time
        observe, stride, report = self._observe, self._stride, self._report
        for tick in range(ticks + 1):
            t = tick * dt
            t_now[0] = t
            tick_now[0] = tick
            run_all()
            if disturbed:
                plant.disturb(t)
            try:
                status = look()
            except SingularityError:  # of a criterion in Python
                status = SINGULAR
            if status:
                if status == NOT_DEFINITE:
                    require_success(status)
                if status not in (SINGULAR, GAUGE_LOST):
                    error = samples.tip_position[tick] - samples.tip_desired[tick]
                    samples.ended(t, Divergence(status).reason(z, error))
                    return
                look = self._with_auxiliary()
            q_now, z_now, measured = seen = measure(q, z, z_dot)
            if tip is not None:
                tip.look(q_now, z_now, now, plant.q_dot)
            yield seen
            started = perf_counter()
            torque = step(t, q_now, z_now, measured)
            compute_time[tick] = perf_counter() - started
            if type(torque) is not np.ndarray or torque.shape != shape or torque.dtype != double:
                torque = _checked_torque(torque, v)
            v[...] = torque
            if keep_row():
                samples.ended(t, "the controller's torque is not finite")
                return
            if self._actuation is not None:
                self._actuate(self._actuation, tick)
            if report is not None:
                if not isinstance(reported := report(), Mapping):
                    raise UsageError(
                        f"the controller's signals are {reported!r}: expected a dictionary"
                    )
                for name, value in reported.items():
                    samples.keep_signal(tick, name, value)
            if observe is not None and tick % stride == 0:
                observe(t, q.copy(), z.copy(), v.copy())
            if tick < ticks and (diverged := advance(t)) is not None:
                samples.ended(*diverged)
                return
            samples.count = tick + 1
            if self._progress is not None and tick % every == 0:
                self._progress(tick / ticks)

    def _signal_entries(self) -> list[Callable[[], None]]:
        """Entries that keep a row of each signal, where signals are overwritten in place."""
        report, signals = self._report, self.plant.signals()
        if report is not None and getattr(self.controller, "signals_in_place", False):
            self._report = None  # nothing is left to be done in Python
            signals = {**report(), **signals}
        found = []
        for name, value in signals.items():
            rows = self.samples.rows_of_signal(name, value.shape)
            flat = (value.reshape(-1), 0, rows.reshape(len(rows), -1))
            found.append(bind(_keep_from, self._tick, *flat))
        return found

    def _looking(self) -> Callable[[], int]:
        """Entry that keeps a row of the state, or reports why it counts as diverged; then z'. It is part
        of the ticks' own, :meth:`_with_auxiliary`."""
        plant, samples, p_d = self.plant, self.samples, np.zeros((4, self.task_map.width))
        now, orientation = plant.now, []
        if self.task_map.m > 3:
            turn = OrientationError(self.task_map, now, p_d).turn
            rows = (samples.tip_orientation, samples.tip_desired_orientation)
            look = bind(_look_at_turn, self._tick, turn, p_d, *rows, samples.orientation_error)
            orientation = [now.tip_orientation, look]
        return sequence(
            now.tip_kinematics,
            now.constraints,
            task_entry(self.task, self._t, p_d),
            *([plant.motion] if plant.slips else []),
            bind(
                _look,
                *(self._tick, now.q, now.z, now.tip, p_d, now.A, plant.q_dot),
                *(self.constraint_residual, samples.q, samples.z),
                *(samples.tip_position, samples.tip_desired),
                *(now.q_dot, 1.0 / self.robot.limits.joint_velocity, samples.velocity_ratio),
            ),
            *orientation,
            *plant.accelerations(self._z_dot),
            join=False,
        )

    def _with_auxiliary(self) -> Callable[[], int]:
        """Keep a row of e^a, and give what looks at the next ticks: SINGULAR or GAUGE_LOST where this
        has to be called again. From a kinematic singularity on there is no e^a any more."""
        try:
            self._extended.auxiliary()
            self._keep_auxiliary()
        except SingularityError:
            return sequence(self._look)
        return sequence(self._look, self._extended.coordinates, self._keep_auxiliary)

    def _actuate(self, actuation: ActuationChain, tick: int) -> None:
        """Pass the command through the actuation, and keep what acts."""
        actuation.take(self._command)
        samples = self.samples
        if samples.applied is not None and samples.limited is not None:
            samples.applied[tick] = actuation.mean()
            samples.limited[tick] = actuation.limited
        # at the last tick and where torques arrive at ticks, there is nothing before it arrives
        self.plant.v[:] = actuation.early


def _checked_torque(torque: Any, like: Array) -> Array:
    """A controller's torque as an array of that shape."""
    try:
        array = np.asarray(torque, dtype=float)
    except (TypeError, ValueError) as error:
        raise UsageError(f"the controller's torque is {torque!r}: it must be numbers") from error
    if array.shape != like.shape:
        raise UsageError(
            f"the controller's torque has shape {array.shape}; the robot has {len(like)} motors"
        )
    return array


@kernel
def _look(
    tick: Index,
    q: Vector,
    z: Vector,
    tip: Vector,
    p_d: Matrix,
    A: Matrix,
    q_dot: Vector,
    largest: Vector,
    q_rows: Matrix,
    z_rows: Matrix,
    tip_rows: Matrix,
    desired_rows: Matrix,
    rolling: Vector,
    per_limit: Vector,
    ratio_rows: Vector,
) -> int:
    """Write the tick's row of what is kept; a :class:`Divergence`. Until then, the largest entry of
    A q' is kept, which should be rounding only, and the tick's largest |q'| over its limit: whether
    the wheels slip or not, they turn so."""
    row = tick[0]
    for i in range(q.shape[0]):
        q_rows[row, i] = q[i]
    for i in range(z.shape[0]):
        z_rows[row, i] = z[i]
    for i in range(tip_rows.shape[1]):
        tip_rows[row, i] = tip[i]
        desired_rows[row, i] = p_d[0, i]
    status = divergence(q, z, tip, p_d)
    if status == 0:
        for i in range(A.shape[0]):
            largest[0] = max(largest[0], abs(dot(A[i], q_dot)))
        for i in range(rolling.shape[0]):
            ratio_rows[row] = max(ratio_rows[row], abs(rolling[i]) * per_limit[i])
    return status


@kernel
def _look_at_turn(
    tick: Index, turn: Turn, p_d: Matrix, rows: Matrix, desired_rows: Matrix, error_rows: Matrix
) -> int:
    """Write the tick's row of the orientation; a :class:`Divergence`. Half a turn is none here."""
    row, pose = tick[0], error_rows.shape[1] == 3
    status = pose_error(turn, p_d) if pose else pointing_error(turn, p_d)
    for i in range(rows.shape[1]):
        rows[row, i] = turn.tip[i] if pose else turn.omega[1, i]
        desired_rows[row, i] = p_d[0, 3 + i]
    for i in range(error_rows.shape[1]):
        error_rows[row, i] = turn.e[i]
    return Divergence.NOT_UNIT.value if status == NOT_UNIT else 0


@kernel
def _keep_finite(tick: Index, vector: Vector, rows: Matrix) -> int:
    """Write the tick's row of a vector; 1 if an entry is not finite."""
    for i in range(vector.shape[0]):
        if not math.isfinite(vector[i]):
            return 1
        rows[tick[0], i] = vector[i]
    return 0


@kernel
def _keep_from(tick: Index, vector: Vector, first: int, rows: Matrix) -> None:
    """Write the tick's row of a vector's entries from ``first`` on."""
    for i in range(rows.shape[1]):
        rows[tick[0], i] = vector[first + i]
