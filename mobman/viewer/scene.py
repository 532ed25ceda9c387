"""Scenes as plain data: robots, runs and their layout, independent of the page that shows them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.simulation.record import Record
from mobman.viewer.meshes import Surface
from mobman.viewer.page import packed
from mobman.viewer.replay import Motion, motion, robot_of_run
from mobman.viewer.robot import Primitive, robot_scene

Layout = Literal["overlay", "side-by-side"]
LAYOUTS: tuple[Layout, Layout] = ("overlay", "side-by-side")
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c564b")
"""Colours of runs; the first can be distinguished with any colour vision (Okabe and Ito)."""
_DECADES = 8
_FAR = 3.0
"""The distance at which a run that flies away leaves the picture, in sizes of its desired path."""
_MARGIN = 0.4


@dataclass(frozen=True)
class Scene:
    """Everything that a page shows, as plain data; ``content`` is JSON."""

    title: str
    content: dict[str, Any]
    warnings: tuple[str, ...] = ()
    """Messages about what is drawn otherwise than it should be."""

    @property
    def duration(self) -> float:
        """Duration of the longest run (s); 0 for a robot."""
        return float(self.content["duration"])


@dataclass(frozen=True)
class ShownRun:
    """A record, its name and where it came from."""

    record: Record
    name: str
    folder: Path | None = None
    robot: MobileManipulator | None = None
    """The robot itself, where it is at hand."""


def scene_of_robot(robot: MobileManipulator) -> Scene:
    """A robot at rest, to be moved by hand."""
    info = {"robot": robot.name, "description": robot.spec.description}
    drawn = _Drawn()
    run = _run(0, robot.name, drawn.add(robot), None, info)
    return drawn.scene(robot.name, [run], _robot_points(robot, robot.q_rest))


def scene_of_runs(
    runs: Sequence[ShownRun], *, layout: Layout = "overlay", time: float | None = None
) -> Scene:
    """One run, or several on one clock.

    Args:
        runs: The runs; those whose robot cannot be built are drawn as path and trail, with a warning.
        layout: Of several runs: in one place, or side by side.
        time: What it opens at (s); the end of a single run that failed, and else its beginning, by
            default.

    Raises:
        UsageError: If there is no run, a run has no sample, or the time is no number.
    """
    if not runs:
        raise UsageError("there is no run to show")
    if layout not in LAYOUTS:
        raise UsageError(f"layout = {layout!r}: allowed: {', '.join(LAYOUTS)}")
    if time is not None and not (math.isfinite(time) and time >= 0.0):
        raise UsageError(f"time = {time!r}: must be a number, 0 or more (s)")
    drawn = _Drawn()
    motions, extents, described = [], [], []
    records = [run.record for run in runs]
    names = labels(records, [run.name for run in runs])
    for i, (run, label) in enumerate(zip(runs, names, strict=True)):
        record = run.record
        if not len(record.t):
            raise UsageError(f"run {run.name!r} has no samples")
        robot, problem = run.robot, ""
        if robot is None:
            robot, problem = robot_of_run(record, run.folder)
        if robot is None:
            drawn.warnings.append(
                f"run {run.name!r}: the robot {record.robot!r} is not drawn, only the paths: {problem}"
            )
        info: dict[str, Any] = {"problem": None if robot is not None else problem}
        for field in ("robot", "controller", "task", "scenario", "seed", "status", "message"):
            info[field] = getattr(record, field)
        moved = motion(record, robot, runs=len(runs))
        motions.append(moved)
        extents.append(_extent(moved, robot))
        place = None if robot is None else drawn.add(robot)
        described.append(_run(i, label, place, moved, info))
    widest = max(float(np.ptp(extent[:, 0])) for extent in extents) + _MARGIN
    for i, entry in enumerate(described):
        entry["offset"] = [(i - 0.5 * (len(runs) - 1)) * widest, 0.0]
    duration = max(float(moved.t[-1]) for moved in motions)
    if time is None:
        failed = len(runs) == 1 and not records[0].ok
        time = duration if failed else 0.0
    parts = [
        ", ".join(dict.fromkeys(getattr(record, field) for record in records))
        for field in ("robot", "task", "scenario", "controller")
    ]
    return drawn.scene(
        " · ".join(parts),
        described,
        np.vstack(extents),
        layout=layout,
        duration=duration,
        start=min(time, duration),
        error_decades=_decades(motions),
    )


def scene_to_come(
    robot: MobileManipulator, path: Motion, info: dict[str, Any], duration: float
) -> Scene:
    """A robot at rest where a run begins, and the path that is before it.

    Args:
        robot: The robot.
        path: The motion that stays at rest for the duration of the run.
        info: What runs: robot, controller, task, scenario, seed, status and message.
        duration: Of the run (s).
    """
    start = Motion(*(None if part is None else part[:1] for part in path))  # type: ignore[arg-type]
    drawn = _Drawn()
    run = _run(0, info["controller"], drawn.add(robot), start, info)
    run["motion"]["path"] = packed(path.desired, "f8")
    title = " · ".join(info[field] for field in ("robot", "task", "scenario", "controller"))
    return drawn.scene(
        title,
        [run],
        _extent(path, robot),
        duration=duration,
        error_decades=_decades([path]),
        live=True,
    )


class _Drawn:
    """The robots and shapes of a scene, each once, and what could not be drawn."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self._robots: dict[str, dict[str, Any]] = {}
        self._shapes: list[Primitive | Surface] = []

    def add(self, robot: MobileManipulator) -> int:
        """The place of a robot among those of the scene."""
        key = repr(robot.spec) + robot.urdf.sha256()
        if key not in self._robots:
            self._robots[key], warnings = robot_scene(robot, self._shapes)
            self.warnings += warnings
        return list(self._robots).index(key)

    def scene(self, title: str, runs: list[dict[str, Any]], points: Array, **rest: Any) -> Scene:
        """The scene, with some runs that lie within some points (m), shape (N, 3)."""
        content = {
            "title": title,
            "geometries": [shape.described() for shape in self._shapes],
            "robots": list(self._robots.values()),
            "runs": runs,
            "bounds": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
            "layout": "overlay",
            "duration": 0.0,
            "start": 0.0,
            "error_decades": None,
            **rest,
        }
        return Scene(title, content, tuple(dict.fromkeys(self.warnings)))


def _run(
    index: int, label: str, robot: int | None, moved: Motion | None, info: dict[str, Any]
) -> dict[str, Any]:
    return {
        "label": label,
        "colour": _COLOURS[index % len(_COLOURS)],
        "robot": robot,
        "motion": None if moved is None else moved.described(),
        "info": info,
        "offset": [0.0, 0.0],
    }


def labels(records: Sequence[Record], names: Sequence[str]) -> list[str]:
    """Labels of runs in a comparison: what tells each from the others.

    Args:
        records: The runs.
        names: What to call those that are alike in everything, such as their files' names.
    """
    described = [(r.robot, r.controller, r.task, r.scenario, f"seed {r.seed}") for r in records]
    telling = [field for field in zip(*described, strict=True) if len(set(field)) > 1]
    found = [" · ".join(parts) for parts in zip(*telling, strict=True)]
    found = found or [record.controller for record in records]
    often = Counter(found)
    return [
        f"{label} · {name}" if often[label] > 1 else label
        for label, name in zip(found, names, strict=True)
    ]


def _robot_points(robot: MobileManipulator, q: Array) -> Array:
    """Points that show how much room a robot takes at q (m), shape (N, 3)."""
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    drives = BASE_JOINTS[0] in robot.joint_names
    elsewhere = {"universe", *BASE_JOINTS[:2]} if drives else set()
    points = [
        np.array(placement.translation)
        for frame, placement in zip(model.frames, data.oMf, strict=True)
        if frame.type == pin.FrameType.BODY and model.names[frame.parentJoint] not in elsewhere
    ]
    return np.array([*points, *(point * [1.0, 1.0, 0.0] for point in points)])


def _extent(moved: Motion, robot: MobileManipulator | None) -> Array:
    """Lowest and highest corner of what a run takes (m), shape (2, 3); what flies away is left out."""
    points = [moved.desired, moved.tip[:1], moved.platform[:1]]
    if robot is not None and moved.q is not None:
        points.append(_robot_points(robot, moved.q[0]))
    start = np.vstack(points)
    centre, size = start.mean(axis=0), float(np.linalg.norm(np.ptp(start, axis=0)))
    for track in (moved.tip, moved.platform):
        points.append(track[np.linalg.norm(track - centre, axis=1) <= _FAR * size])
    everything = np.vstack(points)
    return np.array([everything.min(axis=0), everything.max(axis=0)])


def _decades(motions: Sequence[Motion]) -> list[int]:
    """Powers of ten between which errors are coloured."""
    errors = np.concatenate([moved.error for moved in motions])
    errors = errors[np.isfinite(errors) & (errors > 0.0)]
    if not len(errors):
        return [-3, 0]
    high = min(math.ceil(math.log10(errors.max())), 2)
    low = math.floor(math.log10(errors.min()))
    return [min(max(low, high - _DECADES), high - 1), high]
