"""Repeating a run from its record alone, and telling whether it is the same run."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.protocol import Controller
from mobman.errors import MobmanError, RecordError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.arguments import resolved_plant, seconds, whole_ticks
from mobman.simulation.asked.controller import controller_again
from mobman.simulation.asked.robot import changed_since, check_plant, plant_again, robot_again
from mobman.simulation.asked.task import task_again
from mobman.simulation.closed_loop import simulate
from mobman.simulation.comparison import ELSEWHERE, Verification, compare, differing
from mobman.simulation.provenance import COMPUTING
from mobman.simulation.record import Record, load_record
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import Task
from mobman.toml_model import validate

__all__ = ["Own", "Verification", "repeat", "verify"]

Progress = Callable[[float], None]
_FEW = 1000  # ticks, which take less time than it takes to look


@dataclass(frozen=True)
class Own:
    """Parts of a run that its owner gives, since a file of unknown origin does not get to run code."""

    robot: MobileManipulator | None = None
    """The robot, for one whose platform is Python code."""
    controller: Controller | None = None
    """The controller, for one whose law is not registered."""
    make_task: Callable[[MobileManipulator, Array], Task] | None = None
    """What makes the task from the robot and q0, for one that is not registered."""


def repeat(
    path: str | os.PathLike[str], *, own: Own | None = None, progress: Progress | None = None
) -> Record:
    """Run again what is in a record's file, with nothing but the file.

    The robot is built from the description and the URDFs in the file; laws, tasks and types of platforms
    are those of this mobman and of what is registered here. Python code is never taken from a file: a
    platform that is code is that of the registered robot, if its description is the run's.

    Args:
        path: The file.
        own: Parts that are used instead of the file's.
        progress: Called with the fraction done.

    Returns:
        The new record, at every tick.

    Raises:
        RecordError: If the file is no record, or the run had a part that the file does not hold; says
            which.
    """
    return _repeated(load_record(path), Path(path), own or Own(), progress)


def verify(
    path: str | os.PathLike[str],
    *,
    tolerance: float | None = None,
    own: Own | None = None,
    progress: Progress | None = None,
) -> Verification:
    """Run again what is in a record's file, and compare.

    By default bit for bit; where the processor, the system or the version of a library that computes is
    another than the run's, within :data:`mobman.simulation.comparison.ELSEWHERE`.

    Args:
        path: The file.
        tolerance: The largest difference allowed, over the larger of 1 and the largest value of the
            dataset (or the metric), and 100 times as much in torques and signals; 0 for bit for bit,
            wherever it is run.
        own: As of :func:`repeat`.
        progress: Called with the fraction done.

    Raises:
        RecordError: As :func:`repeat`.
    """
    record = load_record(path)
    again = _repeated(record, Path(path), own or Own(), progress)
    machine = differing(record.machine, again.machine, again.machine)
    versions = differing(record.versions, again.versions, COMPUTING)
    if tolerance is None:
        tolerance = ELSEWHERE if machine or versions else 0.0
    return Verification(
        record=again,
        compared=compare(record, again, tolerance),
        tolerance=tolerance,
        machine=machine,
        versions=versions,
        note=changed_since(record.spec, record.urdf_sha256),
    )


def _repeated(record: Record, path: Path, own: Own, progress: Progress | None) -> Record:
    try:
        _check_length(record)
        again = _run(record.spec, record.urdf, own, progress)
    except MobmanError as error:
        raise RecordError(f"{path} cannot be repeated: {error}") from error
    except Exception as error:  # what is in the file may be anything
        raise RecordError(
            f"{path} cannot be repeated: what it says of the run is not whole "
            f"({' '.join(repr(error).split())})"
        ) from error
    again.spec, again.urdf = record.spec, record.urdf
    return again


def _check_length(record: Record) -> None:
    """
    Raises:
        RecordError: If the run would be much longer than the samples of the record, which went to its
            end: what is in the file must not decide how long this computes.
    """
    dt, duration = float(record.spec["dt"]), float(record.spec["duration"])
    ticks = whole_ticks(seconds("duration", duration), seconds("dt", dt))
    kept = len(record.t) * record.decimation
    if record.ok and ticks > 2 * kept + _FEW:
        raise RecordError(
            f"its {len(record.t)} samples, every {record.decimation}th kept, are not those of a run of "
            f"{duration:g} s at dt = {dt:g} s"
        )


def _run(
    spec: dict[str, Any], urdf: dict[str, bytes], own: Own, progress: Progress | None
) -> Record:
    given = {
        "its controller": own.controller is not None,
        "its task": own.make_task is not None,
        "the gains of its controller": own.controller is not None,
    }
    reasons = [
        reason
        for reason in spec["not_repeatable"]
        if not any(there and str(reason).startswith(part) for part, there in given.items())
    ]
    if reasons:
        raise RecordError("; ".join(map(str, reasons)))
    scenario = validate(Scenario, spec["scenario"], "its scenario")
    controller = controller_again(spec) if own.controller is None else own.controller
    robot = robot_again(spec, urdf, own.robot)
    q0 = robot.checked_configuration(np.array(spec["q0"], dtype=float))
    task = task_again(spec, robot, q0) if own.make_task is None else own.make_task(robot, q0)
    plant = plant_again(spec, urdf, robot)
    random = np.random.default_rng(spec["seed"])
    check_plant(resolved_plant(robot, plant, scenario, random), spec)
    return simulate(
        robot,
        controller,
        task,
        duration=spec["duration"],
        dt=spec["dt"],
        q0=q0,
        plant=plant,
        scenario=scenario,
        seed=spec["seed"],
        progress=progress,
    )
