"""The closed loop: measure, control, hold the torque, integrate the plant; and record."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from datetime import UTC, datetime
from time import perf_counter
from typing import Any

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.controllers.protocol import Controller
from mobman.errors import SingularityError, UsageError
from mobman.kernels.dense import dot
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call, program
from mobman.model.build import load_robot
from mobman.model.criterion import Criterion
from mobman.model.extended_jacobian import ExtendedJacobian
from mobman.model.extended_kernels import GAUGE_LOST, SINGULAR
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.simulation.actuation.chain import ActuationChain
from mobman.simulation.arguments import (
    checked_seed,
    resolved_controller,
    resolved_plant,
    resolved_scenario,
    seconds,
    whole_ticks,
)
from mobman.simulation.asked.robot import urdf_asked
from mobman.simulation.asked.run import run_asked
from mobman.simulation.divergence import divergence_reason, divergence_step
from mobman.simulation.integrator import RungeKutta
from mobman.simulation.measurement import Measurement
from mobman.simulation.metrics.metric import Run, compute_metrics
from mobman.simulation.plant import Plant, require_success
from mobman.simulation.provenance import versions
from mobman.simulation.record import OWN_PLACES, Record
from mobman.simulation.samples import Samples, keep, keep_finite, keep_from
from mobman.simulation.scenario import Scenario
from mobman.tasks.criteria.posture import Posture
from mobman.tasks.task import Task, make_task, task_map_of, task_steps

_LARGEST_STEP = 1e-3  # s: the plant's integration step is at most this

APPLIED = "torque_applied"
"""The signal of the torque that acts, where the scenario's actuation makes it another one."""

Observer = Callable[[float, Array, Array, Array], None]
"""Is given t (s), q, z and the torque at a tick; the arrays are its own."""


def simulate(
    robot: MobileManipulator | str | os.PathLike[str],
    controller: Controller | str,
    task: Task | str,
    *,
    duration: float,
    dt: float = 1e-3,
    q0: Array | None = None,
    plant: MobileManipulator | Scenario | str | os.PathLike[str] | None = None,
    scenario: Scenario | str | os.PathLike[str] | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
    observe: Observer | None = None,
    observe_every: float = 1.0 / 60.0,
) -> Record:
    """Run a closed loop and record it.

    The torque is computed every ``dt`` and held while the plant is integrated (RK4, steps of at most
    1 ms). The robot starts at rest with v = 0. A run that diverges, or meets a singularity that its
    law cannot pass, ends there: the record says when and why.

    Args:
        robot: The robot that the controller supposes; by name, TOML file or object.
        controller: By name, with default gains, or an object; see :class:`Controller`.
        task: By name or object; see :class:`Task`.
        duration: s.
        dt: Sampling period (s).
        q0: Start (m, rad), shape (nq,); ``robot.q_rest`` by default.
        plant: The true robot: an object, or the scenario (or its name) whose masses, inertias and
            payload it has. By default the robot, with those of ``scenario``.
        scenario: How the plant and its sensors differ from what the controller supposes; by name,
            TOML file or object. Nominal by default.
        seed: Of all randomness in the scenario.
        progress: Called with the fraction done, about a hundred times.
        observe: Called with t, q, z and the torque, copies of them, as the run goes.
        observe_every: How much simulated time there is from one call to the next (s), to the nearest
            tick.

    Raises:
        UnknownNameError: If a name is not registered.
        UsageError: If an argument makes no sense.
    """
    if not isinstance(robot, MobileManipulator):
        robot = load_robot(robot)
    given = (controller, task)
    controller = resolved_controller(controller)
    duration, dt = seconds("duration", duration), seconds("dt", dt)
    ticks = whole_ticks(duration, dt)
    stride = max(1, round(seconds("observe_every", observe_every) / dt))
    seed = checked_seed(seed)
    start = robot.q_rest.copy() if q0 is None else robot.checked_configuration(q0)
    task = make_task(task, robot, start) if isinstance(task, str) else task
    resolved = resolved_scenario(scenario)
    random = np.random.default_rng(seed)
    true = resolved_plant(robot, plant, resolved, random)
    task_map = task_map_of(task)
    if robot.nz < task_map.m:
        raise UsageError(
            f"robot {robot.name!r} has {robot.nz} degrees of freedom for a task of {task_map.m}"
        )
    loop = _Loop(
        robot=robot,
        controller=controller,
        task=task,
        task_map=task_map,
        plant=resolved.plant(robot, true, random),
        measurement=resolved.measurement(robot, dt, random),
        actuation=resolved.actuation_chain(robot, dt, random),
        q0=start,
        ticks=ticks,
        dt=dt,
        progress=progress,
        observe=observe,
        stride=stride,
    )
    samples = loop.run()
    record = loop.record(samples)
    record.scenario = resolved.name
    record.seed = seed
    record.spec = {
        "controller": record.controller,
        "task": record.task,
        **run_asked(
            robot=robot,
            controller=(given[0], controller),
            task=(given[1], task),
            plant=(plant, true),
            scenario=resolved,
            duration=duration,
            dt=dt,
            q0=start,
            seed=seed,
        ),
    }
    record.urdf = urdf_asked(robot, plant)
    return record


class _Loop:
    """One run's parts."""

    def __init__(
        self,
        *,
        robot: MobileManipulator,
        controller: Controller,
        task: Task,
        task_map: TaskMap,
        plant: Plant,
        measurement: Measurement,
        actuation: ActuationChain | None,
        q0: Array,
        ticks: int,
        dt: float,
        progress: Callable[[float], None] | None,
        observe: Observer | None,
        stride: int,
    ) -> None:
        self.robot, self.controller, self.task = robot, controller, task
        self.task_map, self.plant, self.measurement = task_map, plant, measurement
        self.ticks, self.dt, self.progress = ticks, dt, progress
        self.observe, self.stride = observe, stride
        self.substeps = _steps_of(dt)
        plant.require_followed(q0, dt / self.substeps)
        self.samples = Samples(ticks + 1, plant.robot, task_map.m)
        self.state = RungeKutta(plant, q0, np.zeros(robot.nz), dt / self.substeps)
        self.actuation = actuation
        self.command = plant.v if actuation is None else np.zeros(robot.nz)
        if actuation is not None:
            self.samples.keep_applied()
        self._t, self._tick = np.zeros(1), np.zeros(1, dtype=np.int64)
        self._z_dot, self._residual = np.zeros(robot.nz), np.zeros(1)
        self._look = program(self._looking())
        self._evaluation = [
            *self._looking(),
            *plant.dynamics_steps(),
            *plant.friction_steps(),
            plant.acceleration_step(self._z_dot, np.zeros(1)),
        ]
        self._runs_away = program(
            [divergence_step(plant.now.q, plant.now.z, np.zeros(3), np.zeros((4, 3)))]
        )
        self._signals: Callable[[], dict[str, Any]] = getattr(controller, "signals", dict)

    def _looking(self) -> list[Call]:
        """The steps that keep a row of the state, or report why it counts as diverged."""
        now, samples, p_d = self.plant.now, self.samples, np.zeros((4, self.task_map.m))
        q_dot, moving = now.q_dot, []
        if self.plant.slips:
            q_dot = np.zeros_like(now.q_dot)
            moving = self.plant.motion_steps(q_dot)
        return [
            *now.tip_steps(),
            *now.constraint_steps(),
            *task_steps(self.task, self._t, p_d),
            call(
                keep,
                *(self._tick, now.q, now.z, now.tip, p_d),
                *(samples.q, samples.z, samples.tip, samples.desired),
            ),
            divergence_step(now.q, now.z, now.tip, p_d),
            *moving,
            call(largest_residual, now.A, q_dot, self._residual),
        ]

    def run(self) -> Samples:
        """From rest at q0 to the end, or to where it cannot go on."""
        samples = self.samples
        try:
            # what overflows is found by its result
            with np.errstate(all="ignore"):
                self._begin()
                self._go()
        except (SingularityError, np.linalg.LinAlgError) as error:
            samples.status = "singular"
            samples.message = f"at t = {self._tick[0] * self.dt:.6g} s: {error}"
        samples.work = float(self.state.work[0])
        if self.progress is not None:
            self.progress(1.0)
        return samples

    def _begin(self) -> None:
        """Keep the start, whatever happens next, so that no record is empty; start the controller."""
        samples, plant = self.samples, self.plant
        plant.now.run_all()
        self._look()
        samples.torque[0], samples.compute_time[0] = plant.v, 0.0
        samples.count = 1
        self.controller.reset(self.robot, self.task, self.dt)
        criterion = _criterion_of(self.controller, self.robot)
        self._auxiliary = ExtendedJacobian(plant.robot, self.task_map, criterion, plant.now)
        auxiliary_steps = [
            *self._auxiliary.auxiliary_steps(),
            call(keep_from, self._tick, self._auxiliary.f, self.task_map.m, samples.auxiliary),
        ]
        self._keep_auxiliary = program(auxiliary_steps)
        self._evaluate = program([*self._evaluation, *auxiliary_steps])
        self._keep = program(self._keeping())
        self._resolve_auxiliary()

    def _go(self) -> None:
        """Tick by tick: look, control, integrate."""
        # local names, since these run at every tick
        samples, plant, now = self.samples, self.plant, self.plant.now
        ticks, dt, t_now, tick_now = self.ticks, self.dt, self._t, self._tick
        run_all, measure, step = now.run_all, self.measurement.take, self.controller.step
        q, z, z_dot, v, compute_time = now.q, now.z, self._z_dot, self.command, samples.compute_time
        keep_row, integrate, shape, double = self._keep, self._integrator(), v.shape, v.dtype
        every = max(1, ticks // 100)
        observe, stride = self.observe, self.stride
        for tick in range(ticks + 1):
            t = tick * dt
            t_now[0] = t
            tick_now[0] = tick
            run_all()
            if plant.disturbed:
                plant.disturb(t)
            if (status := self._evaluate()) and self._ends(t, status):
                return
            q_now, z_now, measured = measure(q, z, z_dot)
            started = perf_counter()
            torque = step(t, q_now, z_now, measured)
            compute_time[tick] = perf_counter() - started
            if type(torque) is not np.ndarray or torque.shape != shape or torque.dtype != double:
                torque = _checked_torque(torque, v)
            v[:] = torque
            if keep_row():
                self._diverged(t, "the controller's torque is not finite")
                return
            if self.actuation is not None:
                self._actuate(self.actuation, tick)
            if self._signals is not dict:
                self._keep_signals(tick)
            if observe is not None and tick % stride == 0:
                observe(t, q.copy(), z.copy(), v.copy())
            if tick < ticks:
                integrate(t)
                if samples.status != "ok":
                    return
            samples.count = tick + 1
            if self.progress is not None and tick % every == 0:
                self.progress(tick / ticks)

    def _ends(self, t: float, status: int) -> bool:
        """Whether the run ends with that status of the evaluation.

        Raises:
            SingularityError: If the plant's inertia is not positive definite.
        """
        samples, tick = self.samples, self._tick[0]
        if status in (GAUGE_LOST, SINGULAR):
            self._resolve_auxiliary()
            return False
        error = samples.tip[tick] - samples.desired[tick]
        if (reason := divergence_reason(status, self.plant.now.z, error)) is None:
            require_success(status)
        self._diverged(t, str(reason))
        return True

    def _resolve_auxiliary(self) -> None:
        """Keep a row of e^a whatever it takes; none any more from a kinematic singularity on."""
        try:
            while status := self._keep_auxiliary():
                self._auxiliary.resolve(status)
        except SingularityError:
            self._evaluate = program(self._evaluation)

    def _actuate(self, actuation: ActuationChain, tick: int) -> None:
        """From the command to what acts on the plant."""
        actuation.take(self.command)
        samples = self.samples
        if samples.applied is not None and samples.limited is not None:
            samples.applied[tick] = actuation.mean()
            samples.limited[tick] = actuation.limited
        # at the last tick and where torques arrive at ticks, there is nothing before it arrives
        self.plant.v[:] = actuation.early

    def _integrator(self) -> Callable[[float], None]:
        """:meth:`_integrate`; in two parts, if torques arrive between ticks."""
        actuation = self.actuation
        if actuation is None or not actuation.split:
            return self._integrate
        first, second = actuation.split * self.dt, (1.0 - actuation.split) * self.dt
        steps = _steps_of(first), _steps_of(second)
        before, after = self.state.of_step(first / steps[0]), self.state.of_step(second / steps[1])

        def to_the_next(t: float) -> None:
            self._advance(before, t, first, steps[0])
            if self.samples.status == "ok":
                self.plant.v[:] = actuation.late
                self._advance(after, t + first, second, steps[1], evaluated=False)

        return to_the_next

    def _integrate(self, t: float) -> None:
        """To the next tick."""
        self._advance(self.state, t, self.dt, self.substeps)

    def _advance(
        self, state: RungeKutta, t: float, length: float, steps: int, evaluated: bool = True
    ) -> None:
        """From t on in so many steps; the dynamics are evaluated at the state already, or not."""
        now = self.plant.now
        try:
            if not evaluated:
                state.evaluate(t)
            state.step(t)
            for substep in range(1, steps):
                later = t + substep * length / steps
                state.evaluate(later)
                state.step(later)
        except SingularityError:
            # far and fast enough, rounding makes M indefinite before anything overflows
            if (reason := divergence_reason(self._runs_away(), now.z, np.zeros(3))) is None:
                raise
            self._diverged(t + length, reason)

    def _diverged(self, t: float, reason: str) -> None:
        self.samples.status, self.samples.message = "diverged", f"at t = {t:.6g} s: {reason}"

    def _keep_signals(self, tick: int) -> None:
        for name, value in self._signals().items():
            self._rows_of(name, np.shape(value))[tick] = value

    def _rows_of(self, name: str, shape: tuple[int, ...]) -> Array:
        kept = self.samples.signals
        if name not in kept:
            if name.split("/")[0] in {*OWN_PLACES, APPLIED}:
                raise UsageError(f"the signal {name!r} has the name of a record's own part")
            kept[name] = np.full((self.ticks + 1, *shape), np.nan)
        return kept[name]

    def _keeping(self) -> list[Call]:
        """The steps that keep a row of the torque and of the signals that are overwritten in place."""
        steps = [call(keep_finite, self._tick, self.command, self.samples.torque)]
        if getattr(self.controller, "signals_in_place", False):
            for name, value in self._signals().items():
                rows = self._rows_of(name, value.shape)
                flat = (value.reshape(-1), 0, rows.reshape(len(rows), -1))
                steps.append(call(keep_from, self._tick, *flat))
            self._signals = dict
        return steps

    def record(self, samples: Samples) -> Record:
        """The samples with what is measured of them."""
        n = samples.count
        q, z = samples.q[:n], samples.z[:n]
        t = np.arange(n, dtype=float) * float(self.dt)
        task_error = samples.tip[:n] - samples.desired[:n]
        auxiliary = samples.auxiliary[:n]
        criterion = _criterion_of(self.controller, self.robot)
        run = Run(
            completed=samples.status == "ok",
            duration=self.ticks * self.dt,
            dt=self.dt,
            t=t,
            q=q,
            z=z,
            torque=(samples.torque if samples.applied is None else samples.applied)[:n],
            task_error=task_error,
            auxiliary_error=auxiliary,
            compute_time=samples.compute_time[:n],
            work=samples.work,
            constraint_residual=float(self._residual[0]),
            robot=self.robot,
            plant=self.plant.robot,
            task=self.task,
            task_map=self.task_map,
            criterion=criterion,
            limited=None if samples.limited is None else samples.limited[:n],
        )
        settings: dict[str, Any] = getattr(self.controller, "settings", dict)()
        signals = {name: values[:n] for name, values in samples.signals.items()}
        if samples.applied is not None:
            signals[APPLIED] = run.torque
        return Record(
            t=t,
            q=q,
            z=z,
            torque=samples.torque[:n],
            tip_position=samples.tip[:n],
            tip_desired=samples.desired[:n],
            task_error=task_error,
            auxiliary_error=auxiliary,
            compute_time=run.compute_time,
            signals=signals,
            metrics=compute_metrics(run),
            status=samples.status,
            message=samples.message,
            robot=self.robot.name,
            controller=_name_of(self.controller),
            task=_name_of(self.task),
            scenario="",
            seed=0,
            spec={},
            settings=settings,
            versions=versions(),
            urdf_sha256=self.robot.urdf.sha256(),
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            joint_names=list(self.robot.joint_names),
            velocity_names=list(self.robot.velocity_names),
        )


def _steps_of(length: float) -> int:
    """Number of integration steps in so many seconds."""
    return max(1, math.ceil(length / _LARGEST_STEP - 1e-9))


def _criterion_of(controller: Controller, robot: MobileManipulator) -> Criterion:
    criterion: Criterion | None = getattr(controller, "criterion", None)
    return Posture.of(robot) if criterion is None else criterion


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


def _name_of(thing: object) -> str:
    return str(getattr(thing, "name", type(thing).__name__))


@kernel
def largest_residual(A: Matrix, q_dot: Vector, largest: Vector) -> None:
    """The largest entry of A q' up to now; it should be rounding only."""
    for i in range(A.shape[0]):
        largest[0] = max(largest[0], abs(dot(A[i], q_dot)))
