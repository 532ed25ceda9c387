"""Repeating a run from its record alone, and comparing the two."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mobman.arrays import Array, Index
from mobman.controllers.protocol import Controller
from mobman.errors import MobmanError, RecordError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.provenance import COMPUTING
from mobman.robots.catalogue import find_spec, list_robots
from mobman.robots.urdf.read import urdf_sources
from mobman.simulation.metrics import list_metrics
from mobman.simulation.pieces import Setting
from mobman.simulation.record import Record, load_record
from mobman.simulation.record_file import FIELDS, as_in_file
from mobman.simulation.run_spec import (
    RunSpec,
    controller_of,
    plant_of,
    recorded_scenario,
    require_same,
    robot_of,
    task_of,
)
from mobman.simulation.simulate import seconds, simulate, true_plant, whole_ticks
from mobman.tasks.task import Task

Progress = Callable[[float], None]

ELSEWHERE = 1e-4
"""Tolerance where another processor or other versions round in other ways."""
LOOSER = 100.0
"""Factor of the tolerance for torques and a controller's signals: rounding shows in them first, and in
their changes from tick to tick, long before it does in where the robot goes."""

_TIMING = "compute_time"  # of the dataset, and what the metrics made of it begin with
_TEXTS = ("robot", "controller", "task", "scenario", "seed", "status")
_TICKS = 2  # by which a time that a metric tells may be later or earlier elsewhere
# Ticks: few take less time than a look at the length; of a run that ended early the rest is not kept.
_FEW, _MOST_AFTER_THE_END, _MOST_DECIMATION = 1000, 1_000_000, 10_000


@dataclass(frozen=True)
class Own:
    """Parts of a run that its owner gives, since a file of unknown origin does not get to run code."""

    robot: MobileManipulator | None = None
    """The robot, for one whose platform is Python code."""
    controller: Controller | None = None
    """The controller, for one whose law is not registered."""
    make_task: Callable[[MobileManipulator, Array], Task] | None = None
    """Factory of the task from the robot and q0, for one that is not registered."""


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
    another than the run's, within :data:`ELSEWHERE`.

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
        note=_changed_since(record),
    )


def _repeated(record: Record, path: Path, own: Own, progress: Progress | None) -> Record:
    try:
        run = RunSpec.of_record(record.spec)
        _check_length(record, run)
        again = _run(run, record.urdf, own, _ending(record, run, progress))
    except MobmanError as error:
        raise RecordError(f"{path} cannot be repeated: {error}") from error
    except Exception as error:  # what is in the file may be anything
        raise RecordError(
            f"{path} cannot be repeated: what it says of the run is not whole "
            f"({' '.join(repr(error).split())})"
        ) from error
    again.spec, again.urdf = record.spec, record.urdf
    return again


def _check_length(record: Record, run: RunSpec) -> None:
    """
    Raises:
        RecordError: If the run would be much longer than the samples of the record, which went to its
            end: what is in the file must not decide how long this computes.
    """
    ticks = whole_ticks(seconds("duration", run.duration), seconds("dt", run.dt))
    most = 2 * len(record.t) * min(record.decimation, _MOST_DECIMATION) + _FEW
    if ticks > (most if record.ok else most + _MOST_AFTER_THE_END):
        raise RecordError(
            f"its {len(record.t)} samples, every {record.decimation}th kept, are not those of a run of "
            f"{run.duration:g} s at dt = {run.dt:g} s"
        )


def _ending(record: Record, run: RunSpec, progress: Progress | None) -> Progress:
    """Progress that ends a repetition which goes on far beyond the end of the record."""
    last = float(record.t[-1])
    most = (2.0 * last + 1.0) / run.duration

    def go_on(fraction: float) -> None:
        if fraction > most and not record.ok:
            raise RecordError(
                f"it goes on beyond t = {last:g} s, where the run of the record ended"
            )
        if progress is not None:
            progress(fraction)

    return go_on


def _changed_since(record: Record) -> str:
    """The difference of the robot that is registered now from the run's; empty if there is none, or if
    no robot of the name is registered."""
    described = record.spec["robot"]
    name = described["name"]
    try:
        if name not in list_robots():  # the name is from a file: it is no path
            return ""
        now = find_spec(name)
        sources = urdf_sources(now)
        if sources.sha256() != record.urdf_sha256:
            return f"the URDF {sources} is not the run's any more; the one in the record was used"
        if now.model_dump(mode="json", by_alias=True) != described:
            return (
                f"the description of the robot {name!r} is not the run's any more; the one in the "
                "record was used"
            )
    except MobmanError:
        pass  # it is not there, and not needed
    return ""


def _run(run: RunSpec, urdf: dict[str, bytes], own: Own, progress: Progress | None) -> Record:
    given = {
        "its controller": own.controller is not None,
        "its task": own.make_task is not None,
        "the gains of its controller": own.controller is not None,
    }
    reasons = [
        reason
        for reason in run.not_repeatable
        if not any(there and reason.startswith(part) for part, there in given.items())
    ]
    if reasons:
        raise RecordError("; ".join(reasons))
    scenario = recorded_scenario(run.scenario)
    controller = controller_of(run) if own.controller is None else own.controller
    robot = robot_of(run, urdf, own.robot)
    q0 = robot.checked_configuration(np.array(run.q0))
    task = task_of(run, robot, q0) if own.make_task is None else own.make_task(robot, q0)
    plant = plant_of(run, urdf, robot)
    setting = Setting(robot, run.dt, np.random.default_rng(run.seed))
    require_same(true_plant(setting, plant, scenario), run, "plant")
    return simulate(
        robot,
        controller,
        task,
        duration=run.duration,
        dt=run.dt,
        q0=q0,
        plant=plant,
        scenario=scenario,
        seed=run.seed,
        progress=progress,
    )


@dataclass(frozen=True)
class Compared:
    """One thing of two records."""

    name: str
    """A dataset's place, ``metrics/NAME``, ``settings/NAME``, ``state_sha256`` or another attribute."""
    identical: bool
    """To the last bit."""
    equal: bool
    """Within the tolerance."""
    difference: float = 0.0
    """The largest; NaN where there is none to tell: texts, or a value on one side only."""
    where: str = ""
    """Place of the largest: the column and the time, or both values."""


@dataclass(frozen=True)
class Verification:
    """A record's file and its repetition: what was compared, and with what result."""

    record: Record
    """The repetition."""
    compared: tuple[Compared, ...]
    tolerance: float
    """The largest difference allowed, over the larger of 1 and the largest value, and
    :data:`LOOSER` times as much in torques and signals; 0: bit for bit."""
    machine: dict[str, tuple[str, str]]
    """Differences of the machine: what it was, what it is."""
    versions: dict[str, tuple[str, str]]
    """Libraries and tools that compute and have another version: what it was, what it is."""
    note: str
    """A further difference that does not matter."""

    @property
    def identical(self) -> bool:
        """True if all is equal to the last bit."""
        return all(item.identical for item in self.compared)

    @property
    def equal(self) -> bool:
        """True if all is equal within the tolerance."""
        return all(item.equal for item in self.compared)

    @property
    def differences(self) -> list[Compared]:
        """Everything that is not equal, the states first."""
        return [item for item in self.compared if not item.equal]


def differing(
    was: Mapping[str, str], now: Mapping[str, str], names: Iterable[str]
) -> dict[str, tuple[str, str]]:
    """The named values that differ, with both values."""
    pairs = {name: (was.get(name, "unknown"), now.get(name, "unknown")) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def compare(record: Record, again: Record, tolerance: float) -> tuple[Compared, ...]:
    """Everything of a record but how long the controller took, with a repetition at every tick.

    A run that ended early has run away exponentially, and with it every difference in rounding: unless
    it is bit for bit, only the first half of its samples is judged, and not its metrics.

    Args:
        record: The record, which may have been decimated.
        again: The repetition.
        tolerance: As :class:`Verification` has it.
    """
    exact = tolerance == 0.0
    early = not exact and not record.ok
    found = [_hashes(record, again, exact)]
    found += [_text(name, getattr(record, name), getattr(again, name)) for name in _TEXTS]
    if exact:
        found.append(_text("message", record.message, again.message))
    kept = _same_ticks(record, again)
    found.append(_end(record, again, kept, early))
    if early:
        kept = kept[: (len(kept) + 1) // 2]
    ours, theirs = _samples(record), _samples(again)
    for place in [*ours, *(place for place in theirs if place not in ours)]:
        if place in ours and place in theirs:
            values = ours[place][: len(kept)], theirs[place][kept]
            loose = place == "torque" or place in record.signals
            allowed = tolerance * (LOOSER if loose else 1.0)
            found.append(_dataset(place, *values, record, allowed))
        else:
            found.append(_one_sided(place, place in ours))
    settings = as_in_file(again.settings)
    found += _numbers(
        "settings/", as_in_file(record.settings), settings, {}, tolerance, exact=exact
    )
    if not early:
        slack = _TICKS * float(record.spec["dt"])
        times = {metric.name: slack for metric in list_metrics() if metric.unit == "s"}
        was, now = _without_timing(record.metrics), _without_timing(again.metrics)
        found += _numbers("metrics/", was, now, times, tolerance, exact=exact)
    return tuple(found)


def _hashes(record: Record, again: Record, exact: bool) -> Compared:
    same = record.state_sha256 == again.state_sha256
    where = "" if same else "of t, q, z and torque at every tick"
    return Compared("state_sha256", same, same or not exact, 0.0 if same else math.nan, where)


def _text(name: str, was: Any, now: Any) -> Compared:
    same = was == now
    where = "" if same else f"{was!r} in the file, {now!r} now"
    return Compared(name, same, same, 0.0 if same else math.nan, where)


def _same_ticks(record: Record, again: Record) -> Index:
    """The samples of the repetition that are the record's, as far as both go."""
    rows = np.arange(len(record.t)) * record.decimation
    last = len(again.t) - 1
    if len(rows) > 1 and rows[-2] < last < rows[-1]:
        rows[-1] = last  # decimation keeps the last one, wherever it is
    return rows[rows <= last]


def _end(record: Record, again: Record, kept: Index, early: bool) -> Compared:
    same = len(kept) == len(record.t) and int(kept[-1]) == len(again.t) - 1
    difference = abs(float(record.t[-1] - again.t[-1]))
    where = (
        ""
        if same
        else f"{record.t[-1]:.6g} s in the file, {again.t[-1]:.6g} s now; the last sample"
    )
    return Compared("t at the end", same, same or early, difference, where)


def _samples(record: Record) -> dict[str, Array]:
    found = {place: getattr(record, field) for place, (field, *_) in FIELDS.items()}
    found = {"t": record.t, **found, **record.signals}
    del found[_TIMING]
    return found


def _dataset(place: str, was: Array, now: Array, record: Record, tolerance: float) -> Compared:
    if was.shape != now.shape:
        return Compared(place, False, False, math.nan, f"shapes {was.shape} and {now.shape}")
    same = (was.view(np.int64) == now.view(np.int64)) | (np.isnan(was) & np.isnan(now))
    if np.all(same):
        return Compared(place, True, True)
    with np.errstate(all="ignore"):  # inf - inf
        difference = np.where(same, 0.0, np.abs(was - now))
    one_sided = np.isnan(difference)
    largest = np.unravel_index(np.argmax(np.where(one_sided, np.inf, difference)), difference.shape)
    finite = np.abs(was[np.isfinite(was)])
    equal = bool(
        tolerance > 0.0
        and not one_sided.any()
        and difference.max() <= tolerance * max(1.0, finite.max(initial=0.0))
    )
    where = f"at t = {record.t[largest[0]]:.6g} s" + _column(place, largest[1:], record)
    where += f": {was[largest]:.9g} in the file, {now[largest]:.9g} now"
    return Compared(place, False, equal, float(difference[largest]), where)


def _column(place: str, index: tuple[Any, ...], record: Record) -> str:
    if not index:
        return ""
    axis = FIELDS[place][1] if place in FIELDS else ""
    names: dict[str, list[str]] = {
        "joint": record.joint_names,
        "velocity": record.velocity_names,
        "axis": ["x", "y", "z"],
    }
    if axis in names:
        return f", {names[axis][index[0]]}"
    return f", component {', '.join(str(int(i)) for i in index)}"


def _one_sided(name: str, in_file: bool) -> Compared:
    where = "in the file only" if in_file else "in the repetition only"
    return Compared(name, False, False, math.nan, where)


def _without_timing(metrics: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in metrics.items() if not name.startswith(_TIMING)}


def _numbers(
    prefix: str,
    was: Mapping[str, Any],
    now: Mapping[str, Any],
    slack: Mapping[str, float],
    tolerance: float,
    *,
    exact: bool,
) -> list[Compared]:
    """Numbers, or lists of them, by name; another version may have more of them, or fewer."""
    found = []
    for name in [*was, *(name for name in now if name not in was)]:
        if name in was and name in now:
            loose = prefix == "metrics/" and name.startswith("torque")
            allowed = tolerance * (LOOSER if loose else 1.0)
            found.append(_value(prefix + name, was[name], now[name], allowed, slack.get(name, 0.0)))
        elif exact:
            found.append(_one_sided(prefix + name, name in was))
    return found


def _value(name: str, was: Any, now: Any, tolerance: float, slack: float) -> Compared:
    try:
        old, new = np.asarray(was, dtype=float), np.asarray(now, dtype=float)
    except (TypeError, ValueError):
        return _text(name, was, now)
    if old.shape != new.shape:
        return _text(name, was, now)
    same = (old == new) | (np.isnan(old) & np.isnan(new))
    if np.all(same):
        return Compared(name, True, True)
    with np.errstate(all="ignore"):
        difference = float(np.max(np.where(same, 0.0, np.abs(old - new))))
    size = float(np.abs(old[np.isfinite(old)]).max(initial=1.0))
    allowed = tolerance * size + (slack if tolerance > 0.0 else 0.0)
    where = f"{was} in the file, {now} now"
    return Compared(name, False, tolerance > 0.0 and difference <= allowed, difference, where)
