"""One run of a trial: what is sent to a worker, and the score that comes back."""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, wait
from dataclasses import dataclass, replace
from typing import Any, Self

from mobman.benchmark.running.preload import preload
from mobman.benchmark.running.simulated_run import simulated_run
from mobman.benchmark.running.time_limit import TimeLimitError, within
from mobman.benchmark.running.worker_process import WorkerLostError
from mobman.benchmark.tuning.objective import Objective
from mobman.controllers.protocol import controllers, make_controller
from mobman.errors import GainError, MobmanError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import find_spec
from mobman.robots.spec import RobotSpec
from mobman.simulation.record import Record
from mobman.simulation.run_spec import RunSpec
from mobman.tasks.task import TaskFactory, tasks

_here = threading.local()  # robots, which a thread forgets without asking the others


@dataclass(frozen=True)
class Evaluation:
    """A run, with what its names mean where the tuning was started; a worker may not know."""

    run: RunSpec
    robot: RobotSpec
    law: type[Any]
    factory: TaskFactory

    @classmethod
    def of(cls, run: RunSpec, **changes: Any) -> Self:
        """That of a run, some of whose fields differ."""
        return cls(
            replace(run, **changes),
            find_spec(run.robot),
            controllers.get(run.law),
            tasks.get(run.task_name),
        )


@dataclass(frozen=True)
class RunScore:
    """How one run of a trial went."""

    score: float
    """See :meth:`Objective.score`."""
    status: str
    """The record's; ``"infeasible"`` where the law refuses the gains, ``"failed"`` where it raised
    another error."""
    message: str
    metrics: dict[str, float]
    """Those of the objective, by name."""
    seconds: float
    """Wall time that it took."""


def simulated(evaluation: Evaluation) -> Record:
    """The run's record.

    Raises:
        GainError: If the law refuses the gains.
    """
    run = evaluation.run
    controllers.register(run.law, evaluation.law)
    tasks.register(run.task_name, evaluation.factory)
    controller = make_controller(run.law, **run.gains)
    robot = _loaded(run.robot_sha256, evaluation.robot)
    return simulated_run(run, robot, controller)


def score(evaluation: Evaluation, objective: Objective, limit: float) -> RunScore:
    """Do a run and score it; what the law does wrong is scored, too.

    Args:
        evaluation: The run.
        objective: What is scored.
        limit: Wall time that it may take (s).
    """
    started = time.perf_counter()
    try:
        preload()
        # where threads share a process, they would share its one timer
        alone = threading.current_thread() is threading.main_thread()
        fatal = alone and multiprocessing.parent_process() is not None
        record = within(limit, simulated, evaluation, fatal=fatal)
    except GainError as error:
        status, message = "infeasible", str(error)
    except TimeLimitError:
        status, message = "failed", f"took longer than its time limit of {limit:g} s"
    except (OSError, MemoryError):
        raise  # the machine's fault, and no gains'
    except Exception as error:
        # whatever a law does with gains that do not suit it
        status, message = "failed", f"{type(error).__name__}: {error}"
    else:
        if missing := [name for name in objective.metrics if name not in record.metrics]:
            raise MobmanError(
                f"the objective {objective.name!r} needs the metric {missing[0]!r}, which no run has"
            )
        fraction = float(record.t[-1]) / evaluation.run.duration
        found = {name: record.metrics[name] for name in objective.metrics}
        value = objective.score(record.status, found, fraction)
        seconds = time.perf_counter() - started
        return RunScore(value, record.status, record.message, found, seconds)
    _here.robots = {}  # a run that broke off may have left anything in its robot
    value = objective.score(status, {}, 0.0)
    return RunScore(value, status, message, {}, time.perf_counter() - started)


def evaluate(
    evaluations: Sequence[Evaluation], objective: Objective, executor: Executor, limit: float
) -> Iterator[tuple[int, RunScore]]:
    """The scores of runs, each with its position, as they come.

    A run whose worker died is done once more; then it is scored as one that failed.

    Args:
        evaluations: The runs.
        objective: What is scored.
        executor: What does them.
        limit: Wall time that a run may take (s).
    """
    left = {
        executor.submit(score, evaluation, objective, limit): position
        for position, evaluation in enumerate(evaluations)
    }
    again: set[int] = set()
    try:
        while left:
            for future in wait(left, return_when=FIRST_COMPLETED).done:
                position = left.pop(future)
                try:
                    yield position, future.result()
                except WorkerLostError as error:
                    if position in again:
                        yield position, _lost(error, objective)
                        continue
                    again.add(position)
                    left[executor.submit(score, evaluations[position], objective, limit)] = position
    finally:
        for future in left:
            future.cancel()


def _lost(error: WorkerLostError, objective: Objective) -> RunScore:
    value = objective.score("failed", {}, 0.0)
    return RunScore(value, "failed", f"twice, {error}", {}, 0.0)


def _loaded(key: str, spec: RobotSpec) -> MobileManipulator:
    """The robot, loaded once a worker."""
    robots: dict[str, MobileManipulator] = getattr(_here, "robots", {})
    if key not in robots:
        robots[key] = load_robot(spec)
        _here.robots = robots
    return robots[key]
