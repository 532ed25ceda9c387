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
from mobman.controllers.protocol import Controller, make_controller, settings_of
from mobman.errors import UsageError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.provenance import versions
from mobman.simulation.loop import Loop, Observer
from mobman.simulation.metrics import Run, compute_metrics
from mobman.simulation.monitors import monitors, require_monitored
from mobman.simulation.parts import describe_run, urdfs_of_run
from mobman.simulation.record import Record
from mobman.simulation.record_file import APPLIED
from mobman.simulation.run_spec import RunSpec
from mobman.simulation.scenario import GivenPlant, Scenario, load_scenario, nominal
from mobman.simulation.singularity import verdict
from mobman.tasks.task import Task, make_task

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
    law = make_controller(controller) if isinstance(controller, str) else controller
    if isinstance(law, type) or not isinstance(law, Controller):
        raise UsageError(
            f"{law!r} is not a controller: expected methods reset(robot, task, dt) and "
            "step(t, q, z, z_dot) -> torque"
        )
    if not isinstance(monitor, (bool, np.bool_)):
        raise UsageError(f"monitor = {monitor!r}: must be True or False")
    if monitor:
        require_monitored(law)
    duration, dt = seconds("duration", duration), seconds("dt", dt)
    ticks = whole_ticks(duration, dt)
    stride = max(1, round(seconds("observe_every", observe_every) / dt))
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or not 0 <= seed < 2**63:
        raise UsageError(f"seed = {seed!r}: must be a whole number from 0 to 2^63 - 1")
    for name, function in (("observe", observe), ("progress", progress)):
        if function is not None and not callable(function):
            raise UsageError(f"{name} = {function!r}: expected a function")
    given = robot.q_rest if q0 is None else robot.checked_configuration(q0)
    aim = make_task(task, robot, given) if isinstance(task, str) else task
    if scenario is not None and not isinstance(scenario, (Scenario, str, os.PathLike)):
        raise UsageError(f"scenario = {scenario!r}: must be a scenario, its name or its file")
    if not isinstance(scenario, Scenario):
        scenario = nominal() if scenario is None else load_scenario(scenario)
    start = scenario.start_of(robot) if q0 is None else given
    numbers: dict[str, Any] = {"q0": start, "dt": dt, "seed": int(seed), "monitor": bool(monitor)}
    with worth_joining(ticks >= _MANY_TICKS):
        watching: dict[str, Any] = {"progress": progress, "observe": observe, "stride": stride}
        loop = Loop(robot, law, aim, scenario, plant, ticks=ticks, **watching, **numbers)
        loop.run()
        run = describe_run(
            robot=robot,
            controller=(controller, law),
            task=(task, aim),
            plant=(plant, loop.plant.robot),
            scenario=scenario,
            duration=duration,
            **numbers,
        )
        return _record(loop, run, urdfs_of_run(robot, plant))


def seconds(name: str, value: float) -> float:
    """A duration as a float; UsageError if it is not a number above 0 of a size that is allowed."""
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
    """The number of periods in a run; UsageError if there is none, or there are too many."""
    if duration > _LONGEST:
        raise UsageError(f"duration = {duration:g} s; allowed: up to {_LONGEST:g} s")
    ticks = round(duration / dt)
    if not 1 <= ticks <= _MOST_TICKS:
        raise UsageError(
            f"duration = {duration:g} s at dt = {dt:g} s is {duration / dt:.3g} ticks; allowed: 1 to "
            f"{_MOST_TICKS:g}"
        )
    return ticks


def _record(loop: Loop, run: RunSpec, urdf: dict[str, bytes]) -> Record:
    """The record of a run that is over."""
    samples, controller, robot = loop.samples, loop.controller, loop.robot
    kept, status, message = samples.filled(), samples.status, samples.message
    orientation_error, torque = kept.pop("orientation_error"), kept.pop("torque")
    kept.pop("applied", None)
    kept.setdefault("limited", np.zeros(samples.count, dtype=bool))
    tip = {name: kept.pop(name) for name in list(kept) if name.startswith("tip_")}
    error = tip["tip_position"] - tip["tip_desired"]
    if len(tip["tip_orientation"]):
        error = np.hstack([error, orientation_error])
    else:
        tip |= {"tip_orientation": None, "tip_desired_orientation": None}
    signals = {name: values[: samples.count] for name, values in samples.signals.items()}
    of_plant = {name: signals[name] for name in loop.plant.signals() if name in signals}
    own = {name: getattr(loop, name) for name in ("dt", "robot", "task", "task_map", "criterion")}
    done = Run(
        **kept,
        **own,
        completed=status == "ok",
        duration=loop.ticks * loop.dt,
        t=np.arange(samples.count, dtype=float) * float(loop.dt),
        torque=torque if samples.applied is None else samples.applied[: samples.count],
        task_error=error,
        work=samples.work,
        constraint_residual=float(loop.constraint_residual[0]),
        plant=loop.plant.robot,
        desired=tip["tip_desired"],
        signals=of_plant,
    )
    singularity: dict[str, Any] = {}
    if not done.completed:
        found = verdict(done, bool(getattr(controller, "extended", False)), samples.error)
        status = "singular" if found else "diverged"
        if found:
            message = "; ".join(filter(None, (message, str(found))))
            singularity = found.as_recorded()
    settings = settings_of(controller)
    if samples.applied is not None:
        signals[APPLIED] = done.torque
    if run.monitor:
        seen = {name: values for name, values in signals.items() if name.startswith("sliding/")}
        seen |= monitors(done, controller, seen, torque)
        done, signals = replace(done, signals=of_plant | seen), signals | seen
    sampled = ("t", "q", "z", "task_error", "auxiliary_error", "compute_time")
    return Record(
        **{name: getattr(done, name) for name in sampled},
        **{name: getattr(run, name) for name in ("robot", "task", "seed")},
        **tip,
        torque=torque,
        signals=signals,
        metrics=compute_metrics(done),
        status=status,
        message=message,
        singularity=singularity,
        controller=run.label,
        scenario=run.scenario["name"],
        spec=run.as_recorded(),
        settings=settings,
        versions=versions(),
        urdf_sha256=robot.urdf.sha256(),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        joint_names=list(robot.joint_names),
        velocity_names=list(robot.velocity_names),
        urdf=urdf,
    )
