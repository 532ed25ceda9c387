"""The robot that a record was made with, if it can still be built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from mobman.errors import MobmanError, SpecError
from mobman.model.build import build_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, find_spec, list_robots, registered_as
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.read import UrdfSources, urdf_sources
from mobman.simulation.record import Record


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
        folder: Where the record's file is.

    Returns:
        The robot, or None and why there is none.
    """
    problems: list[str] = []
    for spec, sources in _candidates(record, folder, problems):
        try:
            if sources.sha256() != record.urdf_sha256:
                problems.append(
                    f"its URDF {sources} is not the run's (SHA-256 {sources.sha256()[:12]}..., the "
                    f"run's {record.urdf_sha256[:12]}...)"
                )
                continue
            robot = build_robot(spec, sources)
        except MobmanError as error:
            problems.append(str(error))
            continue
        if robot.joint_names != record.joint_names or robot.nz != record.z.shape[1]:
            problems.append("its coordinates are not the run's")
        else:
            return robot, ""
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
    return UrdfSources(
        tuple(
            file if part.package else replace(file, within=(folder,))
            for part, file in zip(parts, sources.files, strict=True)
        )
    )
