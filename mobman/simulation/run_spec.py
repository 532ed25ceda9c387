"""One run as plain values: what a suite expands to, a worker is sent, a record keeps, and its way back.

A part that a file cannot hold (an object of a class without a name, say) is noted with the reason in
``not_repeatable``, and :mod:`mobman.simulation.rerun` refuses such a run in these words.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib
import inspect
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from functools import cached_property
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
import pinocchio as pin
from pydantic import ConfigDict, Field, InstanceOf, ValidationError, field_validator
from pydantic.dataclasses import dataclass

from mobman.arrays import Array
from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import Controller, controllers, make_controller
from mobman.errors import MobmanError, RecordError, UnknownNameError
from mobman.model.build import build_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import as_spec, registered_as
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.read import UrdfFile, UrdfSources, urdf_sources
from mobman.simulation.scenario import Scenario, load_scenario
from mobman.tasks.task import Task, make_task, task_parameters, tasks
from mobman.toml_model import validate
from mobman.version import __version__

GivenPlant = MobileManipulator | Scenario | str | os.PathLike[str] | None
Table = InstanceOf[dict[str, Any]]
Number = Annotated[float, Field(ge=-(2.0**63), le=2.0**63, allow_inf_nan=False)]

_NO_PART_OF_THE_RESULT = {
    # names within the suite; gains, which `settings` hold; and what follows from the rest
    *("label", "gains", "task", "family", "compression"),
    *("description", "task_object", "plant", "plant_masses", "at_start", "not_repeatable"),
}
_RECORDED = (
    *("task", "gains", "task_parameters", "task_object", "scenario", "duration", "dt", "q0"),
    *("seed", "plant", "plant_masses", "at_start", "not_repeatable"),
)
_RECORDED_IF_GIVEN = ("task_given", "plant_scenario", "plant_robot", "plant_inertias")
_LACKING: dict[str, Any] = {"task": "", "task_parameters": {}, "plant": "", "plant_masses": []}
"""Parts of a record's description that a repetition does without."""
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


class Cell(NamedTuple):
    """What runs are compared in: everything but the controller and the seed."""

    robot: str
    task: str
    scenario: str
    dt: float
    duration: float


@dataclass(frozen=True, kw_only=True, config=ConfigDict(strict=True, extra="forbid"))
class RunSpec:
    """One run: everything that its result depends on, and what it is called."""

    label: str
    """The controller's label in the suite, or its name."""
    robot: str
    """Name or file, as the suite has it."""
    robot_sha256: str = ""
    """Of the robot's description and the files that this names, see :func:`fingerprint`."""
    law: str
    """Registered name of the law; empty if it has none."""
    gains: Table
    """As given, before "auto" became numbers."""
    settings: Table = Field(default_factory=dict)
    """All gains, the law's defaults among them."""
    task: str
    """The task's label in the suite, or its name."""
    task_name: str
    """The registered task, or one of the package that the task's class is of; empty if there is none."""
    task_given: Table = Field(default_factory=dict)
    """Parameters that the registered task is given."""
    task_parameters: Table
    """All that is known of the task, for this robot."""
    scenario: Table
    family: str = ""
    """The scenario's label in the suite, which several have that are made from one grid."""
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    """Of all randomness."""
    duration: Number
    """s."""
    dt: Number
    """Sampling period (s)."""
    record_period: Number = 0.0
    """Time from one sample in the file to the next (s)."""
    compression: int = 4
    """Of the file, 0 to 9."""
    code_sha256: str = ""
    """Of the source of what is not mobman's own, see :func:`foreign_code_sha256`; empty if all is."""
    version: str = __version__
    """mobman's: another version may give other numbers."""
    q0: list[float] = Field(default_factory=list)
    """Start; the robot's ``q_rest`` where there is none."""
    description: Table = Field(default_factory=dict)
    """The robot's, as a TOML file has it; this and what follows is known of a run that was done."""
    task_object: Any = None
    """What the task is made of again, where it is a dataclass."""
    plant: str = ""
    """Name of the true robot or scenario, if one was given."""
    plant_scenario: Table = Field(default_factory=dict)
    plant_robot: Table = Field(default_factory=dict)
    """Description of a true robot that is another one."""
    plant_inertias: list[list[float]] = Field(default_factory=list)
    """Of a true robot, for each joint: m, the centre of mass, and the inertia about it."""
    plant_masses: list[float] = Field(default_factory=list)
    """True masses (kg)."""
    at_start: dict[str, dict[str, list[float]]] = Field(default_factory=dict)
    """M's diagonal and Pz+G at q0, of robot and plant, to tell later whether they are those again."""
    not_repeatable: list[str] = Field(default_factory=list)
    """Reasons why the run cannot be repeated from its file."""

    @field_validator("scenario")
    @classmethod
    def _has_a_name(cls, scenario: dict[str, Any]) -> dict[str, Any]:
        if type(scenario.get("name")) is not str:
            raise ValueError("it has no name")
        return scenario

    @cached_property
    def run_id(self) -> str:
        """Hash of all that the result depends on."""
        content = {
            key: value for key, value in self.as_dict().items() if key not in _NO_PART_OF_THE_RESULT
        }
        if self.robot.endswith(".toml") or os.sep in self.robot:
            del content["robot"]  # wherever its file is: `robot_sha256` says what it is
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def cell(self) -> Cell:
        """What it is compared in."""
        return Cell(self.robot, self.task, self.scenario["name"], self.dt, self.duration)

    @property
    def record_every(self) -> int:
        """Ticks from one sample in the file to the next."""
        return max(1, round(self.record_period / self.dt))

    def __str__(self) -> str:
        cell = self.cell
        return (
            f"{cell.robot} · {cell.task} · {cell.scenario} · {self.label} · {cell.dt:g} s · "
            f"seed {self.seed}"
        )

    def as_dict(self) -> dict[str, Any]:
        """The fields; those of a run that was done if they have a value."""
        found = asdict(self)
        first = list(found).index("q0")
        return {key: value for i, (key, value) in enumerate(found.items()) if i < first or value}

    def as_recorded(self) -> dict[str, Any]:
        """The fields as a record's file has them."""
        given = {name: getattr(self, name) for name in _RECORDED_IF_GIVEN}
        return {
            **{name: getattr(self, name) for name in _RECORDED},
            **{name: value for name, value in given.items() if value},
            **{name: getattr(self, name) or None for name in ("law", "task_name", "plant")},
            "robot": self.description,
            "controller": self.label,
        }

    @classmethod
    def of_record(cls, content: Mapping[str, Any]) -> Self:
        """The run that a record describes.

        Raises:
            RecordError: If a field is missing, or of another type.
        """
        try:
            content = {**_LACKING, **content}
            optional = [name for name in _RECORDED_IF_GIVEN if name in content]
            return cls.of_fields(
                {
                    **{name: content[name] for name in (*_RECORDED, *optional)},
                    **{name: content[name] or "" for name in ("law", "task_name", "plant")},
                    "robot": content["robot"]["name"],
                    "description": content["robot"],
                    "label": str(content.get("controller")),
                }
            )
        except KeyError as error:
            raise RecordError(f"what it says of the run is not whole: no {error}") from error
        except (TypeError, ValueError) as error:
            raise RecordError(f"what it says of the run is not whole: {error}") from error

    @classmethod
    def of_fields(cls, content: Mapping[str, Any]) -> Self:
        """The run of fields that a file has.

        Raises:
            ValueError: If one is missing, or of another type; in one line.
        """
        try:
            return cls(**content)
        except ValidationError as error:
            faults = [
                f"field {'.'.join(map(str, e['loc']))!r}: {e['msg']}" for e in error.errors()[:3]
            ]
            raise ValueError("; ".join(faults)) from None


# Code and files as part of what a run depends on --------------------------------------------------


def fingerprint(spec: RobotSpec) -> str:
    """Hash of a robot's description and of what it names: URDFs and Python code.

    Meshes are left out, since no run depends on them, and so is the folder that all of it is in.

    Raises:
        SpecError: If a URDF is not there.
    """
    text = json.dumps(spec.model_dump(mode="json", by_alias=True), sort_keys=True)
    digest = hashlib.sha256((text + urdf_sources(spec).sha256()).encode())
    module = spec.code.rpartition(":")[0]
    path = spec.folder / module if module.endswith(".py") else _file_of(module)
    if path.is_file():  # where it is not, loading the robot says so
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _file_of(module: str) -> Path:
    """The file of a module; neither it nor a package that it is in is imported."""
    folders, found = None, None
    for part in module.split(".") if module else ():
        found = PathFinder.find_spec(part, folders)
        folders = found.submodule_search_locations if found is not None else []
    return Path(found.origin) if found is not None and found.origin is not None else Path()


def foreign_code_sha256(things: Iterable[Any]) -> str:
    """Hash of the files that hold the sources: who edits a law wants its runs again.

    Args:
        things: Classes and functions; those of mobman, whose version says what they are, do not
            count, nor do those without a file, made in a session or compiled.

    Returns:
        16 hexadecimal digits; empty if none counts.
    """
    digest, foreign = hashlib.sha256(), False
    for thing in things:
        try:
            path = Path(inspect.getfile(thing)).resolve()
        except (TypeError, OSError):
            continue
        if not path.is_relative_to(Path(__file__).parents[1]) and path.is_file():
            digest.update(path.read_bytes())
            foreign = True
    return digest.hexdigest()[:16] if foreign else ""


# From the parts of a run to its description -------------------------------------------------------


def describe_run(
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
) -> RunSpec:
    """The description of a run.

    Args:
        robot: The nominal one.
        controller: As given to :func:`mobman.simulate`, and the object that runs.
        task: The same.
        plant: As given, and the true robot that it became.
        scenario: The scenario.
        duration: s.
        dt: Sampling period (s).
        q0: Start, shape (nq,).
        seed: Of all randomness.

    Returns:
        With ``not_repeatable`` listing the reasons why the run cannot be repeated from it.
    """
    (law_given, law), (task_given, aim), (given, true) = controller, task, plant
    law_name, gains, no_law = _law_of(law_given, law)
    task_name, task_object, no_task = _task_of(task_given, aim)
    others: dict[str, Any] = {}
    if isinstance(given, (str, os.PathLike)):
        others["plant"] = os.fspath(given)
        given = load_scenario(given)
    elif given is not None:
        others["plant"] = given.name
    if isinstance(given, MobileManipulator):
        others["plant_inertias"] = [_inertia(link) for link in list(given.model.inertias)[1:]]
        if _is_another(given, robot):
            others["plant_robot"] = given.spec.model_dump(mode="json", by_alias=True)
    elif given is not None:
        others["plant_scenario"] = given.model_dump(mode="json")
    return RunSpec(
        label=name_of(law),
        robot=robot.name,
        law=law_name,
        gains=gains,
        task=name_of(aim),
        task_name=task_name,
        task_parameters=task_parameters(aim),
        task_object=task_object,
        scenario=scenario.model_dump(mode="json"),
        seed=seed,
        duration=duration,
        dt=dt,
        q0=q0.tolist(),
        description=robot.spec.model_dump(mode="json", by_alias=True),
        plant_masses=[float(link.mass) for link in list(true.model.inertias)[1:]],
        at_start={"robot": _at_start(robot, q0), "plant": _at_start(true, q0)},
        not_repeatable=[reason for reason in (no_law, no_task) if reason],
        **others,
    )


def name_of(thing: object) -> str:
    """The name of a controller or a task; that of its class where it has none."""
    return str(getattr(thing, "name", type(thing).__name__))


def urdfs_of_run(robot: MobileManipulator, plant: GivenPlant) -> dict[str, bytes]:
    """The URDF files of the robots: of the nominal one by ``"0/NAME"``, ``"1/NAME"``, ..., in the order
    of the description; of a plant that is another robot by ``"plant/0/NAME"``, ..."""
    kept = {f"{i}/{file.path.name}": file.content for i, file in enumerate(robot.urdf.files)}
    if isinstance(plant, MobileManipulator) and _is_another(plant, robot):
        for i, file in enumerate(plant.urdf.files):
            kept[f"plant/{i}/{file.path.name}"] = file.content
    return kept


def _is_another(plant: MobileManipulator, robot: MobileManipulator) -> bool:
    return plant.spec != robot.spec or plant.urdf.sha256() != robot.urdf.sha256()


def _inertia(link: pin.Inertia) -> list[float]:
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return [float(link.mass), *link.lever.tolist(), *link.inertia[rows, columns].tolist()]


def _at_start(robot: MobileManipulator, start: Array) -> dict[str, list[float]]:
    dynamics = robot.dynamics(start, np.zeros(robot.nz))
    return {"M": np.diag(dynamics.M).tolist(), "bias": dynamics.bias.tolist()}


def _law_of(given: Controller | str, controller: Controller) -> tuple[str, dict[str, Any], str]:
    """The law's registered name, or none; its gains, before "auto" became numbers; and the reason why
    the controller cannot be made again from these, empty if it can."""
    law = type(controller)
    name = given if isinstance(given, str) else _registered_name(law, controller)
    if not name:
        reason = f"an object of the class {law.__name__}, which is not registered"
        return "", {}, f"its controller is {reason}"
    if hasattr(law, "Gains"):
        return name, *_gains_of(law, controller)
    if not isinstance(given, str) and _parameters(law):
        reason = (
            f"an object of the class {law.__name__}, which takes parameters but declares no Gains"
        )
        return name, {}, f"its controller is {reason}"
    return name, {}, ""


def _registered_name(law: type[Any], controller: Controller) -> str:
    """The name that a class is registered under; its own where it has several."""
    names = [name for name, item in controllers.loaded().items() if item is law]
    own = str(getattr(controller, "name", ""))
    with contextlib.suppress(UnknownNameError):
        if own and controllers.get(own) is law:
            return own
    return names[0] if names else ""


def _gains_of(law: type[Any], controller: Controller) -> tuple[dict[str, Any], str]:
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


def _task_of(given: Task | str, task: Task) -> tuple[str, Any, str]:
    """The registered name by which the task was requested, or one of the package that its class is of,
    or none; what it is made of again, or None; and the reason why it cannot be, empty if it can."""
    name = given if isinstance(given, str) else _registered_in(type(task).__module__)
    try:
        found = as_plain(task, _allowed_by(name))
        if isinstance(found, dict) and "class" in found:
            return name, found, ""
        raise NotPlainError(f"{type(task).__name__} is no dataclass")
    except NotPlainError as error:
        reason = f"its task is an object that the file does not hold: {error}"
        return name, None, "" if isinstance(given, str) else reason


def _registered_in(module: str) -> str:
    """A task of a module, by which the package of a class is found. Mobman's own need none."""
    factories = {} if module.startswith(_OWN_TASKS) else tasks.loaded()
    names = (n for n, make in factories.items() if getattr(make, "__module__", None) == module)
    return next(names, "")


def _allowed_by(name: str) -> Callable[[str], bool]:
    """A predicate of modules whose classes may be made: mobman's, and that of the registered task."""
    modules = set()
    with contextlib.suppress(UnknownNameError):
        modules.add(getattr(tasks.get(name), "__module__", None) if name else None)
    return lambda module: module.startswith(_OWN_TASKS) or module in modules


# And back from the description to the parts --------------------------------------------------------


def robot_of(
    run: RunSpec, urdf: dict[str, bytes], given: MobileManipulator | None = None
) -> MobileManipulator:
    """The nominal robot of a run, from its description and the URDFs in the record.

    Args:
        run: The run.
        urdf: The URDFs in the record.
        given: The robot, where the caller has it.

    Raises:
        RecordError: If it cannot be built, or is not the one of the run.
    """
    robot = _build(run.description, urdf, "") if given is None else given
    require_same(robot, run, "robot")
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
    run: RunSpec, urdf: dict[str, bytes], robot: MobileManipulator
) -> MobileManipulator | Scenario | None:
    """The plant as a run was given it.

    Raises:
        RecordError: If it cannot be built.
    """
    if run.plant_scenario:
        return recorded_scenario(run.plant_scenario)
    if not run.plant_inertias:
        return None
    base = _build(run.plant_robot, urdf, "plant/") if run.plant_robot else robot
    if base.model.njoints != len(run.plant_inertias) + 1:
        raise RecordError("its plant has other joints than its description")
    model = base.model.copy()
    for i, numbers in enumerate(run.plant_inertias, start=1):
        xx, xy, yy, xz, yz, zz = numbers[4:]
        turning = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.inertias[i] = pin.Inertia(numbers[0], np.array(numbers[1:4]), turning)
    return base.with_model(model)


def require_same(robot: MobileManipulator, run: RunSpec, role: str) -> None:
    """
    Args:
        robot: A robot.
        run: The run.
        role: ``"robot"`` or ``"plant"``.

    Raises:
        RecordError: If it is not the one that the run had.
    """
    now = _at_start(robot, robot.checked_configuration(np.array(run.q0)))
    for name, then in run.at_start[role].items():
        new, old = np.array(now[name]), np.array(then, dtype=float)
        if new.shape != old.shape or not np.all(
            np.abs(new - old) <= _ROUNDING * np.abs(old).max(initial=0.0)
        ):
            raise RecordError(
                f"its {role} has other inertias or dimensions than what the file describes: it was "
                "changed in Python after it was built, or this mobman builds it in another way"
            )


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


def controller_of(run: RunSpec) -> Controller:
    """The controller of a run.

    Raises:
        RecordError: If there is no such law here, or it has other gains.
    """
    try:
        return make_controller(run.law, **run.gains)
    except MobmanError as error:
        raise RecordError(f"its controller cannot be made: {error}") from error


def task_of(run: RunSpec, robot: MobileManipulator, q0: Array) -> Task:
    """The task of a run.

    Raises:
        RecordError: If there is no such task here.
    """
    try:
        if run.task_object is not None:
            task: Task = from_plain(run.task_object, _allowed_by(run.task_name))
            return task
        return make_task(run.task_name, robot, q0, **run.task_given)
    except (NotPlainError, MobmanError, TypeError) as error:
        raise RecordError(f"its task cannot be made: {error}") from error


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
