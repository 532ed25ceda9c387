"""The closed loop: measure, control, hold the torque, integrate the plant; and record."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from time import perf_counter
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.protocol import Controller
from mobman.errors import SingularityError, UsageError
from mobman.model.build import load_robot
from mobman.model.criterion import Criterion
from mobman.model.extended_jacobian import auxiliary_coordinates
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.simulation.accelerometer import Accelerometer
from mobman.simulation.arguments import (
    checked_seed,
    plant_name,
    resolved_controller,
    resolved_plant,
    resolved_scenario,
    seconds,
    whole_ticks,
)
from mobman.simulation.integrator import State, rk4_step
from mobman.simulation.metrics.metric import Run, compute_metrics
from mobman.simulation.plant import Plant
from mobman.simulation.provenance import versions
from mobman.simulation.record import OWN_PLACES, Record
from mobman.simulation.scenario import Scenario
from mobman.tasks.criteria.posture import Posture
from mobman.tasks.task import Task, make_task, task_map_of, task_parameters

_LARGEST_STEP = 1e-3  # s: the plant's integration step is at most this
_FASTEST = 1e4  # 1/s or m/s: a reduced velocity beyond it has diverged
_FARTHEST = 1e3  # m: a task error beyond it has diverged


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

    Raises:
        UnknownNameError: If a name is not registered.
        UsageError: If an argument makes no sense.
    """
    if not isinstance(robot, MobileManipulator):
        robot = load_robot(robot)
    controller = resolved_controller(controller)
    duration, dt = seconds("duration", duration), seconds("dt", dt)
    ticks = whole_ticks(duration, dt)
    seed = checked_seed(seed)
    start = robot.q_rest.copy() if q0 is None else robot.checked_configuration(q0)
    task = make_task(task, robot, start) if isinstance(task, str) else task
    resolved = resolved_scenario(scenario)
    true = resolved_plant(robot, plant, resolved)
    task_map = task_map_of(task)
    if robot.nz < task_map.m:
        raise UsageError(
            f"robot {robot.name!r} has {robot.nz} degrees of freedom for a task of {task_map.m}"
        )
    random = np.random.default_rng(seed)
    loop = _Loop(
        robot=robot,
        controller=controller,
        task=task,
        task_map=task_map,
        plant=Plant(true, resolved.disturbance(robot.motor_inertia(robot.q_rest), random)),
        accelerometer=Accelerometer(resolved.acceleration, dt),
        ticks=ticks,
        dt=dt,
        progress=progress,
    )
    samples = loop.run(start)
    record = loop.record(samples)
    record.scenario = resolved.name
    record.seed = seed
    record.spec = {
        "robot": robot.spec.model_dump(mode="json", by_alias=True),
        "controller": record.controller,
        "task": record.task,
        "task_parameters": task_parameters(task),
        "scenario": resolved.model_dump(mode="json"),
        "plant": plant_name(plant),
        "plant_masses": [float(link.mass) for link in list(true.model.inertias)[1:]],
        "duration": duration,
        "dt": dt,
        "q0": start.tolist(),
        "seed": seed,
    }
    return record


@dataclass
class _Samples:
    """What the loop leaves, one row a tick."""

    q: Array
    z: Array
    torque: Array
    tip: Array
    desired: Array
    compute_time: Array
    signals: dict[str, Array]
    count: int = 0
    work: float = 0.0
    status: str = "ok"
    message: str = ""


@dataclass
class _Loop:
    """One run's parts."""

    robot: MobileManipulator
    controller: Controller
    task: Task
    task_map: TaskMap
    plant: Plant
    accelerometer: Accelerometer
    ticks: int
    dt: float
    progress: Callable[[float], None] | None

    def __post_init__(self) -> None:
        self.substeps = max(1, math.ceil(self.dt / _LARGEST_STEP - 1e-9))

    def run(self, q0: Array) -> _Samples:
        """From rest at q0 to the end, or to where it cannot go on."""
        robot, n = self.robot, self.ticks + 1
        samples = _Samples(
            q=np.empty((n, robot.nq)),
            z=np.empty((n, robot.nz)),
            torque=np.empty((n, robot.nz)),
            tip=np.empty((n, self.task_map.m)),
            desired=np.empty((n, self.task_map.m)),
            compute_time=np.empty(n),
            signals={},
        )
        state = State(q0.copy(), np.zeros(robot.nz), 0.0)
        torque = np.zeros(robot.nz)
        every = max(1, self.ticks // 100)
        # what overflows is found below, by its result
        with np.errstate(all="ignore"):
            for tick in range(n):
                try:
                    if tick == 0:
                        self._begin(samples, state, torque)
                        self.controller.reset(robot, self.task, self.dt)
                    state, torque = self._tick(samples, tick, state, torque)
                except (SingularityError, np.linalg.LinAlgError) as error:
                    samples.status = "singular"
                    samples.message = f"at t = {tick * self.dt:.6g} s: {error}"
                    break
                if samples.status != "ok":
                    break
                samples.count = tick + 1
                if self.progress is not None and tick % every == 0:
                    self.progress(tick / self.ticks)
        samples.work = state.work
        if self.progress is not None:
            self.progress(1.0)
        return samples

    def _begin(self, samples: _Samples, state: State, held: Array) -> None:
        """Keep the start, whatever happens next, so that no record is empty."""
        samples.q[0], samples.z[0], samples.torque[0] = state.q, state.z, held
        samples.tip[0], samples.desired[0] = self._tip_and_desired(0.0, state.q)
        samples.compute_time[0] = 0.0
        samples.count = 1

    def _tip_and_desired(self, t: float, q: Array) -> tuple[Array, Array]:
        tip = np.asarray(self.plant.robot.tip_pose(q).translation)
        return tip[list(self.task_map.rows)], np.asarray(self.task.desired(t)[0], dtype=float)

    def _tick(self, samples: _Samples, tick: int, state: State, held: Array) -> tuple[State, Array]:
        t = tick * self.dt
        q, z, _ = state
        tip, desired = self._tip_and_desired(t, q)
        if reason := _divergence(q, z, tip - desired):
            samples.status, samples.message = "diverged", f"at t = {t:.6g} s: {reason}"
            return state, held
        instant = self.plant.at(t, q, z)
        z_dot = self.accelerometer.measure(z, instant.acceleration(held))
        started = perf_counter()
        torque = self.controller.step(t, q.copy(), z.copy(), z_dot)
        elapsed = perf_counter() - started
        torque = _as_torque(torque)
        if torque.shape != held.shape:
            raise UsageError(
                f"the controller's torque has shape {torque.shape}; the robot has {len(held)} motors"
            )
        if not np.all(np.isfinite(torque)):
            samples.status = "diverged"
            samples.message = f"at t = {t:.6g} s: the controller's torque is not finite"
            return state, held
        samples.q[tick], samples.z[tick], samples.torque[tick] = q, z, torque
        samples.tip[tick], samples.desired[tick] = tip, desired
        samples.compute_time[tick] = elapsed
        self._keep_signals(samples, tick)
        if tick == self.ticks:
            return state, torque
        h = self.dt / self.substeps
        state = rk4_step(self.plant, t, state, torque, h, instant)
        for substep in range(1, self.substeps):
            state = rk4_step(self.plant, t + substep * h, state, torque, h)
        return state, torque

    def _keep_signals(self, samples: _Samples, tick: int) -> None:
        signals = getattr(self.controller, "signals", None)
        if signals is None:
            return
        for name, value in signals().items():
            if name not in samples.signals:
                if name.split("/")[0] in OWN_PLACES:
                    raise UsageError(f"the signal {name!r} has the name of a record's own part")
                samples.signals[name] = np.full((self.ticks + 1, *np.shape(value)), np.nan)
            samples.signals[name][tick] = value

    def record(self, samples: _Samples) -> Record:
        """The samples with what is measured of them."""
        n = samples.count
        q, z = samples.q[:n], samples.z[:n]
        t = np.arange(n, dtype=float) * float(self.dt)
        task_error = samples.tip[:n] - samples.desired[:n]
        criterion: Criterion = getattr(self.controller, "criterion", None) or Posture.of(self.robot)
        auxiliary = _auxiliary_errors(self.robot, self.task_map, criterion, q)
        run = Run(
            completed=samples.status == "ok",
            duration=self.ticks * self.dt,
            dt=self.dt,
            t=t,
            q=q,
            z=z,
            torque=samples.torque[:n],
            task_error=task_error,
            auxiliary_error=auxiliary,
            compute_time=samples.compute_time[:n],
            work=samples.work,
            robot=self.robot,
            plant=self.plant.robot,
            task=self.task,
            task_map=self.task_map,
            criterion=criterion,
        )
        settings: dict[str, Any] = getattr(self.controller, "settings", dict)()
        return Record(
            t=t,
            q=q,
            z=z,
            torque=run.torque,
            tip_position=samples.tip[:n],
            tip_desired=samples.desired[:n],
            task_error=task_error,
            auxiliary_error=auxiliary,
            compute_time=run.compute_time,
            signals={name: values[:n] for name, values in samples.signals.items()},
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


def _auxiliary_errors(
    robot: MobileManipulator, task_map: TaskMap, criterion: Criterion, q: Array
) -> Array:
    """e^a along a motion, shape (len(q), nz - m); NaN from a kinematic singularity on."""
    errors = np.full((len(q), robot.nz - task_map.m), np.nan)
    complement = None
    for i, configuration in enumerate(q):
        try:
            errors[i], complement = auxiliary_coordinates(
                robot, task_map, criterion, configuration, complement
            )
        except SingularityError:
            break
    return errors


def _divergence(q: Array, z: Array, error: Array) -> str:
    """Why the state counts as diverged; empty if it does not."""
    if not (np.all(np.isfinite(q)) and np.all(np.isfinite(z))):
        return "the state is not finite"
    if not np.all(np.isfinite(error)):
        return "the desired trajectory is not finite"
    if np.abs(z).max() > _FASTEST:
        return f"|z| is {np.abs(z).max():.3g}, above {_FASTEST:g}"
    if np.abs(error).max() > _FARTHEST:
        return f"|e^e| is {np.abs(error).max():.3g} m, above {_FARTHEST:g} m"
    return ""


def _as_torque(torque: Any) -> Array:
    try:
        return np.array(torque, dtype=float)
    except (TypeError, ValueError) as error:
        raise UsageError(f"the controller's torque is {torque!r}: it must be numbers") from error


def _name_of(thing: object) -> str:
    return str(getattr(thing, "name", type(thing).__name__))
