"""One run, from a job to a result: what workers do, wherever they are."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import threading
import time
import uuid
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from mobman.benchmark.workers import preload
from mobman.controllers.protocol import Controller, controllers, make_controller
from mobman.errors import GainError, MobmanError, SpecError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import find_spec
from mobman.robots.spec import RobotSpec
from mobman.simulation.record import Record
from mobman.simulation.run_spec import RunSpec, fingerprint
from mobman.simulation.scenario import Scenario
from mobman.simulation.simulate import simulate
from mobman.tasks.task import TaskFactory, make_task, tasks
from mobman.version import __version__

_MARK = uuid.uuid4().hex
_LONGEST_MESSAGE = 2000
_KEPT = 8  # robots in a process: loading one takes longer than a short run
_robots: OrderedDict[str, MobileManipulator] = OrderedDict()
_turns: dict[int, threading.Lock] = {}


def this_process() -> tuple[str, int]:
    """Identifier of this process among all, on any machine."""
    return _MARK, os.getpid()  # a fork has the same mark


@dataclass(frozen=True)
class Job:
    """A run, with what its names mean where the suite was started; a worker may not know them."""

    run: RunSpec
    robot: RobotSpec
    law: type[Any]
    factory: TaskFactory
    time_limit: float  # wall time (s)
    origin: tuple[str, int]  # :func:`this_process` where the suite was started
    with_file: bool = True  # True if the content of the record's file is sent back


def jobs_of(runs: Sequence[RunSpec], time_limit: float, *, with_file: bool = True) -> list[Job]:
    """The jobs of runs, by what their names mean here; see :class:`Job`."""
    find_robot, origin = cache(find_spec), this_process()
    return [
        Job(
            run,
            find_robot(run.robot),
            controllers.get(run.law),
            tasks.get(run.task_name),
            time_limit,
            origin,
            with_file,
        )
        for run in runs
    ]


@dataclass(frozen=True)
class Result:
    """Result of a job."""

    run_id: str  # that of the job's run: a reply that went to another run's place shows as that
    status: str  # the record's, or "failed" if there is none
    message: str
    metrics: Mapping[str, float] = field(default_factory=dict)  # the record's
    content: bytes | None = None
    """Content of the record's file; None if there is no record, or the job is without."""
    again: bool = False  # another try may well go better
    fault: str = ""  # cause of a failure, if known: "gains" that the law refuses, or the "machine"
    end: float = 0.0  # time of the last sample (s)
    seconds: float = 0.0  # wall time that it took


def failure(run: RunSpec, message: str, *, again: bool = False, fault: str = "") -> Result:
    """A result without a record."""
    if len(message) > _LONGEST_MESSAGE:
        message = f"{message[:_LONGEST_MESSAGE]} ... ({len(message)} characters)"
    return Result(run.run_id, "failed", message, again=again, fault=fault)


class TimeLimitError(BaseException):
    """Raised within a run at its time limit; not an ``Exception``, which a law may catch."""


def perform(job: Job) -> Result:
    """Do a run; what goes wrong is a result, not an exception.

    One at a time in a process: threads would gain nothing, since runs hold the interpreter nearly all
    the time, and each would count the others' time as its own.
    """
    process = os.getpid()
    try:
        # of this process: one that was forked from another meanwhile must not wait for that one's turn
        with _turns.setdefault(process, threading.Lock()):
            started = time.perf_counter()
            result = _guarded(job)
            return replace(result, seconds=time.perf_counter() - started)
    finally:
        if os.getpid() != process:  # a child that the law forked must not answer for its parent
            os._exit(1)


def perform_packed(content: bytes) -> Result:
    """Do a run that was sent by :func:`packed`."""
    job: Job = pickle.loads(content)
    return perform(job)


def packed(thing: Any, dumps: Callable[[Any], bytes], name: str = "a run") -> bytes:
    """A job, or a part of one, as a function pickles it for another process.

    Raises:
        MobmanError: If it cannot be pickled, with the part's name.
    """
    try:
        return dumps(thing)
    except Exception as error:  # whatever the thing's own methods raise, too
        for part, it in parts_of([thing]).items() if isinstance(thing, Job) else ():
            packed(it, dumps, part)
        raise MobmanError(
            f"{name} cannot be sent to another process ({type(error).__name__}: {error}); define it "
            "at the top level of a module"
        ) from error


def parts_of(jobs: Sequence[Job]) -> dict[str, Any]:
    """Parts that jobs have in common, each once, by names for messages."""
    found: dict[str, Any] = {}
    for job in jobs:
        found[f"robot {job.run.robot!r}"] = job.robot
        found[f"controller {job.run.law!r}"] = job.law
        found[f"task {job.run.task_name!r}"] = job.factory
    return found


def _guarded(job: Job) -> Result:
    run = job.run
    if run.version != __version__:
        return failure(
            run, f"the worker has mobman {__version__}, the suite was started with {run.version}"
        )
    elsewhere = job.origin != this_process()
    try:
        if elsewhere:
            _pin_to_one_thread(os.getpid())
        preload(run.law)
        with _limited(job.time_limit, elsewhere) as heed:
            return _perform(job, heed)
    except TimeLimitError:
        result = failure(
            run, f"took longer than its time limit of {job.time_limit:g} s", again=True
        )
    except MemoryError:
        result = failure(run, "ran out of memory", again=True, fault="machine")
    except BaseException as error:
        # a robot that does not load, a bug in a plugin, its sys.exit(): this run's matter alone
        faults = {"gains": GainError, "machine": OSError}
        fault = next((name for name, kind in faults.items() if isinstance(error, kind)), "")
        result = failure(run, f"{type(error).__name__}: {error}", fault=fault)
    _robots.clear()  # a run that broke off may have left anything in its robot
    return result


def _perform(job: Job, heed: Callable[[float], None]) -> Result:
    run = job.run
    # under their names, which the record keeps; this process may not know them, or know others
    controllers.register(run.law, job.law)
    tasks.register(run.task_name, job.factory)
    robot = robot_of(job)
    record = simulated_run(run, robot, make_controller(run.law, **run.gains), heed)
    content = None
    if job.with_file:
        content = record.to_bytes(every=run.record_every, compression=run.compression)
    known = record.status, record.message, record.metrics, content
    return Result(run.run_id, *known, end=float(record.t[-1]))


def simulated_run(
    run: RunSpec,
    robot: MobileManipulator,
    controller: Controller,
    progress: Callable[[float], None] | None = None,
) -> Record:
    """The record of a run, whose task is registered, by its robot and its law with its gains.

    Raises:
        MobmanError: If the task cannot be made, or the simulation cannot begin.
    """
    given, scenario = run.task_given, Scenario.model_validate(run.scenario)
    placed = np.array(run.q0) if run.q0 else None
    by_name = not given and placed is None  # the record says so then
    record = simulate(
        robot,
        controller,
        run.task_name if by_name else make_task(run.task_name, robot, placed, **given),
        duration=run.duration,
        dt=run.dt,
        q0=None if placed is None else scenario.start_of(robot, placed),
        scenario=scenario,
        seed=run.seed,
        monitor=run.monitor,
        progress=progress,
    )
    if run.placement:
        record.spec["placement"] = run.placement
    if given:
        record.spec["task_given"] = given
    return record


@contextlib.contextmanager
def _limited(seconds: float, elsewhere: bool) -> Iterator[Callable[[float], None]]:
    """A limit to the wall time of the block, which calls what it is given now and then.

    A block that does not call it is ended with its process some time later, where the process is there
    for such work only; a pool of mobman's own processes ends it at once.
    """
    end = time.monotonic() + seconds

    def heed(fraction: float) -> None:
        if time.monotonic() > end:
            raise TimeLimitError

    alarm = getattr(signal, "SIGALRM", None)
    fatal = elsewhere and alarm is not None and signal.getsignal(alarm) == signal.SIG_DFL
    try:
        if fatal:
            signal.setitimer(signal.ITIMER_REAL, min(1.1 * seconds + 1.0, 1e9))
        yield heed
    finally:
        if fatal:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def robot_of(job: Job) -> MobileManipulator:
    """The robot of a job, loaded now or before.

    Raises:
        MobmanError: If it does not load, or is not what it was where the suite was started.
    """
    key = job.run.robot_sha256
    if key not in _robots:
        _robots[key] = load_robot(_spec(job))
        if len(_robots) > _KEPT:
            _robots.popitem(last=False)
    _robots.move_to_end(key)
    return _robots[key]


def _spec(job: Job) -> RobotSpec:
    """The description as it was sent; or this machine's own, if its files are elsewhere here."""
    problem = (
        f"robot {job.run.robot!r}: its URDF is not what it was when the suite was started, or its "
        "platform's code is not (edited meanwhile, or another one on the worker)"
    )
    try:
        if fingerprint(job.robot) == job.run.robot_sha256:
            return job.robot
    except SpecError as error:
        problem = (
            f"{error} on the worker; put the robot's files in the same place there, or install there "
            "the package that brings them"
        )
    with contextlib.suppress(MobmanError):  # not known here: what was sent is what to speak of
        own = find_spec(job.run.robot)
        if fingerprint(own) == job.run.robot_sha256:
            return own
    raise MobmanError(problem)


@cache
def _pin_to_one_thread(process: int) -> None:
    """One BLAS thread in this process from now on; a forked one has this to do again."""
    threadpool_limits(limits=1)
