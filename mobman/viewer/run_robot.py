"""The robot that a record was made with, if it can still be built."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mobman.errors import MobmanError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, find_spec, list_robots
from mobman.robots.spec import RobotSpec
from mobman.simulation.record import Record


def robot_of_run(
    record: Record, folder: Path | None = None
) -> tuple[MobileManipulator | None, str]:
    """The robot of a run, as the record describes it.

    It is built from the description in the record, its files being looked for where the registered
    robot of that name has them, then in ``folder`` and in the working directory; or it is the registered
    robot. It counts only if its URDF is the run's (by its hash) and its coordinates are.

    Args:
        record: The run.
        folder: Where the record's file is.

    Returns:
        The robot, or None and why there is none.
    """
    problems: list[str] = []
    for spec in _candidates(record, folder, problems):
        try:
            robot = load_robot(spec)
        except MobmanError as error:
            problems.append(str(error))
            continue
        if robot.urdf.sha256() != record.urdf_sha256:
            problems.append(
                f"its URDF {robot.urdf} is not the run's (SHA-256 {robot.urdf.sha256()[:12]}..., the "
                f"run's {record.urdf_sha256[:12]}...)"
            )
        elif robot.joint_names != record.joint_names or robot.nz != record.z.shape[1]:
            problems.append("its coordinates are not the run's")
        else:
            return robot, ""
    # the first is about the registered robot, or else about the record's own description
    return None, problems[0] if problems else "the record does not describe it"


def _candidates(record: Record, folder: Path | None, problems: list[str]) -> Iterator[RobotSpec]:
    registered: RobotSpec | None = None
    if record.robot in list_robots():
        try:
            registered = find_spec(record.robot)
        except MobmanError as error:
            problems.append(str(error))
    described = record.spec.get("robot")
    folders = [None if registered is None else registered.folder, folder, Path.cwd()]
    if isinstance(described, dict):
        for place in dict.fromkeys(path for path in folders if path is not None):
            try:
                yield as_spec({**described, "folder": place})
            except MobmanError as error:
                problems.append(str(error))
    if registered is not None:
        yield registered
