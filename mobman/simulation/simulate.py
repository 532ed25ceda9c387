"""Simulation of a closed loop, from the request to the record."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from mobman.arrays import LARGEST, SMALLEST, Array
from mobman.compiled import worth_joining
from mobman.controllers.protocol import Controller, make_controller
from mobman.errors import UnknownNameError, UsageError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.provenance import versions
from mobman.simulation.loop import Loop, Observer
from mobman.simulation.metrics import Run, compute_metrics
from mobman.simulation.monitors import monitors, require_monitored
from mobman.simulation.parts import GivenPlant, describe_run, urdfs_of_run
from mobman.simulation.pieces import Setting
from mobman.simulation.record import Record
from mobman.simulation.record_file import APPLIED
from mobman.simulation.run_spec import RunSpec
from mobman.simulation.scenario import Scenario, list_scenarios, load_scenario
from mobman.simulation.singularity import verdict
from mobman.tasks.task import Task, make_task, task_map_of

_MOST_TICKS = 10_000_000  # a run keeps some 50 numbers of 8 bytes a tick: 4 GB
_LONGEST = 1e6  # s: in integration steps of at most 1 ms some hours of computing


_MANY_TICKS = 2000  # a run from which compiling its kernels together pays


def simulate(
    robot: MobileManipulator | str | os.PathLike[str],
    controller: Controller | str,
    task: Task | str,
    *,
    duration: float = 10.0,
    dt: float = 1e-3,
    q0: Array | None = None,
    plant: GivenPlant = None,
    scenario: Scenario | str | os.PathLike[str] | None = None,
    seed: int = 0,
    monitor: bool = False,
    progress: Callable[[float], None] | None = None,
    observe: Observer | None = None,
    observe_every: float = 1.0 / 60.0,
) -> Record:
    """Run a closed loop and record it.

    The torque is computed every ``dt`` and held while the plant is integrated (RK4, steps of at most
    1 ms). The robot starts at rest with v = 0. A run that diverges, or meets a singularity that its
    law cannot pass, ends there: the record says when and why.

    >>> import mobman as mm
    >>> record = mm.simulate("youbot", "tsm", "paper", duration=0.05, scenario="heavier")
    >>> record.status, record.metrics["torque_peak"] > 0.0
    ('ok', True)

    Args:
        robot: The robot that the controller supposes; by name, TOML file or object.
        controller: By name, with default gains, or an object; see :class:`Controller`.
        task: By name or object; see :class:`Task`.
        duration: Simulated time (s).
        dt: Sampling period (s).
        q0: Start (m, rad), shape (nq,); by default ``robot.q_rest``, which scenarios may displace.
        plant: The true robot: an object, or the scenario (or its name) whose masses, inertias and
            payload it has. By default the robot, with those of ``scenario``.
        scenario: How the plant and its sensors differ from what the controller supposes; by name,
            TOML file or object. Nominal by default.
        seed: Of all randomness in the scenario.
        monitor: Whether what the theorems suppose and conclude is recorded of a sliding law, in the
            group ``monitors``, see :mod:`mobman.simulation.monitors`.
        progress: Called with the fraction done, about a hundred times.
        observe: Called with t, q, z and the torque, copies of them, as the run goes.
        observe_every: How much simulated time there is from one call to the next (s), to the nearest
            tick.

    Returns:
        The record: samples of every tick, metrics, and what is needed to repeat the run.

    Raises:
        UnknownNameError: If a name is not registered.
        UsageError: If an argument makes no sense.
    """
    if not isinstance(robot, MobileManipulator):
        robot = load_robot(robot)
    law = _controller(controller)
    if monitor:
        require_monitored(law)
    duration, dt = seconds("duration", duration), seconds("dt", dt)
    ticks = whole_ticks(duration, dt)
    stride = max(1, round(seconds("observe_every", observe_every) / dt))
    seed = _seed(seed)
    for name, function in (("observe", observe), ("progress", progress)):
        if function is not None and not callable(function):
            raise UsageError(f"{name} = {function!r}: expected a function")
    given = robot.q_rest if q0 is None else robot.checked_configuration(q0)
    aim = make_task(task, robot, given) if isinstance(task, str) else task
    differences = _scenario(scenario)
    start = differences.start_of(robot) if q0 is None else given
    with worth_joining(ticks >= _MANY_TICKS):
        loop = closed_loop(
            *(robot, law, aim, differences, plant),
            q0=start,
            ticks=ticks,
            dt=dt,
            seed=seed,
            progress=progress,
            observe=observe,
            stride=stride,
            monitor=monitor,
        )
        loop.run()
    run = describe_run(
        robot=robot,
        controller=(controller, law),
        task=(task, aim),
        plant=(plant, loop.plant.robot),
        scenario=differences,
        duration=duration,
        dt=dt,
        q0=start,
        seed=seed,
        monitor=monitor,
    )
    return _record(loop, run, urdfs_of_run(robot, plant))


def closed_loop(
    robot: MobileManipulator,
    controller: Controller,
    task: Task,
    scenario: Scenario,
    plant: GivenPlant = None,
    *,
    dt: float,
    seed: int,
    **others: Any,
) -> Loop:
    """The closed loop that a run is, before it runs: of what :func:`simulate` is given, each an object,
    and of what else :class:`Loop` takes.

    Raises:
        UsageError: If a part does not fit the robot.
    """
    setting = Setting(robot, dt, np.random.default_rng(seed))
    true = true_plant(setting, plant, scenario)
    return Loop(
        robot=robot,
        controller=controller,
        task=task,
        task_map=_task_map(task, robot),
        plant=scenario.make_plant(setting, true),
        measurement=scenario.measurement(setting, true),
        tip_measured=scenario.tip == "measured",
        actuation=scenario.actuation_chain(setting),
        dt=dt,
        **others,
    )


def seconds(name: str, value: float) -> float:
    """A duration as a float.

    Raises:
        UsageError: If it is not a number above 0, or of a size that is not allowed.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(value, str) or not SMALLEST <= number <= LARGEST:
        raise UsageError(
            f"{name} = {value!r}: must be a number above 0, from {SMALLEST:g} to {LARGEST:g} s"
        )
    return number


def whole_ticks(duration: float, dt: float) -> int:
    """The number of periods in a run.

    Raises:
        UsageError: If there is none, or there are too many.
    """
    if duration > _LONGEST:
        raise UsageError(f"duration = {duration:g} s; allowed: up to {_LONGEST:g} s")
    ticks = round(duration / dt)
    if not 1 <= ticks <= _MOST_TICKS:
        raise UsageError(
            f"duration = {duration:g} s at dt = {dt:g} s is {duration / dt:.3g} ticks; allowed: 1 to "
            f"{_MOST_TICKS:g}"
        )
    return ticks


def true_plant(setting: Setting, plant: GivenPlant, scenario: Scenario) -> MobileManipulator:
    """The true robot: the nominal one, or the one given, with the scenario's masses and payload.

    Args:
        setting: With the nominal robot.
        plant: As given to :func:`simulate`.
        scenario: Gives the masses and payload, unless ``plant`` is a scenario.

    Raises:
        UnknownNameError: If a plant is named that is not a scenario.
        UsageError: If it has other joints, or is nothing of the kind.
        SpecError: If a piece of the scenario does not fit the robot.
    """
    base, changes = setting.robot, scenario
    if isinstance(plant, MobileManipulator):
        if plant.joint_names != base.joint_names:
            raise UsageError(f"the plant {plant.name!r} has other joints than {base.name!r}")
        base = plant
    elif isinstance(plant, Scenario):
        changes = plant
    elif isinstance(plant, (str, os.PathLike)):
        text = os.fspath(plant)
        if text not in list_scenarios() and not text.endswith(".toml"):
            raise UnknownNameError("plant", text, list_scenarios())
        changes = load_scenario(text)
    elif plant is not None:
        raise UsageError(
            f"plant = {plant!r}: must be a robot, a scenario, a scenario's name or its file"
        )
    return changes.true_robot(Setting(base, setting.dt, setting.random))


def _seed(seed: int) -> int:
    """A seed as a plain int.

    Raises:
        UsageError: If it is not a whole number from 0 to 2^63 - 1.
    """
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or not 0 <= seed < 2**63:
        raise UsageError(f"seed = {seed!r}: must be a whole number from 0 to 2^63 - 1")
    return int(seed)


def _controller(controller: Controller | str) -> Controller:
    """A controller by name, with default gains, or as it is.

    Raises:
        UnknownNameError: If there is no such name.
        UsageError: If it is neither a name nor a controller.
    """
    if isinstance(controller, str):
        return make_controller(controller)
    if isinstance(controller, type) or not isinstance(controller, Controller):
        raise UsageError(
            f"{controller!r} is not a controller: expected methods reset(robot, task, dt) and "
            "step(t, q, z, z_dot) -> torque"
        )
    return controller


def _scenario(scenario: Scenario | str | os.PathLike[str] | None) -> Scenario:
    """A scenario from whatever form the user has it in; the nominal one by default.

    Raises:
        UnknownNameError: If there is no such name.
        UsageError: If it is neither a scenario nor a name.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if scenario is not None and not isinstance(scenario, (str, os.PathLike)):
        raise UsageError(f"scenario = {scenario!r}: must be a scenario, its name or its file")
    return load_scenario("nominal" if scenario is None else scenario)


def _task_map(task: Task, robot: MobileManipulator) -> TaskMap:
    """The task map of a task that the robot has enough degrees of freedom for.

    Raises:
        UsageError: If it has not, or the task gives no such vectors.
    """
    task_map = task_map_of(task)
    if robot.nz < task_map.m:
        raise UsageError(
            f"robot {robot.name!r} has {robot.nz} degrees of freedom for a task of {task_map.m}"
            + ("; a task of position has 3" if task_map.m > 3 else "")
        )
    return task_map


def _record(loop: Loop, run: RunSpec, urdf: dict[str, bytes]) -> Record:
    """The record of a run that is over."""
    samples, controller, robot = loop.samples, loop.controller, loop.robot
    done = _run_of(loop)
    n = samples.count
    status, message = samples.status, samples.message
    singularity: dict[str, Any] = {}
    if not done.completed:
        extended = bool(getattr(controller, "extended", False))
        found = verdict(done, extended, samples.error)
        status = "singular" if found else "diverged"
        if found:
            message = "; ".join(filter(None, (message, str(found))))
            singularity = found.as_recorded()
    settings: dict[str, Any] = getattr(controller, "settings", dict)()
    signals = {name: values[:n] for name, values in samples.signals.items()}
    if samples.applied is not None:
        signals[APPLIED] = done.torque
    if run.monitor:
        own = {name: values for name, values in signals.items() if name.startswith("sliding/")}
        own |= monitors(done, controller, own, samples.torque[:n])
        done = replace(done, monitors=own)
        signals |= own
    return Record(
        t=done.t,
        q=done.q,
        z=done.z,
        torque=samples.torque[:n],
        tip_position=samples.tip[:n],
        tip_desired=samples.desired[:n],
        tip_orientation=samples.orientation[:n] if len(samples.orientation) else None,
        tip_desired_orientation=samples.desired_orientation[:n]
        if len(samples.orientation)
        else None,
        task_error=done.task_error,
        auxiliary_error=done.auxiliary_error,
        compute_time=done.compute_time,
        signals=signals,
        metrics=compute_metrics(done),
        status=status,
        message=message,
        singularity=singularity,
        robot=run.robot,
        controller=run.label,
        task=run.task,
        scenario=run.scenario["name"],
        seed=run.seed,
        spec=run.as_recorded(),
        settings=settings,
        versions=versions(),
        urdf_sha256=robot.urdf.sha256(),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        joint_names=list(robot.joint_names),
        velocity_names=list(robot.velocity_names),
        urdf=urdf,
    )


def _run_of(loop: Loop) -> Run:
    """The run as metrics see it."""
    samples = loop.samples
    n = samples.count
    error = samples.tip[:n] - samples.desired[:n]
    if len(samples.orientation):
        error = np.hstack([error, samples.orientation_error[:n]])
    return Run(
        completed=samples.status == "ok",
        duration=loop.ticks * loop.dt,
        dt=loop.dt,
        t=np.arange(n, dtype=float) * float(loop.dt),
        q=samples.q[:n],
        z=samples.z[:n],
        torque=(samples.torque if samples.applied is None else samples.applied)[:n],
        task_error=error,
        auxiliary_error=samples.auxiliary[:n],
        compute_time=samples.compute_time[:n],
        work=samples.work,
        constraint_residual=loop.constraint_residual,
        robot=loop.robot,
        plant=loop.plant.robot,
        task=loop.task,
        task_map=loop.task_map,
        criterion=loop.criterion,
        limited=None if samples.limited is None else samples.limited[:n],
        velocity_ratio=samples.velocity_ratio[:n],
        desired=samples.desired[:n],
        ground={name: samples.signals[name][:n] for name in loop.plant.signals()},
    )
