"""One run as plain values, and its identity: of a suite, of a worker's job, and of a record."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import fields
from functools import cached_property
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

from pydantic import ConfigDict, Field, InstanceOf, ValidationError, field_validator
from pydantic.dataclasses import dataclass

from mobman.errors import RecordError
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.read import urdf_sources
from mobman.version import __version__

Table = InstanceOf[dict[str, Any]]
Number = Annotated[float, Field(ge=-(2.0**63), le=2.0**63, allow_inf_nan=False)]

_NO_PART_OF_THE_RESULT = {
    # names within the suite; gains, which `settings` hold; and what follows from the rest
    *("label", "gains", "task", "family", "compression"),
    "placement",  # q0 and the task's parameters say what it is
    *("description", "task_object", "plant", "plant_masses", "at_start", "not_repeatable"),
}
_RECORDED = (
    *("task", "gains", "task_parameters", "task_object", "scenario", "duration", "dt", "q0"),
    *("seed", "plant", "plant_masses", "at_start", "not_repeatable"),
)
_RECORDED_IF_GIVEN = (
    *("task_given", "placement", "monitor", "plant_scenario", "plant_robot", "plant_inertias"),
)
_NONE_IF_EMPTY = ("law", "task_name", "plant")
_LACKING: dict[str, Any] = {"task": "", "task_parameters": {}, "plant": "", "plant_masses": []}
"""Parts of a record's description that a repetition does without."""


class Cell(NamedTuple):
    """Unit of comparison: everything about a run but the controller and the seed."""

    robot: str
    task: str
    scenario: str
    dt: float
    duration: float
    placement: int


@dataclass(frozen=True, kw_only=True, config=ConfigDict(strict=True, extra="forbid"))
class RunSpec:
    """One run: everything that its result depends on, and what it is called."""

    label: str
    """The controller's label in the suite, or its name."""
    robot: str
    """Name or file, as the suite has it."""
    robot_sha256: str = ""
    """Hash of the robot's description and the files that this names, see :func:`fingerprint`."""
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
    """Seed of all randomness."""
    duration: Number
    """s."""
    dt: Number
    """Sampling period (s)."""
    record_period: Number = 0.0
    """Time from one sample in the file to the next (s)."""
    compression: int = 4
    """Compression of the file, 0 to 9."""
    code_sha256: str = ""
    """Hash of the source that is not mobman's own, see :func:`foreign_code_sha256`; empty if all is."""
    version: str = __version__
    """mobman's: another version may give other numbers."""
    q0: list[float] = Field(default_factory=list)
    """Start; the robot's ``q_rest`` where there is none. Of a suite's run, the one that its task is made
    for, from which the scenario may displace the robot."""
    placement: Annotated[int, Field(ge=0)] = 0
    """Its number in the suite, see :func:`mobman.simulation.placements.placements`."""
    monitor: bool = False
    """Whether what the theorems suppose is recorded, see :mod:`mobman.simulation.monitors`."""
    description: Table = Field(default_factory=dict)
    """The robot's, as a TOML file has it; this and what follows is known of a run that was done."""
    task_object: Any = None
    """The task's class and fields, where it is a dataclass."""
    plant: str = ""
    """Name of the true robot or scenario, if one was given."""
    plant_scenario: Table = Field(default_factory=dict)
    plant_robot: Table = Field(default_factory=dict)
    """Description of a true robot that is another one."""
    plant_inertias: list[list[float]] = Field(default_factory=list)
    """Inertia of a true robot, for each joint: m, the centre of mass, and the inertia about it."""
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
        left_out = set(_NO_PART_OF_THE_RESULT)
        if self.robot.endswith(".toml") or os.sep in self.robot:
            left_out.add("robot")  # wherever its file is: `robot_sha256` says what it is
        content = {key: value for key, value in self.as_dict().items() if key not in left_out}
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def cell(self) -> Cell:
        """The unit that it is compared in."""
        name: str = self.scenario["name"]
        return Cell(self.robot, self.task, name, self.dt, self.duration, self.placement)

    @property
    def record_every(self) -> int:
        """Ticks from one sample in the file to the next."""
        return max(1, round(self.record_period / self.dt))

    def __str__(self) -> str:
        cell, placed = self.cell, f"placement {self.placement} · " if self.placement else ""
        first = f"{cell.robot} · {cell.task} · {cell.scenario} · {self.label} · {cell.dt:g} s"
        return f"{first} · {placed}seed {self.seed}"

    def as_dict(self) -> dict[str, Any]:
        """The fields; those of a run that was done if they have a value."""
        found = {field.name: getattr(self, field.name) for field in fields(self)}
        first = list(found).index("q0")
        return {key: value for i, (key, value) in enumerate(found.items()) if i < first or value}

    def as_recorded(self) -> dict[str, Any]:
        """The fields as a record's file has them."""
        given = {name: getattr(self, name) for name in _RECORDED_IF_GIVEN}
        return {
            **{name: getattr(self, name) for name in _RECORDED},
            **{name: value for name, value in given.items() if value},
            **{name: getattr(self, name) or None for name in _NONE_IF_EMPTY},
            "robot": self.description,
            "controller": self.label,
        }

    @classmethod
    def of_record(cls, content: Mapping[str, Any]) -> Self:
        """The run that a record describes; RecordError if a field is missing, or of another type."""
        try:
            content = {**_LACKING, **content}
            optional = [name for name in _RECORDED_IF_GIVEN if name in content]
            return cls.of_fields(
                {name: content[name] for name in (*_RECORDED, *optional)}
                | {name: content[name] or "" for name in _NONE_IF_EMPTY}
                | {"robot": content["robot"]["name"], "description": content["robot"]}
                | {"label": str(content.get("controller"))}
            )
        except (KeyError, TypeError, ValueError) as error:
            no = "no " if isinstance(error, KeyError) else ""
            raise RecordError(f"what it says of the run is not whole: {no}{error}") from error

    @classmethod
    def of_fields(cls, content: Mapping[str, Any]) -> Self:
        """The run of fields that a file has; ValueError, in one line, if one is missing, or of another
        type."""
        try:
            return cls(**content)
        except ValidationError as error:
            faults = (f"field {'.'.join(map(str, e['loc']))!r}: {e['msg']}" for e in error.errors())
            raise ValueError("; ".join(list(faults)[:3])) from None


# Code and files as part of what a run depends on --------------------------------------------------


def fingerprint(spec: RobotSpec) -> str:
    """Hash of a robot's description and of what it names: URDFs and Python code; SpecError if a URDF is
    not there.

    Meshes are left out, since no run depends on them, and so is the folder that all of it is in.
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
    """Hash of the files that hold the sources of classes and functions, 16 hexadecimal digits: who
    edits a law wants its runs again. Those of mobman, whose version says what they are, do not count,
    nor do those without a file, made in a session or compiled; empty if none counts."""
    digest, foreign = hashlib.sha256(), False
    for thing in things:
        if str(getattr(thing, "__module__", "")).startswith("mobman."):
            continue
        try:
            path = Path(inspect.getfile(thing))
        except (TypeError, OSError):
            continue
        if path.is_file():
            digest.update(path.read_bytes())
            foreign = True
    return digest.hexdigest()[:16] if foreign else ""
