"""A run while it goes, and the news for its page."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Mapping
from time import perf_counter, sleep
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.record import Record
from mobman.tasks.task import make_task
from mobman.viewer.replay import FRAMES_PER_SECOND, MOST_FRAMES, Motion, States, motion
from mobman.viewer.scene import ShownRun, scene_of_runs, scene_to_come

_BEHIND = 0.1
"""Delay behind the clock that a run makes up for (s); a longer one is kept."""


class LiveRun:
    """Shows a run that is being simulated, without a part in it.

    It is given copies of the state, and computes from them with a robot and a task of its own, since it
    does so in another thread than the simulation.

    Args:
        robot: The robot, at rest where it begins.
        task: The task's name.
        task_options: Its parameters that are not to have their defaults.
        duration: Of the run (s).
        speed: Simulated seconds a second at most; None for as fast as it goes.
        controller: Its name, to be shown.
        scenario: Its name, to be shown.
        seed: To be shown.

    Raises:
        UsageError: If the speed or the duration is not a positive number.

    Attributes:
        scene: The page's, as the run begins.
        every: Simulated time from one look at the run to the next (s).
    """

    def __init__(
        self,
        robot: MobileManipulator,
        task: str,
        *,
        task_options: Mapping[str, Any] | None = None,
        duration: float,
        speed: float | None = 1.0,
        controller: str = "",
        scenario: str = "",
        seed: int = 0,
    ) -> None:
        for name, value in (("speed", speed), ("duration", duration)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise UsageError(f"{name} = {value!r}: must be a positive number")
        self.every = max(1.0 / FRAMES_PER_SECOND, duration / MOST_FRAMES)
        self._speed = speed
        self._began: float | None = None
        self._robot = load_robot(robot.spec)
        self._task = make_task(task, self._robot, **(task_options or {}))
        self._samples: list[tuple[float, Array, Array, Array]] = []
        self._asked = threading.Event()
        self._whole: str | None = None
        q, still = self._robot.q_rest, np.zeros(self._robot.nz)
        rest = self._motion([(t, q, still, still) for t in np.arange(0.0, duration, self.every)])
        info: dict[str, Any] = {"seed": seed, "status": "ok", "message": "", "problem": None}
        info |= {"robot": robot.name, "controller": controller, "task": task, "scenario": scenario}
        self.scene = scene_to_come(self._robot, rest, info, duration)

    def observe(self, t: float, q: Array, z: Array, torque: Array) -> None:
        """Take a state; returns when it is time to go on."""
        self._samples.append((t, q.copy(), z.copy(), torque.copy()))
        if self._speed is None:
            return
        now, due = perf_counter(), t / self._speed
        if self._began is None or now - self._began - due > _BEHIND:
            self._began = now - due
        if (early := self._began + due - now) > 0.0:
            sleep(early)

    def finish(self, record: Record) -> None:
        """The run has ended: from now on, the page is told all of it."""
        content = scene_of_runs([ShownRun(record, record.controller, robot=self._robot)]).content
        told = {name: content["runs"][0][name] for name in ("motion", "info")}
        told |= {"ended": True, "error_decades": content["error_decades"]}
        self._whole = json.dumps(told)

    def wait_for_page(self, seconds: float) -> bool:
        """Wait until a page asks for frames; return whether one did in time."""
        return self._asked.wait(seconds)

    def frames(self, after: float) -> str:
        """The news for a page that has the frames up to a time (s), as JSON."""
        self._asked.set()
        if self._whole is not None:
            return self._whole
        samples = self._samples[:]
        count = len(samples)
        while count and samples[count - 1][0] > after:
            count -= 1
        later = samples[count:]
        return json.dumps({"motion": self._motion(later).described()} if later else {})

    def _motion(self, samples: list[tuple[float, Array, Array, Array]]) -> Motion:
        t, q, z, torque = (np.array(part) for part in zip(*samples, strict=True))
        desired = np.array([self._task.desired(float(instant))[0] for instant in t])
        m, robot = desired.shape[1], self._robot
        tip = np.array([robot.tip_pose(row).translation[:m] for row in q])
        return motion(
            States(t, q, z, torque, tip, desired, tip - desired, robot.joint_names), robot
        )
