"""A run of a closed loop, from what it is asked for to its record."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np

from mobman.arrays import Array
from mobman.controllers.protocol import Controller
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.arguments import (
    checked_seed,
    fitting_task_map,
    resolved_controller,
    resolved_plant,
    resolved_scenario,
    seconds,
    whole_ticks,
)
from mobman.simulation.asked.robot import urdf_asked
from mobman.simulation.asked.run import run_asked
from mobman.simulation.loop import Loop, Observer
from mobman.simulation.record import Record
from mobman.simulation.recording import recorded
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import Task, make_task


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
    law = resolved_controller(controller)
    duration, dt = seconds("duration", duration), seconds("dt", dt)
    ticks = whole_ticks(duration, dt)
    stride = max(1, round(seconds("observe_every", observe_every) / dt))
    seed = checked_seed(seed)
    start = robot.q_rest.copy() if q0 is None else robot.checked_configuration(q0)
    aim = make_task(task, robot, start) if isinstance(task, str) else task
    resolved = resolved_scenario(scenario)
    random = np.random.default_rng(seed)
    true = resolved_plant(robot, plant, resolved, random)
    loop = Loop(
        robot=robot,
        controller=law,
        task=aim,
        task_map=fitting_task_map(aim, robot),
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
    loop.run()
    asked = run_asked(
        robot=robot,
        controller=(controller, law),
        task=(task, aim),
        plant=(plant, true),
        scenario=resolved,
        duration=duration,
        dt=dt,
        q0=start,
        seed=seed,
    )
    urdf = urdf_asked(robot, plant)
    return recorded(loop, scenario=resolved.name, seed=seed, asked=asked, urdf=urdf)
