"""From what a loop left to the record of the run."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from mobman.simulation.loop import Loop
from mobman.simulation.metrics.metric import Run, compute_metrics
from mobman.simulation.provenance import versions
from mobman.simulation.record import Record
from mobman.simulation.signals import APPLIED


def recorded(
    loop: Loop, *, scenario: str, seed: int, asked: dict[str, Any], urdf: dict[str, bytes]
) -> Record:
    """The record of a run that is over.

    Args:
        loop: The loop that ran.
        scenario: The scenario's name.
        seed: Of all randomness.
        asked: The run as it was asked for, see :func:`mobman.simulation.asked.run.run_asked`.
        urdf: The robots' URDF files, see :func:`mobman.simulation.asked.robot.urdf_asked`.
    """
    samples, controller, robot = loop.samples, loop.controller, loop.robot
    n = samples.count
    run = _run_of(loop)
    settings: dict[str, Any] = getattr(controller, "settings", dict)()
    signals = {name: values[:n] for name, values in samples.signals.items()}
    if samples.applied is not None:
        signals[APPLIED] = run.torque
    law, task = _name_of(controller), _name_of(loop.task)
    return Record(
        t=run.t,
        q=run.q,
        z=run.z,
        torque=samples.torque[:n],
        tip_position=samples.tip[:n],
        tip_desired=samples.desired[:n],
        task_error=run.task_error,
        auxiliary_error=run.auxiliary_error,
        compute_time=run.compute_time,
        signals=signals,
        metrics=compute_metrics(run),
        status=samples.status,
        message=samples.message,
        robot=robot.name,
        controller=law,
        task=task,
        scenario=scenario,
        seed=seed,
        spec={"controller": law, "task": task, **asked},
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
    return Run(
        completed=samples.status == "ok",
        duration=loop.ticks * loop.dt,
        dt=loop.dt,
        t=np.arange(n, dtype=float) * float(loop.dt),
        q=samples.q[:n],
        z=samples.z[:n],
        torque=(samples.torque if samples.applied is None else samples.applied)[:n],
        task_error=samples.tip[:n] - samples.desired[:n],
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
    )


def _name_of(thing: object) -> str:
    return str(getattr(thing, "name", type(thing).__name__))
