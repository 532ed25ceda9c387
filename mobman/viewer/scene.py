"""Scenes as plain data: robots, runs and their layout, independent of the page that shows them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import MobmanError, SpecError, UsageError
from mobman.figures.looks import LAWS, MOTORS, looks_of
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import find_spec, list_robots
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.read import UrdfSources, urdf_file, urdf_sources
from mobman.simulation.monitors import MARGINS, ratios_of
from mobman.simulation.parts import robot_of
from mobman.simulation.record import Record
from mobman.viewer.meshes import Surface, packed
from mobman.viewer.robot import Primitive, robot_points, robot_scene

Layout = Literal["overlay", "side-by-side"]
CAMERAS = {
    "front": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "side": (0.0, -1.0, 0.0),
    "top": (0.0, 0.0, 1.0),
    "iso": (1.0, -1.0, 1.0),
}
"""Directions to look from, in the world's axes: x is ahead of a robot at heading 0."""
_FIELDS = ("robot", "controller", "task", "scenario", "seed", "status", "message")
"""Fields of a record that the page shows."""
FRAMES_PER_SECOND = 60.0
"""Rate of most displays (Hz)."""
MOST_FRAMES = 12_000
"""Frames of all runs of a page together; longer runs get fewer a second. The page goes from frame to
frame along cubics with the run's own rates, so that few frames do not show."""
_FEWEST = 600
_DECADES = 8
_FAR = 3.0
"""The distance at which a run that flies away leaves the picture, in sizes of its desired path."""
_MARGIN = 0.4


class SampledRun(NamedTuple):
    """A run at N of its own samples; what it does not have is None."""

    t: Array  # s, shape (N,)
    tip: Array  # Tip position (m), shape (N, 3)
    desired: Array  # p_d (m), shape (N, 3)
    error: Array  # |e^e| (m), shape (N,)
    platform: Array  # The platform's reference point (m), shape (N, 3)
    q: Array | None = None  # Configuration, shape (N, nq); it and the two below of a known robot
    q_dot: Array | None = None  # Rate of the configuration, shape (N, nq)
    effort: Array | None = None
    """B' v: the generalised force on each coordinate (N m, N), shape (N, nq)."""
    turn: Array | None = None
    """Desired orientation: unit quaternion (x, y, z, w), shape (N, 4), or direction, shape (N, 3)."""
    angle: Array | None = None  # Angle between the tip and that (rad), shape (N,)
    margins: Array | None = None
    """Margins of the gains of both stages in a monitored run, the least until the next sample;
    shape (N, 2)."""
    path: Array | None = None  # p_d of all of the run (m), shape (M, 3), if it has only begun

    def begun(self) -> SampledRun:
        """Keep the first sample, and the desired path."""
        first = (None if part is None else part[:1] for part in self)
        return SampledRun(*first)._replace(path=self.desired)  # type: ignore[arg-type]

    def described(self) -> dict[str, Any]:
        """The motion for the page."""
        double = ("t", "tip", "desired", "q", "q_dot", "path")
        return {
            name: None if array is None else packed(array, "f8" if name in double else "f4")
            for name, array in self._asdict().items()
        }


States = Record | SimpleNamespace
"""A record, or what a scene needs of one, of a run that has none yet."""


def motion(record: States, robot: MobileManipulator | None, *, runs: int = 1) -> SampledRun:
    """Take a run's motion from its samples, with its robot if that is known; ``runs`` share the page."""
    kept = frames(record.t, max(_FEWEST, MOST_FRAMES // runs))
    t, q, z, torque = (part[kept] for part in (record.t, record.q, record.z, record.torque))
    m = min(3, record.tip_position.shape[1])
    tip, desired, platform = np.zeros((3, len(t), 3))
    tip[:, :m], desired[:, :m] = record.tip_position[kept, :m], record.tip_desired[kept, :m]
    for i, name in enumerate(BASE_JOINTS[:2]):
        if name in record.joint_names:
            platform[:, i] = q[:, record.joint_names.index(name)]
    error = np.linalg.norm(record.task_error[kept, :3], axis=1)
    turn, angle, margins = record.tip_desired_orientation, None, None
    if turn is not None:
        turn = turn[kept] if turn.shape[1] == 3 else np.roll(turn[kept], -1, axis=1)
        half = 0.5 * np.linalg.norm(record.task_error[kept, 3:], axis=1)
        angle = 2.0 * np.arcsin(np.minimum(half, 1.0))
    if own := ratios_of(getattr(record, "signals", {})):
        margins = np.array([np.fmin.reduceat(one, kept) for one in own[MARGINS].values()]).T
    sampled = SampledRun(t, tip, desired, error, platform, turn=turn, angle=angle, margins=margins)
    if robot is None:
        return sampled
    if m < 3:  # a planar task says nothing of the height
        tip[:, 2] = desired[:, 2] = [robot.tip_pose(row).translation[2] for row in q]
    q_dot = np.array([robot.velocity_map(a) @ b for a, b in zip(q, z, strict=True)])
    effort = np.array([robot.actuation(a) @ b for a, b in zip(q, torque, strict=True)])
    return sampled._replace(q=q, q_dot=q_dot, effort=effort)


def frames(t: Array, most: int = MOST_FRAMES) -> Index:
    """Choose samples by their rising times (s): first, last, 60 a second, ``most`` at most."""
    count = min(most, int(np.ceil((t[-1] - t[0]) * FRAMES_PER_SECOND)) + 1)
    if len(t) <= count:
        return np.arange(len(t))
    wanted = np.linspace(t[0], t[-1], max(count, 2))
    after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    nearer = wanted - t[after - 1] < t[after] - wanted
    return np.unique(np.where(nearer, after - 1, after))


@dataclass(frozen=True)
class Scene:
    """Everything that a page shows, as plain data; ``content`` is JSON."""

    title: str
    content: dict[str, Any]
    warnings: tuple[str, ...] = ()  # Messages about what is drawn otherwise than it should be

    @property
    def duration(self) -> float:
        """Duration of the longest run (s); 0 for a robot."""
        return float(self.content["duration"])


@dataclass(frozen=True)
class ShownRun:
    """A record, its name and where it came from."""

    record: States
    name: str
    folder: Path | None = None
    robot: MobileManipulator | None = None  # The robot itself, where it is at hand


def direction(camera: str | Sequence[float] | None) -> tuple[float, ...] | None:
    """Read a direction to look from: one of :data:`CAMERAS`, three numbers, or these as text,
    ``"1,-1,0.5"``; None for none. UsageError if it is neither."""
    if camera is None:
        return None
    if isinstance(camera, str) and camera in CAMERAS:
        return CAMERAS[camera]
    try:
        parts = camera.split(",") if isinstance(camera, str) else camera
        found = tuple(float(part) for part in parts)
    except (TypeError, ValueError):
        found = ()
    if len(found) != 3 or not all(map(math.isfinite, found)) or not any(found):
        raise UsageError(
            f"camera = {camera!r}: allowed: {', '.join(CAMERAS)}, or three numbers x,y,z, the "
            "direction to look from, not all 0"
        )
    return found


def check_view(time: Any = None, layout: Any = "overlay") -> None:
    """Check an instant of a run (s; None is any), and how several runs are laid out; UsageError if the
    time is no number from 0 on, or there is no such layout."""
    if layout not in get_args(Layout):
        raise UsageError(f"layout = {layout!r}: allowed: {', '.join(get_args(Layout))}")
    if time is not None and not (isinstance(time, Real) and 0.0 <= float(time) < math.inf):
        raise UsageError(f"time = {time!r}: must be a number, 0 or more (s)")


def scene_of_robot(
    robot: MobileManipulator, *, camera: str | Sequence[float] | None = None
) -> Scene:
    """Show a robot at rest, to be moved by hand; ``camera`` as of :func:`direction`."""
    info = {"robot": robot.name, "description": robot.spec.description}
    run = {"label": robot.name, "colour": LAWS["tsm"], "motion": None, "info": info}
    points = robot_points(robot, robot.q_rest)
    return _scene(robot.name, [(run, robot)], [points], camera=direction(camera))


def scene_of_runs(
    runs: Sequence[ShownRun],
    *,
    layout: Layout = "overlay",
    time: float | None = None,
    live: bool = False,
    camera: str | Sequence[float] | None = None,
) -> Scene:
    """Show one run, or several on one clock.

    Args:
        runs: The runs; those whose robot cannot be built are drawn as path and trail, with a warning.
        layout: Layout of several runs: in one place, or side by side.
        time: Time that it opens at (s); the end of a single run that failed, and else its beginning, by
            default.
        live: True to show the first sample and the desired path alone: the page follows the rest.
        camera: As of :func:`direction`.

    Raises:
        UsageError: If there is no run, a run has no sample, or as of :func:`check_view`.
    """
    if not runs:
        raise UsageError("there is no run to show")
    check_view(time, layout)
    records = [run.record for run in runs]
    shown, motions, extents, warnings = [], [], [], []
    # a run has the colour of its law, of several runs of one law the first
    looks = looks_of({str(i): record.controller for i, record in enumerate(records)}).values()
    names = labels(records, [run.name for run in runs])
    for run, label, look in zip(runs, names, looks, strict=True):
        record, robot, problem = run.record, run.robot, None
        if not len(record.t):
            raise UsageError(f"run {run.name!r} has no samples")
        if robot is None and isinstance(record, Record):
            robot, problem = robot_of_run(record, run.folder)
        if robot is None:
            warnings.append(
                f"run {run.name!r}: the robot {record.robot!r} is not drawn, only the paths: {problem}"
            )
        moved = motion(record, robot, runs=len(runs))
        motions.append(moved)
        extents.append(_extent(moved, robot))
        info = {field: getattr(record, field) for field in _FIELDS}
        info["problem"] = problem if robot is None else None
        frames = (moved.begun() if live else moved).described()
        content = {"label": label, "colour": look.colour, "motion": frames, "info": info}
        shown.append((content, robot))
    duration = max(float(moved.t[-1]) for moved in motions)
    if time is None:
        time = duration if len(runs) == 1 and records[0].status != "ok" else 0.0
    title = " · ".join(
        ", ".join(dict.fromkeys(getattr(record, field) for record in records))
        for field in ("robot", "task", "scenario", "controller")
    )
    clock = {"duration": duration, "start": min(time, duration), "live": live}
    decades, seen_from = _decades(motions), direction(camera)
    rest = {"layout": layout, **clock, "error_decades": decades, "camera": seen_from}
    return _scene(title, shown, extents, warnings, **rest)


def _scene(
    title: str,
    runs: Sequence[tuple[dict[str, Any], MobileManipulator | None]],
    extents: Sequence[Array],
    warnings: Sequence[str] = (),
    **rest: Any,
) -> Scene:
    """A scene of runs with their robots, which lie within some points (m), each of shape (N, 3)."""
    robots: dict[str, dict[str, Any]] = {}
    shapes: list[Primitive | Surface] = []
    told = list(warnings)
    widest = max(float(np.ptp(extent[:, 0])) for extent in extents) + _MARGIN
    for i, (run, robot) in enumerate(runs):
        place = None
        if robot is not None:
            key = repr(robot.spec) + robot.urdf.sha256()
            if key not in robots:
                robots[key], problems = robot_scene(robot, shapes)
                told += problems
            place = list(robots).index(key)
        offset = [(i - 0.5 * (len(runs) - 1)) * widest, 0.0]
        run |= {"robot": place, "offset": offset}
    points = np.vstack(extents)
    content = {
        "title": title,
        "geometries": [shape.described() for shape in shapes],
        "robots": list(robots.values()),
        "runs": [run for run, _ in runs],
        "bounds": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
        "layout": "overlay",
        "duration": 0.0,
        "start": 0.0,
        "error_decades": None,
        "palette": MOTORS,
        "cameras": CAMERAS,
        **rest,
    }
    return Scene(title, content, tuple(dict.fromkeys(told)))


def labels(records: Sequence[States], names: Sequence[str]) -> list[str]:
    """Label runs in a comparison by what distinguishes them; those alike in all also by names."""
    described = [(r.robot, r.controller, r.task, r.scenario, f"seed {r.seed}") for r in records]
    telling = [field for field in zip(*described, strict=True) if len(set(field)) > 1]
    found = [" · ".join(parts) for parts in zip(*telling, strict=True)]
    found = found or [record.controller for record in records]
    often = Counter(found)
    return [
        f"{label} · {name}" if often[label] > 1 else label
        for label, name in zip(found, names, strict=True)
    ]


def _extent(moved: SampledRun, robot: MobileManipulator | None) -> Array:
    """Lowest and highest corner of what a run takes (m), shape (2, 3); what flies away is left out."""
    points = [moved.desired, moved.tip[:1], moved.platform[:1]]
    if robot is not None and moved.q is not None:
        points.append(robot_points(robot, moved.q[0]))
    start = np.vstack(points)
    centre, size = start.mean(axis=0), float(np.linalg.norm(np.ptp(start, axis=0)))
    for track in (moved.tip, moved.platform):
        points.append(track[np.linalg.norm(track - centre, axis=1) <= _FAR * size])
    everything = np.vstack(points)
    return np.array([everything.min(axis=0), everything.max(axis=0)])


def _decades(motions: Sequence[SampledRun]) -> list[int]:
    """Powers of ten between which errors are coloured."""
    errors = np.concatenate([moved.error for moved in motions])
    errors = errors[np.isfinite(errors) & (errors > 0.0)]
    if not len(errors):
        return [-3, 0]
    high = min(math.ceil(math.log10(errors.max())), 2)
    low = math.floor(math.log10(errors.min()))
    return [min(max(low, high - _DECADES), high - 1), high]


def robot_of_run(
    record: Record, folder: Path | None = None
) -> tuple[MobileManipulator | None, str]:
    """Build the robot of a run from the description and the URDFs in its record.

    Meshes are looked for where the registered robot of that name has them, if it has the run's URDF (by
    its hash), or else in ``folder``, and nowhere else. A platform that is Python code is the registered
    robot's, and only if that has the same description: a record runs no code. ``folder`` is that of the
    record's file, the working directory if it has none.

    Returns:
        The robot, or None and why there is none.
    """
    try:
        robot = robot_of(record.spec.get("robot", {}), record.urdf)
        if (found := robot.urdf.sha256()) != record.urdf_sha256:
            raise SpecError(
                f"the URDF in the record is not the run's (SHA-256 {found[:12]}..., the run's "
                f"{record.urdf_sha256[:12]}...)"
            )
        if robot.joint_names != record.joint_names or robot.nz != record.z.shape[1]:
            raise SpecError("its coordinates are not the run's")
    except MobmanError as error:
        return None, str(error.__cause__ or error)
    robot.urdf = _with_meshes(robot, (folder or Path.cwd()).resolve())
    return robot, ""


def _with_meshes(robot: MobileManipulator, folder: Path) -> UrdfSources:
    """The URDFs of a robot, at the places that their meshes are looked for from."""
    with suppress(MobmanError):
        if robot.name in list_robots():  # it is a name alone, never a path
            registered = urdf_sources(find_spec(robot.name))
            if registered.sha256() == robot.urdf.sha256():
                return registered
    files = []
    for part, file in zip(robot.spec.parts, robot.urdf.files, strict=True):
        place = replace(file, path=folder / part.path, package_folders=(folder,), within=(folder,))
        if part.package is not None:
            with suppress(MobmanError):
                installed = urdf_file(part, folder, "field 'urdf")
                place = installed if installed.sha256() == file.sha256() else place
        files.append(place)
    return UrdfSources(tuple(files))
