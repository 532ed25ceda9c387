"""One run, from a job to a result: what workers do, wherever they are."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import replace

from mobman.benchmark.running.job import Job, Result, this_process
from mobman.benchmark.running.loaded_robots import forget_robots, robot_of
from mobman.benchmark.running.one_thread import pin_to_one_thread
from mobman.benchmark.running.preload import preload
from mobman.benchmark.running.simulated_run import simulated_run
from mobman.benchmark.running.time_limit import TimeLimitError, within
from mobman.controllers.protocol import controllers, make_controller
from mobman.errors import GainError
from mobman.tasks.task import tasks
from mobman.version import __version__

_turns: dict[int, threading.Lock] = {}


def perform(job: Job) -> Result:
    """Do a run; what goes wrong is a result, not an exception.

    One at a time in a process: threads would gain nothing, since runs hold the interpreter nearly all
    the time, and each would count the others' time as its own: towards its limit, and as what its
    controller took.
    """
    # of this process: one that was forked from another meanwhile must not wait for that one's turn
    with _turns.setdefault(os.getpid(), threading.Lock()):
        started = time.perf_counter()
        result = _guarded(job)
        return replace(result, seconds=time.perf_counter() - started)


def _guarded(job: Job) -> Result:
    if job.run.version != __version__:
        return Result.failure(
            f"the worker has mobman {__version__}, the suite was started with {job.run.version}"
        )
    elsewhere = job.origin != this_process()
    try:
        if elsewhere:
            pin_to_one_thread()
        preload()
        return within(job.time_limit, _perform, job, fatal=elsewhere)
    except TimeLimitError:
        result = Result.failure(
            f"took longer than its time limit of {job.time_limit:g} s", again=True
        )
    except MemoryError:
        result = Result.failure("ran out of memory", again=True, fault="machine")
    except BaseException as error:
        # a robot that does not load, a bug in a plugin, its sys.exit(): this run's matter alone
        fault = "gains" if isinstance(error, GainError) else ""
        fault = "machine" if isinstance(error, OSError) else fault
        result = Result.failure(f"{type(error).__name__}: {error}", fault=fault)
    forget_robots()
    return result


def _perform(job: Job) -> Result:
    run = job.run
    law, task = job.law.open(), job.task.open()
    # under their names, which the record keeps; this process may not know them, or know others
    controllers.register(run.law, law)
    tasks.register(run.task_name, task)
    robot = robot_of(job)
    record = simulated_run(run, robot, make_controller(run.law, **run.gains))
    content = None
    if job.with_file:
        content = record.to_bytes(every=run.record_every, compression=run.compression)
    return Result(
        record.status,
        record.message,
        record.metrics.get("task_error_max", float("inf")),
        content,
        metrics=record.metrics,
        end=float(record.t[-1]),
    )
