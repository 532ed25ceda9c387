"""What the page shows: robots, runs and how they are laid out, independent of how it gets there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.simulation.record import Record
from mobman.viewer.colours import run_colour
from mobman.viewer.labels import labels
from mobman.viewer.motion import Motion, motion
from mobman.viewer.robot_scene import Geometries, robot_scene
from mobman.viewer.run_robot import robot_of_run

Layout = Literal["overlay", "side-by-side"]
LAYOUTS: tuple[Layout, Layout] = ("overlay", "side-by-side")
_DECADES = 8
_FAR = 3.0
"""Where a run that flies away leaves the picture, in sizes of its desired path."""
_MARGIN = 0.4


@dataclass(frozen=True)
class Scene:
    """Everything that a page shows, as plain data; ``content`` is JSON but for its size."""

    title: str
    content: dict[str, Any]
    warnings: tuple[str, ...] = field(default=())
    """What is drawn otherwise than it should be, for people."""

    @property
    def duration(self) -> float:
        """Of its longest run (s); 0 for a robot."""
        return float(self.content["duration"])


@dataclass(frozen=True)
class Run:
    """A record, what to call it and where it came from."""

    record: Record
    name: str
    folder: Path | None = None
    robot: MobileManipulator | None = None
    """The robot itself, where it is at hand."""


def scene_of_robot(robot: MobileManipulator) -> Scene:
    """A robot at rest, to be moved by hand."""
    geometries = Geometries()
    content, warnings = robot_scene(robot, geometries)
    points = _robot_points(robot, robot.q_rest)
    run = {
        "label": robot.name,
        "colour": run_colour(0),
        "robot": 0,
        "motion": None,
        "info": {"robot": robot.name, "description": robot.spec.description},
        "offset": [0.0, 0.0],
    }
    return Scene(
        robot.name,
        {
            "format": 1,
            "title": robot.name,
            "geometries": geometries.described,
            "robots": [content],
            "runs": [run],
            "layout": "overlay",
            "duration": 0.0,
            "start": 0.0,
            "bounds": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
            "error_decades": None,
        },
        warnings,
    )


def scene_of_runs(
    runs: Sequence[Run], *, layout: Layout = "overlay", time: float | None = None
) -> Scene:
    """One run, or several on one clock.

    Args:
        runs: The runs; those whose robot cannot be built are drawn as path and trail, with a warning.
        layout: Of several runs: in one place, or beside each other.
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
    for run in runs:
        if not len(run.record.t):
            raise UsageError(f"run {run.name!r} has no samples")
    geometries = Geometries()
    robots: list[dict[str, Any]] = []
    places: dict[str, int] = {}
    warnings: list[str] = []
    described: list[dict[str, Any]] = []
    motions, extents = [], []
    names = labels([run.record for run in runs], [run.name for run in runs])
    for i, (run, label) in enumerate(zip(runs, names, strict=True)):
        record = run.record
        robot, problem = run.robot, ""
        if robot is None:
            robot, problem = robot_of_run(record, run.folder)
        place = None
        if robot is None:
            warnings.append(
                f"run {run.name!r}: the robot {record.robot!r} is not drawn, only the paths: {problem}"
            )
        else:
            key = repr(robot.spec) + robot.urdf.sha256()
            if key not in places:
                places[key] = len(robots)
                content, robot_warnings = robot_scene(robot, geometries)
                robots.append(content)
                warnings += robot_warnings
            place = places[key]
        moved = motion(record, robot, runs=len(runs))
        motions.append(moved)
        extents.append(_extent(moved, robot))
        described.append(
            {
                "label": label,
                "colour": run_colour(i),
                "robot": place,
                "motion": moved.described(),
                "info": _info(record, None if robot is not None else problem),
            }
        )
    for entry, offset in zip(described, _offsets(extents), strict=True):
        entry["offset"] = offset
    everything = np.vstack(extents)
    duration = max(float(moved.t[-1]) for moved in motions)
    if time is None:
        failed = len(runs) == 1 and not runs[0].record.ok
        time = duration if failed else 0.0
    title = _title(runs)
    content = {
        "format": 1,
        "title": title,
        "geometries": geometries.described,
        "robots": robots,
        "runs": described,
        "layout": layout,
        "duration": duration,
        "start": min(time, duration),
        "bounds": [everything.min(axis=0).tolist(), everything.max(axis=0).tolist()],
        "error_decades": _decades(motions),
    }
    return Scene(title, content, tuple(dict.fromkeys(warnings)))


def _title(runs: Sequence[Run]) -> str:
    records = [run.record for run in runs]
    fields = ("robot", "task", "scenario", "controller")
    parts = [dict.fromkeys(getattr(record, name) for record in records) for name in fields]
    return " · ".join(", ".join(values) for values in parts)


def _info(record: Record, problem: str | None) -> dict[str, Any]:
    return {
        "robot": record.robot,
        "controller": record.controller,
        "task": record.task,
        "scenario": record.scenario,
        "seed": record.seed,
        "status": record.status,
        "message": record.message,
        "problem": problem,
    }


def _robot_points(robot: MobileManipulator, q: Array) -> Array:
    """Points that show how much room a robot takes at q (m), shape (N, 3)."""
    import pinocchio as pin

    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    drives = BASE_JOINTS[0] in robot.joint_names
    elsewhere = {"universe", *BASE_JOINTS[:2]} if drives else set()
    points = [
        np.array(placement.translation)
        for frame, placement in zip(model.frames, data.oMf, strict=True)
        if frame.type == pin.FrameType.BODY and model.names[frame.parentJoint] not in elsewhere
    ]
    ground = [np.array([p[0], p[1], 0.0]) for p in points]
    return np.array([*points, *ground])


def _extent(moved: Motion, robot: MobileManipulator | None) -> Array:
    """Lowest and highest corner of what a run takes (m), shape (2, 3); what flies away is left out."""
    path = moved.desired
    points = [path]
    if robot is not None and moved.q is not None:
        points.append(_robot_points(robot, moved.q[0]))
    start = np.vstack([*points, moved.tip[:1], moved.platform[:1]])
    centre, size = start.mean(axis=0), float(np.linalg.norm(np.ptp(start, axis=0)))
    for track in (moved.tip, moved.platform):
        near = np.linalg.norm(track - centre, axis=1) <= _FAR * size
        points.append(track[near])
    points.append(start)
    everything = np.vstack(points)
    return np.array([everything.min(axis=0), everything.max(axis=0)])


def _offsets(extents: Sequence[Array]) -> list[list[float]]:
    """Where each run goes when they are side by side, along x (m)."""
    widths = [float(extent[1, 0] - extent[0, 0]) + _MARGIN for extent in extents]
    widest = max(widths)
    middle = 0.5 * (len(extents) - 1)
    return [[(i - middle) * widest, 0.0] for i in range(len(extents))]


def _decades(motions: Sequence[Motion]) -> list[int]:
    """Powers of ten between which errors are coloured."""
    errors = np.concatenate([moved.error for moved in motions])
    errors = errors[np.isfinite(errors) & (errors > 0.0)]
    if not len(errors):
        return [-3, 0]
    high = min(math.ceil(math.log10(errors.max())), 2)
    low = math.floor(math.log10(errors.min()))
    return [min(max(low, high - _DECADES), high - 1), high]
