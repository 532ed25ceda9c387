"""Parts of a run (robots, controller, task) as plain values in a :class:`RunSpec`, and back.

A part that a file cannot hold (an object of a class without a name, say) is noted with the reason in
``not_repeatable``, and :mod:`mobman.simulation.rerun` refuses such a run in these words. Nothing is
imported or called because a file names it.
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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import Controller, controllers, make_controller, settings_of
from mobman.errors import MobmanError, RecordError, UnknownNameError
from mobman.model.build import build_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, registered_as
from mobman.robots.urdf.read import UrdfFile, UrdfSources
from mobman.simulation.run_spec import RunSpec
from mobman.simulation.scenario import GivenPlant, Scenario, load_scenario
from mobman.tasks.task import Task, make_task, task_parameters, tasks
from mobman.toml_model import validate

_TRIANGLE = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)  # rows, columns of a symmetric matrix's entries
_NUMBERS = re.compile(r"[<>|=]?[biuf][1248]")
_ROUNDING = 1e-9  # of the largest entry: what other processors and libraries may change
_OWN = "mobman.tasks."
_FORMER = {
    f"{_OWN}trajectories.circle:Circle": f"{_OWN}circle:Circle",
    f"{_OWN}paths.harmonics:Harmonics": f"{_OWN}paths:Harmonics",
    f"{_OWN}paths.point_to_point:PointToPoint": f"{_OWN}paths:PointToPoint",
    f"{_OWN}trajectories.kinematic_singularity:ToTheBoundary": f"{_OWN}singular:SingularPath",
    f"{_OWN}trajectories.algorithmic_singularity:ToTheFold": f"{_OWN}singular:SingularPath",
}
"""Classes of tasks by the names that older records have for them."""


def describe_run(
    *,
    robot: MobileManipulator,
    controller: tuple[Controller | str, Controller],
    task: tuple[Task | str, Task],
    plant: tuple[GivenPlant, MobileManipulator],
    scenario: Scenario,
    q0: Array,
    **numbers: Any,
) -> RunSpec:
    """The description of a run.

    Controller, task and plant are as given to :func:`mobman.simulate`, each with what it became;
    ``numbers`` are ``duration``, ``dt`` and ``seed``.
    """
    (_, law), (_, aim), (given, true) = controller, task, plant
    law_name, gains, no_law = _law_of(*controller)
    task_name, task_object, no_task = _task_of(*task)
    others: dict[str, Any] = {}
    if isinstance(given, (str, os.PathLike)):
        others["plant"] = os.fspath(given)
        given = load_scenario(given)
    elif given is not None:
        others["plant"] = given.name
    if isinstance(given, Scenario):
        others["plant_scenario"] = given.model_dump(mode="json")
    elif given is not None:
        others["plant_inertias"] = [
            [float(link.mass), *link.lever.tolist(), *link.inertia[_TRIANGLE].tolist()]
            for link in list(given.model.inertias)[1:]
        ]
        if _is_another(given, robot):
            others["plant_robot"] = given.spec.model_dump(mode="json", by_alias=True)
    return RunSpec(
        label=str(getattr(law, "name", type(law).__name__)),
        robot=robot.name,
        law=law_name,
        gains=gains,
        task=str(getattr(aim, "name", type(aim).__name__)),
        task_name=task_name,
        task_parameters=task_parameters(aim),
        task_object=task_object,
        scenario=scenario.model_dump(mode="json"),
        q0=q0.tolist(),
        description=robot.spec.model_dump(mode="json", by_alias=True),
        plant_masses=[float(link.mass) for link in list(true.model.inertias)[1:]],
        at_start={"robot": _at_start(robot, q0), "plant": _at_start(true, q0)},
        not_repeatable=[reason for reason in (no_law, no_task) if reason],
        **others,
        **numbers,
    )


@contextlib.contextmanager
def refused(problem: str, remedy: str = "") -> Iterator[None]:
    """Errors within the block as a :class:`RecordError` that says what cannot be done, and, where
    a name or a class is not known here, what else can."""
    try:
        yield
    except (NotPlainError, MobmanError, TypeError) as error:
        more = remedy if isinstance(error, (UnknownNameError, NotPlainError)) else ""
        raise RecordError(f"{problem}: {error}{more}") from error


# Robots ------------------------------------------------------------------------------------------


def urdfs_of_run(robot: MobileManipulator, plant: GivenPlant) -> dict[str, bytes]:
    """The URDF files of the robots: of the nominal one by ``"0/NAME"``, ``"1/NAME"``, ..., in the order
    of the description; of a plant that is another robot by ``"plant/0/NAME"``, ..."""
    files = {"": robot.urdf.files}
    if isinstance(plant, MobileManipulator) and _is_another(plant, robot):
        files["plant/"] = plant.urdf.files
    return {
        f"{prefix}{i}/{file.path.name}": file.content
        for prefix, own in files.items()
        for i, file in enumerate(own)
    }


def _is_another(plant: MobileManipulator, robot: MobileManipulator) -> bool:
    return plant.spec != robot.spec or plant.urdf.sha256() != robot.urdf.sha256()


def _at_start(robot: MobileManipulator, start: Array) -> dict[str, list[float]]:
    dynamics = robot.dynamics(start, np.zeros(robot.nz))
    return {"M": np.diag(dynamics.M).tolist(), "bias": dynamics.bias.tolist()}


def robot_of(
    described: dict[str, Any], urdf: dict[str, bytes], prefix: str = ""
) -> MobileManipulator:
    """A robot from its description and the URDFs in the record whose places have a prefix; RecordError
    if it cannot be built."""
    own = [key.removeprefix(prefix).split("/", 1) for key in urdf if key.startswith(prefix)]
    names = dict(sorted((int(i), name) for i, name in own if i.isdecimal()))
    files = [UrdfFile(Path(name), (), urdf[f"{prefix}{i}/{name}"]) for i, name in names.items()]
    with refused("its robot cannot be built"):
        spec = as_spec({**described, "folder": Path(), "file": None})
        if spec.code:
            spec = registered_as(described)
        if len(files) != len(spec.parts):
            raise RecordError("its robot's URDFs are not all in the file")
        pairs = zip(files, spec.parts, strict=True)
        upright = tuple(dataclasses.replace(file, up=part.up) for file, part in pairs)
        return build_robot(spec, UrdfSources(upright))


def plant_of(
    run: RunSpec, urdf: dict[str, bytes], robot: MobileManipulator
) -> MobileManipulator | Scenario | None:
    """The plant as a run was given it; RecordError if it cannot be built."""
    if run.plant_scenario:
        return scenario_of(run.plant_scenario)
    if not run.plant_inertias:
        return None
    base = robot_of(run.plant_robot, urdf, "plant/") if run.plant_robot else robot
    if base.model.njoints != len(run.plant_inertias) + 1:
        raise RecordError("its plant has other joints than its description")
    model = base.model.copy()
    for i, numbers in enumerate(run.plant_inertias, start=1):
        turning = np.zeros((3, 3))
        turning[_TRIANGLE] = turning[_TRIANGLE[::-1]] = numbers[4:]
        model.inertias[i] = pin.Inertia(numbers[0], np.array(numbers[1:4]), turning)
    return base.with_model(model)


def scenario_of(described: dict[str, Any]) -> Scenario:
    """A scenario of a record, which has what it extends in it: no other file is read for it. RecordError
    if it extends another one, SpecError if it is not a scenario."""
    if described.get("extends"):
        raise RecordError(
            "its scenario names others that it extends, which a record has no need to"
        )
    return validate(Scenario, described, "its scenario")


def require_same(robot: MobileManipulator, run: RunSpec, role: str) -> None:
    """Raise RecordError if a robot is not the one that the run had as its ``"robot"`` or ``"plant"``."""
    now = _at_start(robot, robot.checked_configuration(np.array(run.q0)))
    for name, then in run.at_start[role].items():
        new, old = np.array(now[name]), np.array(then)
        rounding = _ROUNDING * np.abs(old).max(initial=0.0)
        if new.shape != old.shape or not np.all(np.abs(new - old) <= rounding):
            raise RecordError(
                f"its {role} has other inertias or dimensions than what the file describes: it was "
                "changed in Python after it was built, or this mobman builds it in another way"
            )


# Controller: its law by name, and its gains ------------------------------------------------------


def _law_of(given: Controller | str, controller: Controller) -> tuple[str, dict[str, Any], str]:
    """The law's registered name, or none; its gains in force, with the numbers that "auto" and the
    robot's defaults became; and the reason why the controller cannot be made again from these, empty if
    it can."""
    law = type(controller)
    what = f"its controller is an object of the class {law.__name__}, which"
    name = given if isinstance(given, str) else _registered_name(law, controller)
    unknown = "" if name else f"{what} is not registered"
    if not hasattr(law, "Gains"):
        lost = False
        with contextlib.suppress(TypeError, ValueError):  # classes of other languages: no signature
            lost = not isinstance(given, str) and bool(inspect.signature(law).parameters)
        reason = f"{what} takes parameters but declares no Gains" if lost else ""
        return name, {}, unknown or reason
    gains = getattr(controller, "gains", None)
    if not isinstance(gains, law.Gains):
        reason = f"its controller, a {law.__name__}, does not say its gains"
        return name, {}, unknown or reason
    problem = f"the gains of its controller, a {law.__name__}, are more than numbers"
    given_settings = as_settings(gains)
    # as the law reports them after the run, so that later defaults change nothing
    in_force = settings_of(controller)
    for settings in (in_force, given_settings):
        try:
            same = _through_json(settings) == settings == as_settings(law.Gains(**settings))
            if same and settings.keys() == given_settings.keys():
                return name, settings, unknown
        except (MobmanError, TypeError, ValueError) as error:
            problem += f": {error}" if settings is given_settings else ""
    return name, {}, unknown or problem


def controller_of(run: RunSpec, own: Controller | type[Any] | None = None) -> Controller:
    """The controller of a run, by the name of its law, or ``own``, of which a class is made from its
    ``Gains``; both with the run's gains. MobmanError or TypeError if it cannot be made, RecordError if
    the file does not have the gains of the class."""
    if own is None:
        return make_controller(run.law, **run.gains)
    if not isinstance(own, type):
        return own
    kind = getattr(own, "Gains", None)
    if kind is not None and not run.gains and dataclasses.fields(kind):
        what = f"give a function that makes the {own.__name__} in place of the class"
        raise RecordError(f"the file does not have its gains; {what}")
    made: Controller = own() if kind is None else own(kind(**run.gains))
    return made


def _registered_name(law: type[Any], controller: Controller) -> str:
    """The name that a class is registered under; its own where it has several."""
    own = str(getattr(controller, "name", ""))
    with contextlib.suppress(UnknownNameError):
        if own and controllers.get(own) is law:
            return own
    return next((name for name, item in controllers.loaded().items() if item is law), "")


def _through_json(value: Any) -> Any:
    def number(item: Any) -> Any:
        if isinstance(item, np.generic):
            return item.item()
        raise TypeError(f"{type(item).__name__} is nothing that a file can hold")

    return json.loads(json.dumps(value, default=number))


# Task: its fields where it is a dataclass of a known package, or else its name -------------------


def _task_of(given: Task | str, task: Task) -> tuple[str, Any, str]:
    """The registered name by which the task was requested, or one of the package that its class is of,
    or none; what it is made of again, or None; and the reason why it cannot be, empty if it can."""
    if isinstance(given, str):
        name = given
    else:
        module = type(task).__module__
        factories = {} if module.startswith(_OWN) else tasks.loaded()
        name = next((n for n, make in factories.items() if _module_of(make) == module), "")
    try:
        return name, as_plain(task, _package_of(name)), ""
    except NotPlainError as error:
        reason = f"its task is an object that the file does not hold: {error}"
        return name, None, "" if isinstance(given, str) else reason


def _module_of(thing: Any) -> str:
    return str(getattr(thing, "__module__", ""))


def _package_of(name: str) -> str:
    """The module of a registered task, whose classes may be made as well as mobman's."""
    with contextlib.suppress(UnknownNameError):
        return _module_of(tasks.get(name)) if name else ""
    return ""


def task_of(run: RunSpec, robot: MobileManipulator, q0: Array) -> Task:
    """The task of a run; NotPlainError or MobmanError if it cannot be made here."""
    if run.task_object is None:
        return make_task(run.task_name, robot, q0, **run.task_given)
    task: Task = from_plain(run.task_object, _package_of(run.task_name))
    return task


def require_same_task(task: Task, run: RunSpec) -> None:
    """Raise RecordError if a task, a dataclass as the run's, has other values in its fields."""
    was, now = run.task_parameters, task_parameters(task)
    for name in [name for name in was if name in now and name != "type"]:
        try:
            pair = np.asarray(was[name], dtype=float), np.asarray(now[name], dtype=float)
            same = np.allclose(*pair, rtol=_ROUNDING, atol=_ROUNDING, equal_nan=True)
        except (TypeError, ValueError):  # text, or another number of entries
            same = np.array_equal(was[name], now[name])
        if not same:
            raise RecordError(
                f"the task that is given has {name} = {now[name]!r}, that of the run "
                f"{was[name]!r}; give a function of the robot and q0 that makes the latter"
            )


# Dataclasses as plain values that JSON holds, and back: to the last bit, or not at all -----------


class NotPlainError(Exception):
    """A value that a file cannot hold, or cannot be made of again."""


def as_plain(value: Any, package: str) -> Any:
    """A value for JSON: numbers, text, lists, tuples, arrays, dictionaries, and dataclasses of such
    whose classes are those of mobman's tasks or of the module ``package``; NotPlainError says what else
    it has in it."""
    plain = _plain(value, package)
    text = json.dumps(plain)
    if json.dumps(_plain(from_plain(json.loads(text), package), package)) != text:
        raise NotPlainError(f"{type(value).__name__} does not come back from a file as it was")
    return plain


def _plain(value: Any, package: str) -> Any:
    kind = type(value)
    if value is None or kind in (bool, int, float, str):
        return value
    if isinstance(value, np.generic) and _NUMBERS.fullmatch(value.dtype.str):
        return value.item()
    if kind in (list, tuple):
        items = [_plain(item, package) for item in value]
        return items if kind is list else {"tuple": items}
    if kind is dict:
        if not all(type(key) is str for key in value):  # JSON makes numbers text
            raise NotPlainError("a dictionary whose keys are more than text")
        return {"dict": {key: _plain(item, package) for key, item in value.items()}}
    if kind is np.ndarray and _NUMBERS.fullmatch(value.dtype.str):
        return {"array": value.tolist(), "dtype": value.dtype.str}
    if not dataclasses.is_dataclass(kind):
        raise NotPlainError(
            f"{kind.__name__} is no dataclass, and nothing else that a file can hold"
        )
    if not _may_be_made(kind.__module__, package) or "<" in kind.__qualname__:
        raise NotPlainError(f"{kind.__name__} is no class that has a name in mobman")
    names = [field.name for field in dataclasses.fields(value) if field.init]
    content = {name: _plain(getattr(value, name), package) for name in names}
    return {"class": f"{kind.__module__}:{kind.__qualname__}", "fields": content}


def _may_be_made(module: str, package: str) -> bool:
    return module.startswith(_OWN) or module == package != ""


def from_plain(plain: Any, package: str) -> Any:
    """The value that :func:`as_plain` was given; NotPlainError if a class may not be made, is not there,
    or refuses its fields."""
    if isinstance(plain, list):
        return [from_plain(item, package) for item in plain]
    if not isinstance(plain, dict):
        return plain
    if "tuple" in plain:
        return tuple(from_plain(plain["tuple"], package))
    if "dict" in plain:
        return {key: from_plain(item, package) for key, item in plain["dict"].items()}
    if "array" in plain:
        if not _NUMBERS.fullmatch(str(plain["dtype"])):
            raise NotPlainError(f"{plain['dtype']!r} is no type of numbers")
        return np.array(plain["array"], dtype=plain["dtype"])
    name = _FORMER.get(str(plain.get("class")), str(plain.get("class")))
    module, _, path = name.partition(":")
    # the name is from a file: nothing is imported for it that the registries do not know
    if not _may_be_made(module, package):
        raise NotPlainError(f"{name!r} is no class of mobman or of a registered package")
    try:
        kind: Any = sys.modules.get(module) or importlib.import_module(module)
        for part in path.split("."):
            kind = getattr(kind, part)
    except (ImportError, AttributeError) as error:
        raise NotPlainError(f"there is no class {name!r} here: {error}") from error
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        raise NotPlainError(f"{name!r} is not a dataclass")
    if kind.__module__ != module:
        raise NotPlainError(f"{name!r} is a class of {kind.__module__}")
    fields = {field: from_plain(item, package) for field, item in plain["fields"].items()}
    try:
        return kind(**fields)
    except Exception as error:  # another package's class may raise anything
        raise NotPlainError(f"{kind.__name__} refuses its own fields: {error}") from error
