"""The closed loops that are measured: a robot, its task, and gains found beforehand."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

import mobman as mm
from measure.rounds import Measure
from mobman.compiled import worth_joining
from mobman.controllers.protocol import Controller
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task, make_task

DT = 1e-3
"""Sampling period (s) of all closed loops but those that vary it."""
PAPER_GAINS = {"a": 0.2, "A": 0.2}
"""The paper's, for its own robot and task."""

Tick = tuple[float, np.ndarray, np.ndarray, np.ndarray]
"""What a controller is told at a tick: t, q, z, z'."""


@dataclass(frozen=True)
class Case:
    """A closed loop of ``tsm``."""

    robot: MobileManipulator
    task: Task
    gains: dict[str, float]
    """a of (22) and A of (54) as numbers, so that no run samples them anew."""

    def controller(self) -> Controller:
        """A new controller with these gains."""
        return mm.make_controller("tsm", **self.gains)

    def run(self, ticks: int, dt: float = DT, controller: Controller | None = None) -> Any:
        """The record of a run of that many ticks; RuntimeError if it fails."""
        record = mm.simulate(
            self.robot,
            self.controller() if controller is None else controller,
            self.task,
            duration=ticks * dt,
            dt=dt,
        )
        if not record.ok:
            raise RuntimeError(f"{self.robot.name}: the run is {record.status} {record.message}")
        return record


def case_of(robot: MobileManipulator) -> Case:
    """The paper's task and gains for its youBot; ``circle`` and the automatic bounds for others."""
    if robot.name == "youbot":
        return Case(robot, make_task("paper", robot), PAPER_GAINS)
    task = make_task("circle", robot)
    controller: Any = mm.make_controller("tsm")
    controller.reset(robot, task, DT)
    found = controller.settings()
    return Case(robot, task, {"a": found["a"], "A": found["A"]})


class _Taping:
    """A controller that keeps what it is told."""

    def __init__(self, inner: Controller) -> None:
        self._inner = inner
        self.ticks: list[Tick] = []

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        self._inner.reset(robot, task, dt)

    def step(self, t: float, q: np.ndarray, z: np.ndarray, z_dot: np.ndarray) -> np.ndarray:
        self.ticks.append((t, q.copy(), z.copy(), z_dot.copy()))
        return self._inner.step(t, q, z, z_dot)


def tape(case: Case, ticks: int) -> list[Tick]:
    """What the controller is told in a run of that many ticks."""
    taping = _Taping(case.controller())
    case.run(ticks, controller=taping)
    return taping.ticks


def replay(case: Case, told: list[Tick]) -> Measure:
    """The measure of a controller's step, as a long run has it: told again what it was told, in order,
    after a reset and a first step, which loads machine code."""
    controller = case.controller()

    def measure() -> float:
        with worth_joining(True):
            controller.reset(case.robot, case.task, DT)
        step = controller.step
        step(*told[0])
        started = perf_counter()
        for t, q, z, z_dot in told:
            step(t, q, z, z_dot)
        return (perf_counter() - started) / len(told)

    return measure
