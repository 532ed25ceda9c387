"""The samples that figures are drawn from: read one cell at a time, and thinned at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.benchmark.report.cells import CellRuns
from mobman.benchmark.report.content import ReportedRun, UnusedFile
from mobman.benchmark.report.thinning import thin
from mobman.benchmark.statistics import FLOOR
from mobman.errors import RecordError


@dataclass(frozen=True)
class Trace:
    """A thinned curve."""

    t: Array
    values: Array


@dataclass(frozen=True)
class MotorPart:
    """Motors of like size, which share an axis."""

    motors: list[int]
    bound: float
    """Largest torque to draw, either way; inf for all."""


@dataclass(frozen=True)
class RunCurves:
    """What is drawn of a run."""

    run: ReportedRun
    end: float
    """When it ended (s); its last sample if its message does not say it, NaN if there is none."""
    task_error: Trace
    """Norm (m)."""
    auxiliary_error: Trace
    torque: Trace
    """Norm of v."""
    motors: list[Trace]
    """Each torque; none where they are not wanted."""
    names: list[str]
    """Of the motors."""
    parts: list[MotorPart]
    whole: MotorPart
    """All motors together."""


@dataclass(frozen=True)
class CellCurves:
    """What is drawn of a cell: one run of each label."""

    cell: CellRuns
    runs: list[RunCurves]
    unread: list[UnusedFile]
    """Files whose samples cannot be read."""


def read_curves(cell: CellRuns, columns: int, motor_columns: int) -> CellCurves:
    """The curves of a cell's first seed.

    Args:
        cell: The cell.
        columns: How many columns norms are thinned to.
        motor_columns: The same for each motor's torque; 0 for none of them.
    """
    runs, unread = [], []
    for run in cell.first_seed:
        try:
            runs.append(_read(run, columns, motor_columns))
        except RecordError as error:
            unread.append(UnusedFile(run.file, f"its samples cannot be read: {error}"))
    return CellCurves(cell, runs, unread)


def motors_by_size(torque: Array) -> list[list[int]]:
    """Columns of torque that can share an axis, the largest first, in three parts at most.

    The largest of a part is no more than eight times its smallest, but for the last part; idle
    motors join the last, and the order within a part is that of the columns.
    """
    if len(torque) == 0:
        return [list(range(torque.shape[1]))]
    sizes = np.abs(np.where(np.isfinite(torque), torque, 0.0)).max(axis=0)
    parts: list[list[int]] = []
    largest = math.inf
    for motor in np.argsort(-sizes, kind="stable"):
        new = sizes[motor] < largest / 8.0 and sizes[motor] > 0.0 and len(parts) < 3
        if not parts or new:
            parts.append([])
            largest = sizes[motor]
        parts[-1].append(int(motor))
    return [sorted(part) for part in parts]


def _read(run: ReportedRun, columns: int, motor_columns: int) -> RunCurves:
    try:
        record = run.load()
    except RecordError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        # a file whose head is whole and whose samples are not
        raise RecordError(str(error)) from error
    t, torque = record.t, record.torque
    end = run.end
    if math.isnan(end) and len(t):
        end = float(t[-1])
    with np.errstate(over="ignore", invalid="ignore"):
        task, auxiliary, size = (
            np.asarray(np.linalg.norm(values, axis=1))
            for values in (record.task_error, record.auxiliary_error, torque)
        )
    n = torque.shape[1]
    wanted = n if motor_columns else 0
    return RunCurves(
        run,
        end,
        _trace(t, task, columns, FLOOR),
        _trace(t, auxiliary, columns, FLOOR),
        _trace(t, size, columns, FLOOR),
        [_trace(t, torque[:, motor], motor_columns) for motor in range(wanted)],
        list(record.velocity_names),
        [MotorPart(motors, _bound(run, torque[:, motors])) for motors in motors_by_size(torque)],
        MotorPart(list(range(n)), _bound(run, torque)),
    )


def _trace(t: Array, values: Array, columns: int, floor: float | None = None) -> Trace:
    thin_t, thinned = thin(t, values, columns)
    drawn = thinned if floor is None else np.maximum(thinned, floor)
    return Trace(thin_t, np.where(np.isfinite(thinned), drawn, np.nan))


def _bound(run: ReportedRun, torque: Array) -> float:
    """Leaves the blow-up of a diverging run out of the scale, so that what led to it can be seen."""
    finite = np.abs(torque[np.isfinite(torque)])
    if run.ok or finite.size < 20:
        return math.inf
    bound = 1.2 * float(np.quantile(finite, 0.97))
    return bound if bound > 0.0 and finite.max() > 3.0 * bound else math.inf


def largest(traces: Sequence[Trace]) -> float:
    """The largest finite value of some curves, either way; 0 if there is none."""
    values = [np.abs(trace.values[np.isfinite(trace.values)]) for trace in traces]
    return max((float(part.max()) for part in values if len(part)), default=0.0)
