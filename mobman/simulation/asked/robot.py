"""The robot of a run and its plant: their descriptions, their URDFs, and what they weigh."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import MobmanError, RecordError
from mobman.model.build import build_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, find_spec, list_robots, registered_as
from mobman.robots.urdf.read import UrdfFile, UrdfSources, urdf_sources
from mobman.simulation.arguments import plant_name
from mobman.simulation.scenario import Scenario, load_scenario

GivenPlant = MobileManipulator | Scenario | str | os.PathLike[str] | None
_ROUNDING = 1e-9  # of the largest entry: what other processors and libraries may change


def robot_asked(
    robot: MobileManipulator, plant: GivenPlant, true: MobileManipulator, start: Array
) -> dict[str, Any]:
    """What a record keeps of the robots.

    Args:
        robot: The nominal one.
        plant: As :func:`mobman.simulate` was given it.
        true: The true one that it became.
        start: q at t = 0, shape (nq,).

    Returns:
        ``robot``, the description; ``plant``, what was given, by name; of a plant that is a scenario
        ``plant_scenario``; of one that is a robot ``plant_robot``, its description if it is another,
        and ``plant_inertias``, of every joint m, the centre of mass and the inertia about it;
        ``plant_masses`` (kg); ``at_start``, M's diagonal and Pz+G of both, to tell later whether they
        are those again.
    """
    asked: dict[str, Any] = {
        "robot": robot.spec.model_dump(mode="json", by_alias=True),
        "plant": plant_name(plant),
        "plant_masses": [float(link.mass) for link in list(true.model.inertias)[1:]],
        "at_start": {"robot": _at_start(robot, start), "plant": _at_start(true, start)},
    }
    if isinstance(plant, Scenario):
        asked["plant_scenario"] = plant.model_dump(mode="json")
    elif isinstance(plant, (str, os.PathLike)):
        asked["plant_scenario"] = load_scenario(plant).model_dump(mode="json")
    elif plant is not None:
        asked["plant_inertias"] = [_inertia(link) for link in list(plant.model.inertias)[1:]]
        if _is_another(plant, robot):
            asked["plant_robot"] = plant.spec.model_dump(mode="json", by_alias=True)
    return asked


def urdf_asked(robot: MobileManipulator, plant: GivenPlant) -> dict[str, bytes]:
    """The URDF files of the robots: of the nominal one by ``"0/NAME"``, ``"1/NAME"``, ..., in the order
    of the description; of a plant that is another robot by ``"plant/0/NAME"``, ..."""
    kept = {f"{i}/{file.path.name}": file.content for i, file in enumerate(robot.urdf.files)}
    if isinstance(plant, MobileManipulator) and _is_another(plant, robot):
        for i, file in enumerate(plant.urdf.files):
            kept[f"plant/{i}/{file.path.name}"] = file.content
    return kept


def robot_again(
    spec: dict[str, Any], urdf: dict[str, bytes], given: MobileManipulator | None = None
) -> MobileManipulator:
    """The nominal robot of a run, from its description and the URDFs in the record.

    Args:
        spec: The run as it was asked for.
        urdf: The URDFs in the record.
        given: The robot, where the caller has it.

    Raises:
        RecordError: If it cannot be built, or is not the one of the run.
    """
    robot = _build(spec["robot"], urdf, "") if given is None else given
    _check(robot, spec, "robot")
    return robot


def plant_again(
    spec: dict[str, Any], urdf: dict[str, bytes], robot: MobileManipulator
) -> MobileManipulator | Scenario | None:
    """What a run was given as its plant.

    Raises:
        RecordError: If it cannot be built.
    """
    if "plant_scenario" in spec:
        return Scenario.model_validate(spec["plant_scenario"])
    if "plant_inertias" not in spec:
        return None
    base = robot
    if "plant_robot" in spec:
        base = _build(spec["plant_robot"], urdf, "plant/")
    if base.model.njoints != len(spec["plant_inertias"]) + 1:
        raise RecordError("its plant has other joints than its description")
    model = base.model.copy()
    for i, numbers in enumerate(spec["plant_inertias"], start=1):
        xx, xy, yy, xz, yz, zz = numbers[4:]
        turning = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.inertias[i] = pin.Inertia(numbers[0], np.array(numbers[1:4]), turning)
    return base.with_model(model)


def check_plant(true: MobileManipulator, spec: dict[str, Any]) -> None:
    """
    Raises:
        RecordError: If a plant is not the one of the run.
    """
    _check(true, spec, "plant")


def changed_since(spec: dict[str, Any], urdf_sha256: str) -> str:
    """In what the robot that is registered now differs from the run's; empty if in nothing, or if no
    robot of the name is registered."""
    name = spec["robot"]["name"]
    try:
        if name not in list_robots():  # the name is from a file: it is no path
            return ""
        now = find_spec(name)
        sources = urdf_sources(now)
        if sources.sha256() != urdf_sha256:
            return f"the URDF {sources} is not the run's any more; the one in the record was used"
        if now.model_dump(mode="json", by_alias=True) != spec["robot"]:
            return (
                f"the description of the robot {name!r} is not the run's any more; the one in the "
                "record was used"
            )
    except MobmanError:
        pass  # it is not there, and not needed
    return ""


def _is_another(plant: MobileManipulator, robot: MobileManipulator) -> bool:
    return plant.spec != robot.spec or plant.urdf.sha256() != robot.urdf.sha256()


def _inertia(link: pin.Inertia) -> list[float]:
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return [float(link.mass), *link.lever.tolist(), *link.inertia[rows, columns].tolist()]


def _at_start(robot: MobileManipulator, start: Array) -> dict[str, list[float]]:
    dynamics = robot.dynamics(start, np.zeros(robot.nz))
    return {"M": np.diag(dynamics.M).tolist(), "bias": dynamics.bias.tolist()}


def _build(described: dict[str, Any], urdf: dict[str, bytes], prefix: str) -> MobileManipulator:
    own = [key.removeprefix(prefix).split("/", 1) for key in urdf if key.startswith(prefix)]
    names = dict(sorted((int(i), name) for i, name in own if i.isdigit()))
    files = [UrdfFile(Path(name), (), urdf[f"{prefix}{i}/{name}"]) for i, name in names.items()]
    try:
        spec = as_spec({**described, "folder": Path(), "file": None})
        if spec.code:
            spec = registered_as(described)
        if len(files) != (spec.urdf is not None) + len(spec.mount):
            raise RecordError("its robot's URDFs are not all in the file")
        return build_robot(spec, UrdfSources(tuple(files)))
    except MobmanError as error:
        raise RecordError(f"its robot cannot be built: {error}") from error


def _check(robot: MobileManipulator, spec: dict[str, Any], role: str) -> None:
    now = _at_start(robot, robot.checked_configuration(spec["q0"]))
    for name, then in spec["at_start"][role].items():
        if not _alike(np.array(now[name]), np.array(then, dtype=float)):
            raise RecordError(
                f"its {role} has other inertias or dimensions than what the file describes: it was "
                "changed in Python after it was built, or this mobman builds it in another way"
            )


def _alike(now: Array, then: Array) -> bool:
    if now.shape != then.shape:
        return False
    return bool(np.all(np.abs(now - then) <= _ROUNDING * np.abs(then).max(initial=0.0)))
