"""Repeating a run from its record alone, and comparing the two."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.protocol import Controller
from mobman.errors import MobmanError, RecordError, UsageError, told_of_foreign
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.provenance import COMPUTING
from mobman.robots.catalogue import find_spec, list_robots
from mobman.robots.urdf.read import urdf_sources
from mobman.simulation import parts
from mobman.simulation.metrics import list_metrics
from mobman.simulation.pieces import Setting
from mobman.simulation.record import Record, load_record
from mobman.simulation.record_file import FIELDS, as_in_file, axes_of, places_of
from mobman.simulation.run_spec import RunSpec
from mobman.simulation.scenario import true_plant
from mobman.simulation.simulate import seconds, simulate, whole_ticks
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
    controller: Controller | type[Any] | None = None
    """The controller, for one whose law is not registered, or its class, which is made from its
    ``Gains`` with the values of the record."""
    make_task: Callable[..., Task] | None = None
    """Factory of the task from the robot, q0 and the record's parameters, for one that is not
    registered."""

    def __post_init__(self) -> None:
        """Refuse what is no robot or no factory: UsageError."""
        if not isinstance(self.robot, MobileManipulator | None):
            raise UsageError(f"robot = {self.robot!r}: must be a robot, as load_robot returns it")
        if not (self.make_task is None or callable(self.make_task)):
            raise UsageError(
                f"make_task = {self.make_task!r}: must be a function of a robot and q0"
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
        RecordError: If the file is not a record, or the run had a part that the file does not hold; says
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
    if tolerance is not None and not (isinstance(tolerance, Real) and 0.0 <= tolerance < math.inf):
        raise UsageError(f"tolerance = {tolerance!r}: must be a number from 0 on")
    record = load_record(path)
    again = _repeated(record, Path(path), own or Own(), progress)
    machine = _differing(record.machine, again.machine, again.machine)
    versions = _differing(record.versions, again.versions, COMPUTING)
    if tolerance is None:
        tolerance = ELSEWHERE if machine or versions else 0.0
    return Verification(
        record=again,
        compared=tuple(_compare(record, again, tolerance)),
        tolerance=tolerance,
        machine=machine,
        versions=versions,
        note=_changed_since(record),
    )


# Repeating ---------------------------------------------------------------------------------------


def _repeated(record: Record, path: Path, own: Own, progress: Progress | None) -> Record:
    try:
        run = RunSpec.of_record(record.spec)
        _check_length(record, run)
        again = _run(run, record.urdf, own, _ending(record, run, progress))
    except MobmanError as error:
        raise RecordError(f"{path} cannot be repeated: {error}") from error
    except Exception as error:  # what is in the file may be anything
        not_whole = f"what it says of the run is not whole ({' '.join(repr(error).split())})"
        problem = told_of_foreign(error) or not_whole
        raise RecordError(f"{path} cannot be repeated: {problem}") from error
    again.spec, again.urdf = record.spec, record.urdf
    return again


def _check_length(record: Record, run: RunSpec) -> None:
    """Refuse a run that would be much longer than the samples of the record, which went to its end: what
    is in the file must not decide how long this computes."""
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


_GIVEN = "; one that is not registered is given by its code: --{} FILE.py:NAME, or Own({}=...)"


def _run(run: RunSpec, urdf: dict[str, bytes], own: Own, progress: Progress | None) -> Record:
    has: tuple[str, ...] = (
        () if own.controller is None else ("its controller", "the gains of its controller")
    )
    has += () if own.make_task is None else ("its task",)
    if reasons := [reason for reason in run.not_repeatable if not reason.startswith(has)]:
        raise RecordError("; ".join(reasons))
    scenario = parts.scenario_of(run.scenario)
    with parts.refused("its controller cannot be made", _GIVEN.format("controller", "controller")):
        controller = parts.controller_of(run, own.controller)
    robot = parts.robot_of(run.description, urdf) if own.robot is None else own.robot
    parts.require_same(robot, run, "robot")
    q0 = robot.checked_configuration(np.array(run.q0))
    with parts.refused("its task cannot be made", _GIVEN.format("task", "make_task")):
        if own.make_task is None:
            task = parts.task_of(run, robot, q0)
        else:
            task = own.make_task(robot, q0, **run.task_given)
            parts.require_same_task(task, run)
    plant = parts.plant_of(run, urdf, robot)
    setting = Setting(robot, run.dt, np.random.default_rng(run.seed))
    parts.require_same(true_plant(setting, plant, scenario), run, "plant")
    numbers = {name: getattr(run, name) for name in ("duration", "dt", "seed", "monitor")}
    differing: dict[str, Any] = {"plant": plant, "scenario": scenario}
    return simulate(robot, controller, task, q0=q0, progress=progress, **differing, **numbers)


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
    except MobmanError:
        return ""  # it is not there, and not needed
    if sources.sha256() != record.urdf_sha256:
        what = f"the URDF {sources}"
    elif now.model_dump(mode="json", by_alias=True) != described:
        what = f"the description of the robot {name!r}"
    else:
        return ""
    return f"{what} is not the run's any more; the one in the record was used"


# Comparing ---------------------------------------------------------------------------------------


def _differing(
    was: Mapping[str, str], now: Mapping[str, str], names: Iterable[str]
) -> dict[str, tuple[str, str]]:
    pairs = {name: (was.get(name, "unknown"), now.get(name, "unknown")) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _compare(record: Record, again: Record, tolerance: float) -> Iterator[Compared]:
    """Everything of a record, which may be decimated, but how long the controller took.

    A run that ended early has run away exponentially, and with it every difference in rounding: unless
    it is bit for bit, only the first half of its samples is judged, and not its metrics. Another version
    may have more settings and metrics, or fewer.
    """
    exact = tolerance == 0.0
    early = not exact and not record.ok
    same = record.state_sha256 == again.state_sha256
    yield _unlike("state_sha256", "of t, q, z and torque at every tick", same, not exact)
    for name in (*_TEXTS, *(("message",) if exact else ())):
        was, now = getattr(record, name), getattr(again, name)
        yield _unlike(name, f"{was!r} in the file, {now!r} now", was == now)
    # the samples of the repetition that are the record's, as far as both go
    rows, last = np.arange(len(record.t)) * record.decimation, len(again.t) - 1
    if len(rows) > 1 and rows[-2] < last < rows[-1]:
        rows[-1] = last  # decimation keeps the last one, wherever it is
    rows = rows[rows <= last]
    same = len(rows) == len(record.t) and int(rows[-1]) == last
    ends = float(record.t[-1]), float(again.t[-1])
    where = f"{ends[0]:.6g} s in the file, {ends[1]:.6g} s now; the last sample"
    yield _unlike("t at the end", where, same, early, abs(ends[0] - ends[1]))
    if early:
        rows = rows[: (len(rows) + 1) // 2]
    slack = 0.0 if exact else _TICKS * float(record.spec["dt"])
    times = {metric.name for metric in list_metrics() if metric.unit == "s"}
    loose = {"torque", *record.signals}
    loose |= {f"metrics/{name}" for name in record.metrics if name.startswith("torque")}
    groups: dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
        "": (_samples(record, slice(len(rows))), _samples(again, rows)),
        "settings/": (as_in_file(record.settings), as_in_file(again.settings)),
        "metrics/": ({}, {}) if early else (record.metrics, again.metrics),
    }
    for prefix, (old, new) in groups.items():
        for name in dict.fromkeys((*old, *new)):
            if name.startswith(_TIMING) and prefix != "settings/":
                continue
            if name in old and name in new:
                pair = old[name], new[name], tolerance * (LOOSER if prefix + name in loose else 1.0)
                more = slack if prefix == "metrics/" and name in times else 0.0
                yield _pair(prefix + name, *pair, more, None if prefix else record)
            elif exact or not prefix:
                side = "in the file only" if name in old else "in the repetition only"
                yield _unlike(prefix + name, side, False)


def _samples(record: Record, rows: Any) -> dict[str, Array]:
    """Some rows of a record's samples, by their places."""
    found = {
        place: getattr(record, about.field) for place, about in places_of(vars(record)).items()
    }
    return {place: x[rows] for place, x in {"t": record.t, **found, **record.signals}.items()}


def _unlike(
    name: str, where: str, same: bool, allowed: bool = False, difference: float = math.nan
) -> Compared:
    return Compared(name, True, True) if same else Compared(name, False, allowed, difference, where)


def _pair(
    name: str, was: Any, now: Any, tolerance: float, slack: float, record: Record | None
) -> Compared:
    where = "" if record is not None else f"{was!r} in the file, {now!r} now"
    try:
        old, new = np.asarray(was, dtype=float), np.asarray(now, dtype=float)
    except (TypeError, ValueError):  # text
        return _unlike(name, where, was == now)
    if old.shape != new.shape:
        return _unlike(name, where or f"shapes {old.shape} and {new.shape}", False)
    same = (old.view(np.int64) == new.view(np.int64)) | (np.isnan(old) & np.isnan(new))
    if np.all(same):
        return Compared(name, True, True)
    with np.errstate(all="ignore"):  # inf - inf
        difference = np.where(same, 0.0, np.abs(old - new))
    worst = np.argmax(np.where(np.isnan(difference), np.inf, difference))
    largest = np.unravel_index(worst, difference.shape)
    allowed = tolerance * np.abs(old[np.isfinite(old)]).max(initial=1.0) + slack
    equal = bool(tolerance > 0.0 and difference[largest] <= allowed)  # not if it is NaN
    if record is not None:
        where = f"at t = {record.t[largest[0]]:.6g} s" + _column(name, largest[1:], record)
        where += f": {old[largest]:.9g} in the file, {new[largest]:.9g} now"
    return Compared(name, False, equal, float(difference[largest]), where)


def _column(place: str, index: tuple[Any, ...], record: Record) -> str:
    if not index:
        return ""
    if place in FIELDS:
        axes = axes_of(vars(record))
        names = axes.get(FIELDS[place].axis, axes["axis"])
        if isinstance(names, list):
            return f", {names[index[0]]}"
    return f", component {', '.join(str(int(i)) for i in index)}"
