"""The request for a run as plain values, which a record stores, and the way back to the run's parts.

A part that a file cannot hold (an object of a class without a name, say) is noted with the reason in
``not_repeatable``, and :mod:`mobman.simulation.rerun` refuses such a run in these words.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import inspect
import json
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import Controller, controllers, make_controller
from mobman.errors import MobmanError, RecordError, UnknownNameError
from mobman.model.build import build_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, find_spec, list_robots, registered_as
from mobman.robots.urdf.read import UrdfFile, UrdfSources, urdf_sources
from mobman.simulation.scenario import Scenario, load_scenario
from mobman.tasks.task import Task, make_task, task_parameters, tasks
from mobman.toml_model import validate

GivenPlant = MobileManipulator | Scenario | str | os.PathLike[str] | None

_NUMBERS = re.compile(r"[<>|=]?[biuf][1248]")
_ROUNDING = 1e-9  # of the largest entry: what other processors and libraries may change
_OWN_TASKS = "mobman.tasks."
_FORMER = {
    f"{_OWN_TASKS}trajectories.circle:Circle": f"{_OWN_TASKS}circle:Circle",
    f"{_OWN_TASKS}paths.harmonics:Harmonics": f"{_OWN_TASKS}paths:Harmonics",
    f"{_OWN_TASKS}paths.point_to_point:PointToPoint": f"{_OWN_TASKS}paths:PointToPoint",
    f"{_OWN_TASKS}trajectories.kinematic_singularity:ToTheBoundary": (
        f"{_OWN_TASKS}singular:SingularPath"
    ),
    f"{_OWN_TASKS}trajectories.algorithmic_singularity:ToTheFold": (
        f"{_OWN_TASKS}singular:SingularPath"
    ),
}
"""Classes of tasks by the names that older records have for them."""


def run_spec(
    *,
    robot: MobileManipulator,
    controller: tuple[Controller | str, Controller],
    task: tuple[Task | str, Task],
    plant: tuple[GivenPlant, MobileManipulator],
    scenario: Scenario,
    duration: float,
    dt: float,
    q0: Array,
    seed: int,
) -> dict[str, Any]:
    """The request for a run as a record stores it.

    Args:
        robot: The nominal one.
        controller: As given to :func:`mobman.simulate`, and the object that ran.
        task: The same.
        plant: As given, and the true robot that it became.
        scenario: The scenario.
        duration: s.
        dt: Sampling period (s).
        q0: Start, shape (nq,).
        seed: Of all randomness.

    Returns:
        Plain values; ``not_repeatable`` lists the reasons why the run cannot be repeated from them.
    """
    law, no_law = _controller_spec(*controller)
    aim, no_aim = _task_spec(*task)
    return {
        **_robot_spec(robot, *plant, q0),
        **law,
        **aim,
        "scenario": scenario.model_dump(mode="json"),
        "duration": duration,
        "dt": dt,
        "q0": q0.tolist(),
        "seed": seed,
        "not_repeatable": [reason for reason in (no_law, no_aim) if reason],
    }


# Robot and plant ---------------------------------------------------------------------------------


def _robot_spec(
    robot: MobileManipulator, plant: GivenPlant, true: MobileManipulator, start: Array
) -> dict[str, Any]:
    """The robots.

    Returns:
        ``robot``, the description; ``plant``, what was given, by name; of a plant that is a scenario
        ``plant_scenario``; of one that is a robot ``plant_robot``, its description if it is another,
        and ``plant_inertias``, of every joint m, the centre of mass and the inertia about it;
        ``plant_masses`` (kg); ``at_start``, M's diagonal and Pz+G of both, to tell later whether they
        are those again.
    """
    name = os.fspath(plant) if isinstance(plant, (str, os.PathLike)) else plant and plant.name
    spec: dict[str, Any] = {
        "robot": robot.spec.model_dump(mode="json", by_alias=True),
        "plant": name,
        "plant_masses": [float(link.mass) for link in list(true.model.inertias)[1:]],
        "at_start": {"robot": _at_start(robot, start), "plant": _at_start(true, start)},
    }
    if isinstance(plant, MobileManipulator):
        spec["plant_inertias"] = [_inertia(link) for link in list(plant.model.inertias)[1:]]
        if _is_another(plant, robot):
            spec["plant_robot"] = plant.spec.model_dump(mode="json", by_alias=True)
    elif plant is not None:
        scenario = plant if isinstance(plant, Scenario) else load_scenario(plant)
        spec["plant_scenario"] = scenario.model_dump(mode="json")
    return spec


def urdfs_of_run(robot: MobileManipulator, plant: GivenPlant) -> dict[str, bytes]:
    """The URDF files of the robots: of the nominal one by ``"0/NAME"``, ``"1/NAME"``, ..., in the order
    of the description; of a plant that is another robot by ``"plant/0/NAME"``, ..."""
    kept = {f"{i}/{file.path.name}": file.content for i, file in enumerate(robot.urdf.files)}
    if isinstance(plant, MobileManipulator) and _is_another(plant, robot):
        for i, file in enumerate(plant.urdf.files):
            kept[f"plant/{i}/{file.path.name}"] = file.content
    return kept


def robot_of(
    spec: dict[str, Any], urdf: dict[str, bytes], given: MobileManipulator | None = None
) -> MobileManipulator:
    """The nominal robot of a run, from its description and the URDFs in the record.

    Args:
        spec: The request for the run.
        urdf: The URDFs in the record.
        given: The robot, where the caller has it.

    Raises:
        RecordError: If it cannot be built, or is not the one of the run.
    """
    robot = _build(spec["robot"], urdf, "") if given is None else given
    require_same(robot, spec, "robot")
    return robot


def recorded_scenario(described: Any) -> Scenario:
    """The scenario of a record, which has what it extends in it: no other file is read for it.

    Raises:
        RecordError: If it extends another one.
        SpecError: If it is no scenario.
    """
    if isinstance(described, dict) and described.get("extends"):
        raise RecordError(
            "its scenario names others that it extends, which a record has no need to"
        )
    return validate(Scenario, described, "its scenario")


def plant_of(
    spec: dict[str, Any], urdf: dict[str, bytes], robot: MobileManipulator
) -> MobileManipulator | Scenario | None:
    """The plant as a run was given it.

    Raises:
        RecordError: If it cannot be built.
    """
    if "plant_scenario" in spec:
        return recorded_scenario(spec["plant_scenario"])
    if "plant_inertias" not in spec:
        return None
    base = _build(spec["plant_robot"], urdf, "plant/") if "plant_robot" in spec else robot
    if base.model.njoints != len(spec["plant_inertias"]) + 1:
        raise RecordError("its plant has other joints than its description")
    model = base.model.copy()
    for i, numbers in enumerate(spec["plant_inertias"], start=1):
        xx, xy, yy, xz, yz, zz = numbers[4:]
        turning = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.inertias[i] = pin.Inertia(numbers[0], np.array(numbers[1:4]), turning)
    return base.with_model(model)


def require_same(robot: MobileManipulator, spec: dict[str, Any], role: str) -> None:
    """
    Args:
        robot: A robot.
        spec: The request for a run.
        role: ``"robot"`` or ``"plant"``.

    Raises:
        RecordError: If it is not the one that the run had.
    """
    now = _at_start(robot, robot.checked_configuration(spec["q0"]))
    for name, then in spec["at_start"][role].items():
        new, old = np.array(now[name]), np.array(then, dtype=float)
        if new.shape != old.shape or not np.all(
            np.abs(new - old) <= _ROUNDING * np.abs(old).max(initial=0.0)
        ):
            raise RecordError(
                f"its {role} has other inertias or dimensions than what the file describes: it was "
                "changed in Python after it was built, or this mobman builds it in another way"
            )


def changed_since(spec: dict[str, Any], urdf_sha256: str) -> str:
    """The difference of the robot that is registered now from the run's; empty if there is none, or if
    no robot of the name is registered."""
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


# Controller: its law by name, and its gains as they were given -----------------------------------


def _controller_spec(given: Controller | str, controller: Controller) -> tuple[dict[str, Any], str]:
    """The controller.

    Returns:
        ``law``, the registered name or None, and ``gains``, before "auto" became numbers; and the
        reason why the controller cannot be made again from these, empty if it can.
    """
    law = type(controller)
    name = given if isinstance(given, str) else _registered_name(law, controller)
    gains: dict[str, Any] = {}
    problem = ""
    if name is None:
        problem = (
            f"its controller is an object of the class {law.__name__}, which is not registered"
        )
    elif hasattr(law, "Gains"):
        gains, problem = _gains(law, controller)
    elif not isinstance(given, str) and _parameters(law):
        problem = (
            f"its controller is an object of the class {law.__name__}, which takes parameters but "
            "declares no Gains"
        )
    return {"law": name, "gains": gains}, problem


def controller_of(spec: dict[str, Any]) -> Controller:
    """The controller of a run.

    Raises:
        RecordError: If there is no such law here, or it has other gains.
    """
    try:
        return make_controller(str(spec["law"]), **spec["gains"])
    except MobmanError as error:
        raise RecordError(f"its controller cannot be made: {error}") from error


def _registered_name(law: type[Any], controller: Controller) -> str | None:
    """The name that a class is registered under; its own where it has several."""
    own = str(getattr(controller, "name", ""))
    with contextlib.suppress(UnknownNameError):
        if own and controllers.get(own) is law:
            return own
    return next((name for name, item in controllers.loaded().items() if item is law), None)


def _gains(law: type[Any], controller: Controller) -> tuple[dict[str, Any], str]:
    given = getattr(controller, "gains", None)
    if not isinstance(given, law.Gains):
        return {}, f"its controller, a {law.__name__}, does not say its gains"
    problem = f"the gains of its controller, a {law.__name__}, are more than numbers"
    try:
        settings = as_settings(given)
        gains: dict[str, Any] = as_plain(settings, lambda _: False)["dict"]
        again = as_settings(law.Gains(**settings)) == settings
    except (NotPlainError, MobmanError, TypeError, ValueError) as error:
        return {}, f"{problem}: {error}"
    return (settings, "") if again and gains == settings else ({}, problem)


def _parameters(law: type[Any]) -> list[str]:
    try:
        return list(inspect.signature(law).parameters)
    except (TypeError, ValueError):  # classes of other languages have no signature
        return []


# Task: its fields where it is a dataclass of a known package, or else its name -------------------


def _task_spec(given: Task | str, task: Task) -> tuple[dict[str, Any], str]:
    """The task.

    Returns:
        ``task_name``, the registered name by which it was requested, or one of the package that its
        class is of, or None; ``task_parameters``, for people; ``task_object``, of which it is made
        again, or None; and the reason why it cannot be made again from these, empty if it can.
    """
    name = given if isinstance(given, str) else _registered_in(type(task).__module__)
    found: Any = None
    problem = ""
    try:
        found = as_plain(task, _allowed_by(name))
        if not isinstance(found, dict) or "class" not in found:
            raise NotPlainError(f"{type(task).__name__} is no dataclass")
    except NotPlainError as error:
        found = None
        if not isinstance(given, str):
            problem = f"its task is an object that the file does not hold: {error}"
    parameters = task_parameters(task)
    return {"task_name": name, "task_parameters": parameters, "task_object": found}, problem


def task_of(spec: dict[str, Any], robot: MobileManipulator, q0: Array) -> Task:
    """The task of a run.

    Raises:
        RecordError: If there is no such task here.
    """
    name = spec["task_name"]
    try:
        if spec["task_object"] is not None:
            task: Task = from_plain(spec["task_object"], _allowed_by(name))
            return task
        return make_task(str(name), robot, q0, **spec.get("task_given", {}))
    except (NotPlainError, MobmanError, TypeError) as error:
        raise RecordError(f"its task cannot be made: {error}") from error


def _registered_in(module: str) -> str | None:
    """A task of a module, by which the package of a class is found. Mobman's own need none."""
    if module.startswith(_OWN_TASKS):
        return None
    for name, factory in tasks.loaded().items():
        if getattr(factory, "__module__", None) == module:
            return name
    return None


def _allowed_by(name: str | None) -> Callable[[str], bool]:
    """A predicate of modules whose classes may be made: mobman's, and that of the registered task."""
    modules = set()
    if name is not None:
        with contextlib.suppress(UnknownNameError):
            modules.add(getattr(tasks.get(name), "__module__", None))
    return lambda module: module.startswith(_OWN_TASKS) or module in modules


# Dataclasses as plain values that JSON holds, and back: to the last bit, or not at all -----------


class NotPlainError(Exception):
    """A value that a file cannot hold, or cannot be made of again."""


def as_plain(value: Any, allowed: Callable[[str], bool]) -> Any:
    """A value for JSON.

    Args:
        value: Numbers, text, lists, tuples, arrays, dictionaries and dataclasses of such.
        allowed: Whether classes of a module may be made again.

    Raises:
        NotPlainError: If it has something else in it; says what.
    """
    plain = _plain(value, allowed)
    # JSON itself may change it: keys that are numbers become text
    if _plain(from_plain(json.loads(json.dumps(plain)), allowed), allowed) != plain:
        raise NotPlainError(f"{type(value).__name__} does not come back from a file as it was")
    return plain


def _plain(value: Any, allowed: Callable[[str], bool]) -> Any:
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (np.bool_, np.integer, np.floating)):
        return value.item()
    if type(value) is list:
        return [_plain(item, allowed) for item in value]
    if type(value) is tuple:
        return {"tuple": [_plain(item, allowed) for item in value]}
    if type(value) is dict:
        return {"dict": {key: _plain(item, allowed) for key, item in value.items()}}
    if type(value) is np.ndarray and value.dtype.kind in "bif":
        return {"array": value.tolist(), "dtype": value.dtype.str}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        if not allowed(kind.__module__) or "<" in kind.__qualname__:
            raise NotPlainError(f"{kind.__name__} is no class that has a name in mobman")
        names = [field.name for field in dataclasses.fields(value) if field.init]
        content = {name: _plain(getattr(value, name), allowed) for name in names}
        return {"class": f"{kind.__module__}:{kind.__qualname__}", "fields": content}
    raise NotPlainError(f"{type(value).__name__} is nothing that a file can hold")


def from_plain(plain: Any, allowed: Callable[[str], bool]) -> Any:
    """The value that :func:`as_plain` was given.

    Raises:
        NotPlainError: If a class may not be made, is not there, or refuses its fields.
    """
    if isinstance(plain, list):
        return [from_plain(item, allowed) for item in plain]
    if not isinstance(plain, dict):
        return plain
    if "tuple" in plain:
        return tuple(from_plain(item, allowed) for item in plain["tuple"])
    if "dict" in plain:
        return {key: from_plain(item, allowed) for key, item in plain["dict"].items()}
    if "array" in plain:
        if not _NUMBERS.fullmatch(str(plain["dtype"])):
            raise NotPlainError(f"{plain['dtype']!r} is no type of numbers")
        return np.array(plain["array"], dtype=plain["dtype"])
    kind = _class(str(plain.get("class")), allowed)
    fields = {name: from_plain(item, allowed) for name, item in plain["fields"].items()}
    try:
        return kind(**fields)
    except Exception as error:  # another package's class may raise anything
        raise NotPlainError(f"{kind.__name__} refuses its own fields: {error}") from error


def _class(name: str, allowed: Callable[[str], bool]) -> type[Any]:
    name = _FORMER.get(name, name)
    module, _, path = name.partition(":")
    # the name is from a file: nothing is imported for it that the registries do not know
    if not allowed(module):
        raise NotPlainError(f"{name!r} is no class of mobman or of a registered package")
    try:
        found: Any = sys.modules.get(module) or importlib.import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError) as error:
        raise NotPlainError(f"there is no class {name!r} here: {error}") from error
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise NotPlainError(f"{name!r} is no dataclass")
    if found.__module__ != module:
        raise NotPlainError(f"{name!r} is a class of {found.__module__}")
    return found
