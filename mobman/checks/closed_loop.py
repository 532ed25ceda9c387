"""Check of a second of closed loop."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobman.checks.checks import Remark, check, does_not_apply, ok, some, warning, wrong
from mobman.checks.reach import circle, is_within_reach
from mobman.checks.subject import Subject
from mobman.simulation.record import Record
from mobman.simulation.simulate import simulate

_DURATION = 1.0  # s
_DIMENSION = 3  # of the tip's task
_RESIDUAL = 1e-9  # m/s
_CONTROLLER, _TASK = "tsm", "circle"
_SCALES = (1.0, 0.5, 0.25, 0.1)  # of the circle, the largest within reach is driven
_SMALL = 0.5  # a platform that drives ought to get round a larger one


@check(
    "closed-loop",
    f"a second of {_CONTROLLER!r} on the task {_TASK!r} brings the tip nearer",
    simulates=True,
)
def closed_loop(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    if robot.nz < _DIMENSION:
        yield does_not_apply(f"{robot.nz} degrees of freedom, fewer than the tip's {_DIMENSION}")
        return
    # an arm that cannot drive rarely gets round the whole circle: then a smaller one
    scale = next((s for s in _SCALES if is_within_reach(subject, circle(subject, s))), None)
    fix = f"correct what the other checks find, and try another [rest] of robot {robot.name!r}"
    if scale is None:
        yield warning(
            f"not run: the task {_TASK!r} is out of reach, even {_SCALES[-1]:g} times as large",
            fix,
        )
        return
    record = simulate(robot, _CONTROLLER, circle(subject, scale), duration=_DURATION)
    path = f"{_TASK!r}" if scale == 1.0 else f"{_TASK!r}, {scale:g} times as large"
    if not record.ok:
        yield wrong(f"the run on {path} ended as {record.status} {record.message}", fix)
        return
    remarks = list(_faults(subject, record, path, fix))
    if scale < _SMALL and len(robot.platform_index) > 0:
        remarks.append(
            warning(
                f"only run on {path}: the tip was not found to reach larger ones, though the "
                "platform drives",
                f"see what the check 'reach' says, and try another [rest] of robot {robot.name!r}",
            )
        )
    remarks += _efforts(subject, record)
    yield from remarks
    if not remarks:
        first, last = np.linalg.norm(record.task_error[[0, -1]], axis=1)
        yield ok(
            f"{path}: the tip's error went from {first:.3g} to {last:.2g} m in 1 s; "
            f"|A q'| {record.metrics['constraint_residual']:.1g} m/s; "
            f"peak torque {np.abs(record.torque).max():.3g}"
        )


def _faults(subject: Subject, record: Record, path: str, fix: str) -> Iterator[Remark]:
    if not all(np.all(np.isfinite(part)) for part in (record.q, record.z, record.torque)):
        yield wrong("the run has numbers that are not finite", fix)
    residual = record.metrics["constraint_residual"]
    if not residual <= _RESIDUAL:
        yield wrong(
            f"the constraints A q' = 0 are broken by {residual:.2g} m/s",
            f"check [platform] of robot {subject.robot.name!r}",
        )
    first, last = np.linalg.norm(record.task_error[[0, -1]], axis=1)
    if not last < first:
        yield warning(f"{path}: the tip's error went from {first:.3g} to {last:.3g} m in 1 s", fix)


def _efforts(subject: Subject, record: Record) -> Iterator[Remark]:
    """Joints whose motors would have to give more than they have."""
    robot = subject.robot
    efforts, peaks = np.array(robot.model.effortLimit), np.zeros(robot.nq)
    for q, torque in zip(record.q, record.torque, strict=True):
        np.maximum(peaks, np.abs(robot.actuation(q) @ torque), out=peaks)
    over = some(
        f"joint {robot.joint_names[i]!r} {peaks[i]:.3g} of {efforts[i]:.3g}"
        for i in range(robot.nq)
        if 0.0 < efforts[i] < peaks[i]
    )
    if over:
        yield warning(
            f"torques above the effort limits: {over}",
            "start nearer to the path or with lower gains on the real robot, or check <limit effort> of "
            f"these joints in {subject.files}",
        )
