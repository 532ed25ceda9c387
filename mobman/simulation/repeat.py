"""Repeating a run from its record alone, and telling whether it is the same run."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mobman.errors import MobmanError, RecordError
from mobman.simulation.arguments import resolved_plant
from mobman.simulation.asked.controller import controller_again
from mobman.simulation.asked.robot import changed_since, check_plant, plant_again, robot_again
from mobman.simulation.asked.task import task_again
from mobman.simulation.closed_loop import simulate
from mobman.simulation.comparison import ELSEWHERE, Verification, compare, differing
from mobman.simulation.provenance import COMPUTING
from mobman.simulation.record import Record, load_record
from mobman.simulation.scenario import Scenario

__all__ = ["Verification", "repeat", "verify"]

Progress = Callable[[float], None]


def repeat(path: str | os.PathLike[str], *, progress: Progress | None = None) -> Record:
    """Run again what is in a record's file, with nothing but the file.

    The robot is built from the description and the URDFs in the file; laws, tasks and types of platforms
    are those of this mobman and of what is registered here.

    Args:
        path: The file.
        progress: Called with the fraction done.

    Returns:
        The new record, at every tick.

    Raises:
        RecordError: If the file is no record, or the run had a part that the file does not hold; says
            which.
    """
    return _repeated(load_record(path), Path(path), progress)


def verify(
    path: str | os.PathLike[str],
    *,
    tolerance: float | None = None,
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
        progress: Called with the fraction done.

    Raises:
        RecordError: As :func:`repeat`.
    """
    record = load_record(path)
    again = _repeated(record, Path(path), progress)
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


def _repeated(record: Record, path: Path, progress: Progress | None) -> Record:
    try:
        again = _run(record.spec, record.urdf, progress)
    except MobmanError as error:
        raise RecordError(f"{path} cannot be repeated: {error}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordError(
            f"{path} cannot be repeated: what it says of the run is not whole ({error!r})"
        ) from error
    again.spec, again.urdf = record.spec, record.urdf
    return again


def _run(spec: dict[str, Any], urdf: dict[str, bytes], progress: Progress | None) -> Record:
    if spec["not_repeatable"]:
        raise RecordError("; ".join(spec["not_repeatable"]))
    scenario = Scenario.model_validate(spec["scenario"])
    controller = controller_again(spec)
    robot = robot_again(spec, urdf)
    q0 = robot.checked_configuration(np.array(spec["q0"], dtype=float))
    task = task_again(spec, robot, q0)
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
