"""A run while it goes: what its page is told."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Mapping
from dataclasses import replace
from time import perf_counter, sleep
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.record import Record
from mobman.tasks.task import make_task
from mobman.viewer.motion import FRAMES_PER_SECOND, MOST_FRAMES, motion
from mobman.viewer.scene import Run, Scene, scene_of_runs

_BEHIND = 0.1
"""How far a run may fall behind the clock and make up for it (s); what is more is lost."""


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
        every: How often the run is to be looked at (s of simulated time).
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
        self._like = _record(self._robot, controller, task, scenario, seed)
        self.scene = self._beginning(duration)

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
        scene = scene_of_runs([Run(record, record.controller, robot=self._robot)])
        run = scene.content["runs"][0]
        self._whole = json.dumps(
            {
                "ended": True,
                "motion": run["motion"],
                "info": run["info"],
                "error_decades": scene.content["error_decades"],
            }
        )

    def wait_for_page(self, seconds: float) -> bool:
        """Wait until a page asks for frames; whether one did in time."""
        return self._asked.wait(seconds)

    def frames(self, after: float) -> str:
        """What a page is to be told that has the frames up to a time (s), as JSON."""
        self._asked.set()
        if self._whole is not None:
            return self._whole
        later: list[tuple[float, Array, Array, Array]] = []
        for sample in reversed(self._samples[:]):
            if not sample[0] > after:
                break
            later.append(sample)
        if not later:
            return "{}"
        t, q, z, torque = (np.array(part) for part in zip(*reversed(later), strict=True))
        moved = motion(self._so_far(t, q, z, torque), self._robot)
        return json.dumps({"motion": moved.described()})

    def _beginning(self, duration: float) -> Scene:
        """The robot at rest, and the path that is before it."""
        t = np.arange(0.0, duration, self.every)
        rest = np.tile(self._robot.q_rest, (len(t), 1))
        still = np.zeros((len(t), self._robot.nz))
        record = self._so_far(t, rest, still, still)
        scene = scene_of_runs([Run(record, record.controller, robot=self._robot)])
        path = scene.content["runs"][0]["motion"]["desired"]
        first = self._so_far(t[:1], rest[:1], still[:1], still[:1])
        run = {
            **scene.content["runs"][0],
            "motion": {**motion(first, self._robot).described(), "path": path},
        }
        content = {**scene.content, "runs": [run], "duration": duration, "live": True}
        return replace(scene, content=content)

    def _so_far(self, t: Array, q: Array, z: Array, torque: Array) -> Record:
        """A record of some samples."""
        desired = np.array([self._task.desired(float(instant))[0] for instant in t])
        m = desired.shape[1]
        tip = np.array([self._robot.tip_pose(row).translation[:m] for row in q])
        return replace(
            self._like,
            t=t,
            q=q,
            z=z,
            torque=torque,
            tip_position=tip,
            tip_desired=desired,
            task_error=tip - desired,
        )


def _record(
    robot: MobileManipulator, controller: str, task: str, scenario: str, seed: int
) -> Record:
    """A record without samples, that says what it is of."""
    none = np.zeros((0, 0))
    return Record(
        t=np.zeros(0),
        q=none,
        z=none,
        torque=none,
        tip_position=none,
        tip_desired=none,
        task_error=none,
        auxiliary_error=none,
        compute_time=np.zeros(0),
        signals={},
        metrics={},
        status="ok",
        message="",
        robot=robot.name,
        controller=controller,
        task=task,
        scenario=scenario,
        seed=seed,
        spec={"robot": robot.spec.model_dump(mode="json", by_alias=True)},
        settings={},
        versions={},
        urdf_sha256=robot.urdf.sha256(),
        created="",
        joint_names=list(robot.joint_names),
        velocity_names=list(robot.velocity_names),
    )
