"""A recorded run for the page: its robot, if it can still be built, and its samples at the rate of a
display."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import MobmanError, SpecError
from mobman.model.build import build_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, find_spec, list_robots, registered_as
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.robots.urdf.read import UrdfSources, urdf_sources
from mobman.simulation.record import Record
from mobman.viewer.page import packed

FRAMES_PER_SECOND = 60.0
"""Rate of most displays (Hz)."""
MOST_FRAMES = 12_000
"""Frames of all runs of a page together; longer runs get fewer a second. The page goes from frame to
frame along cubics with the run's own rates, so that few frames do not show."""
_FEWEST = 600


class Motion(NamedTuple):
    """A run at N of its own samples."""

    t: Array
    """s, shape (N,)."""
    tip: Array
    """Tip position (m), shape (N, 3)."""
    desired: Array
    """p_d (m), shape (N, 3)."""
    error: Array
    """|e^e| (m), shape (N,)."""
    platform: Array
    """The platform's reference point (m), shape (N, 3)."""
    q: Array | None = None
    """Configuration, shape (N, nq); None without a robot."""
    q_dot: Array | None = None
    """Rate of the configuration, shape (N, nq)."""
    effort: Array | None = None
    """B' v: the generalised force on each coordinate (N m, N), shape (N, nq)."""

    def described(self) -> dict[str, Any]:
        """The motion for the page."""
        single = ("error", "platform", "effort")
        return {
            name: None if array is None else packed(array, "f4" if name in single else "f8")
            for name, array in self._asdict().items()
        }


class States(NamedTuple):
    """The part of a :class:`Record` that a motion is made of."""

    t: Array
    q: Array
    z: Array
    torque: Array
    tip_position: Array
    tip_desired: Array
    task_error: Array
    joint_names: list[str]


def motion(record: Record | States, robot: MobileManipulator | None, *, runs: int = 1) -> Motion:
    """A run's motion.

    Args:
        record: The run.
        robot: Its robot; None if it is not known.
        runs: How many runs share the page.
    """
    kept = frames(record.t, max(_FEWEST, MOST_FRAMES // runs))
    t, q, z, torque = (part[kept] for part in (record.t, record.q, record.z, record.torque))
    tip, desired = _points(record.tip_position[kept]), _points(record.tip_desired[kept])
    error = np.linalg.norm(record.task_error[kept], axis=1)
    names = record.joint_names
    columns = [q[:, names.index(n)] if n in names else np.zeros(len(t)) for n in BASE_JOINTS[:2]]
    platform = np.column_stack([*columns, np.zeros(len(t))])
    if robot is None:
        return Motion(t, tip, desired, error, platform)
    if record.tip_position.shape[1] < 3:  # a planar task says nothing of the height
        tip[:, 2] = desired[:, 2] = [robot.tip_pose(row).translation[2] for row in q]
    q_dot = np.array([robot.velocity_map(a) @ b for a, b in zip(q, z, strict=True)])
    effort = np.array([robot.actuation(a) @ b for a, b in zip(q, torque, strict=True)])
    return Motion(t, tip, desired, error, platform, q, q_dot, effort)


def frames(t: Array, most: int = MOST_FRAMES) -> Index:
    """Samples to show: the first, the last, and about 60 a second between, never more than ``most``.

    Args:
        t: Times of the samples (s), rising.
        most: Of them, 2 or more.
    """
    duration = float(t[-1] - t[0])
    count = min(most, int(np.ceil(duration * FRAMES_PER_SECOND)) + 1)
    if len(t) <= count:
        return np.arange(len(t))
    wanted = np.linspace(t[0], t[-1], max(count, 2))
    after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    nearer = wanted - t[after - 1] < t[after] - wanted
    return np.unique(np.where(nearer, after - 1, after))


def _points(task_coordinates: Array) -> Array:
    """Points in space of a task's coordinates: a planar task is on the ground until it is lifted."""
    points = np.zeros((len(task_coordinates), 3))
    points[:, : task_coordinates.shape[1]] = task_coordinates[:, :3]
    return points


def robot_of_run(
    record: Record, folder: Path | None = None
) -> tuple[MobileManipulator | None, str]:
    """The robot of a run, as the record describes it.

    It is built from the description in the record, its files being looked for where the registered
    robot of that name has them, then in ``folder`` and in the working directory, and nowhere else; or it
    is the registered robot. It counts only if its URDF is the run's (by its hash) and its coordinates
    are. A platform that is Python code is the registered robot's, and only if that has the same
    description: a record runs no code.

    Args:
        record: The run.
        folder: The folder of the record's file.

    Returns:
        The robot, or None and why there is none.
    """
    problems: list[str] = []
    for spec, sources in _candidates(record, folder, problems):
        try:
            if (found := sources.sha256()) != record.urdf_sha256:
                problems.append(
                    f"its URDF {sources} is not the run's (SHA-256 {found[:12]}..., the run's "
                    f"{record.urdf_sha256[:12]}...)"
                )
                continue
            robot = build_robot(spec, sources)
        except MobmanError as error:
            problems.append(str(error))
            continue
        if robot.joint_names == record.joint_names and robot.nz == record.z.shape[1]:
            return robot, ""
        problems.append("its coordinates are not the run's")
    # the first is about the registered robot, or else about the record's own description
    return None, problems[0] if problems else "the record does not describe it"


def _candidates(
    record: Record, folder: Path | None, problems: list[str]
) -> Iterator[tuple[RobotSpec, UrdfSources]]:
    registered = None
    try:
        if record.robot in list_robots():
            found = find_spec(record.robot)
            registered = (found, urdf_sources(found))
    except MobmanError as error:
        problems.append(str(error))
    described, described_as_code = record.spec.get("robot"), False
    if isinstance(described, dict):
        try:
            spec = as_spec({**described, "folder": Path(), "file": None})
            if described_as_code := bool(spec.code):
                own = registered_as(described)
                yield own, urdf_sources(own)
                return
            if registered is not None:
                yield spec, registered[1]
            for place in dict.fromkeys(path for path in (folder, Path.cwd()) if path is not None):
                try:
                    yield spec, _beside(spec, place)
                except MobmanError as error:
                    problems.append(str(error))
        except MobmanError as error:
            problems.append(str(error))
    if registered is not None and not described_as_code and not registered[0].code:
        yield registered


def _beside(spec: RobotSpec, place: Path) -> UrdfSources:
    """The URDFs of a description in a folder, with the meshes that lie there.

    Raises:
        SpecError: If one is missing, or the description names a file elsewhere.
    """
    folder = place.resolve()
    parts = [part for part in (spec.urdf, *spec.mount) if part is not None]
    for part in parts:
        path = (folder / part.path).resolve()
        if part.package is None and not path.is_relative_to(folder):
            raise SpecError(
                f"its URDF {part.path} lies outside {folder}; register the robot {spec.name!r} to have "
                "it drawn"
            )
    sources = urdf_sources(spec.model_copy(update={"folder": folder}))
    files = zip(parts, sources.files, strict=True)
    return UrdfSources(
        tuple(file if part.package else replace(file, within=(folder,)) for part, file in files)
    )
