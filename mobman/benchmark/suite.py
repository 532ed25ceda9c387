"""Suites: which robots do which tasks under which controllers, scenarios and seeds."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from mobman.controllers.protocol import make_controller
from mobman.errors import MobmanError, SpecError, UnknownNameError
from mobman.model.build import load_robot
from mobman.resources import resource_folder
from mobman.robots.catalogue import find_spec
from mobman.robots.urdf.file import urdf_sources
from mobman.simulation.scenario import load_scenario
from mobman.tasks.task import make_task, task_parameters, tasks
from mobman.toml_model import Strict, named_file, read_toml, validate
from mobman.version import __version__


class ControllerEntry(Strict):
    """A controller of a suite, under a label of its own."""

    law: str
    """Name of a controller."""
    gains: dict[str, Any] = {}
    """Gains that differ from the law's defaults."""


class Group(Strict):
    """All combinations of the names in it."""

    robots: list[str] = Field(min_length=1)
    tasks: list[str] = Field(min_length=1)
    scenarios: list[str] = Field(["nominal"], min_length=1)
    controllers: list[str] | None = Field(None, min_length=1)
    """Labels of the suite's controllers; all of them by default."""
    gains: dict[str, dict[str, Any]] = {}
    """Gains that differ in this group, by label."""


class Suite(Strict):
    """A suite: what a file ``benchmarks/NAME.toml`` says."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    description: str = ""
    duration: float = Field(gt=0)
    """Of every run (s)."""
    dt: float = Field(1e-3, gt=0)
    """Sampling period (s)."""
    seeds: list[Annotated[int, Field(ge=0, lt=2**63)]] = Field([0], min_length=1)
    record_every: int = Field(1, ge=1)
    """Ticks from one recorded sample to the next; metrics are always those of all ticks."""
    controllers: dict[str, ControllerEntry] = Field(min_length=1)
    groups: list[Group] = Field(min_length=1)

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        if self.duration < self.dt:
            raise ValueError(f"duration {self.duration:g} s is shorter than dt {self.dt:g} s")
        return self

    def runs(self) -> list[RunSpec]:
        """Every run, in the order of the file.

        Raises:
            SpecError: With everything that is wrong: unknown names, labels and gains.
        """
        problems: list[str] = []
        runs: dict[str, RunSpec] = {}
        for number, group in enumerate(self.groups):
            where = f"groups.{number}"
            labels = list(self.controllers) if group.controllers is None else group.controllers
            for label in {*labels, *group.gains} - set(self.controllers):
                problems.append(str(UnknownNameError(f"label in {where}", label, self.controllers)))
            resolved = {
                label: self._resolve(label, group, where, problems)
                for label in labels
                if label in self.controllers
            }
            robots = {name: _problem(problems, where, _fingerprint, name) for name in group.robots}
            scenarios = {
                name: _problem(problems, where, _scenario, name) for name in group.scenarios
            }
            for name in group.tasks:
                _problem(problems, where, tasks.get, name)
            for label in set(group.gains) - set(labels):
                problems.append(f"{where}: gains for {label!r}, which is not among its controllers")
            if problems:
                continue
            aims = {
                (robot, task): _task(robot, task) for robot in group.robots for task in group.tasks
            }
            for robot, task, scenario, label, seed in product(
                group.robots, group.tasks, group.scenarios, labels, self.seeds
            ):
                law, gains, settings = resolved[label]
                run = RunSpec(
                    label=label,
                    robot=robot,
                    robot_sha256=str(robots[robot]),
                    law=law,
                    gains=gains,
                    settings=settings,
                    task=task,
                    task_parameters=aims[robot, task],
                    scenario=scenarios[scenario],
                    seed=seed,
                    duration=self.duration,
                    dt=self.dt,
                    record_every=self.record_every,
                    version=__version__,
                )
                other = runs.setdefault(run.run_id, run)
                if other.label != label:
                    problems.append(
                        f"{where}: labels {other.label!r} and {label!r} are the same run"
                    )
        if problems:
            raise SpecError(f"suite {self.name!r}: " + "; ".join(dict.fromkeys(problems)))
        return list(runs.values())

    def _resolve(
        self, label: str, group: Group, where: str, problems: list[str]
    ) -> tuple[str, dict[str, Any], dict[str, Any]]:
        entry = self.controllers[label]
        gains = {**entry.gains, **group.gains.get(label, {})}
        settings: dict[str, Any] = {}
        try:
            controller = make_controller(entry.law, **gains)
            settings = getattr(controller, "settings", dict)()
        except MobmanError as error:
            problems.append(f"controller {label!r} in {where}: {error}")
        return entry.law, gains, settings


@dataclass(frozen=True)
class RunSpec:
    """One run of a suite, with all that its result depends on."""

    label: str
    """The controller's label in the suite; not part of the run's identity."""
    robot: str
    robot_sha256: str
    """Of the robot's description and URDF."""
    law: str
    gains: dict[str, Any]
    """As the suite gives them."""
    settings: dict[str, Any]
    """All gains, the law's defaults among them."""
    task: str
    task_parameters: dict[str, Any]
    scenario: dict[str, Any]
    seed: int
    duration: float
    dt: float
    record_every: int
    version: str
    """mobman's: another version may give other numbers."""

    @property
    def run_id(self) -> str:
        """Hash of the run's specification."""
        content = {
            key: value for key, value in asdict(self).items() if key not in ("label", "gains")
        }
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def __str__(self) -> str:
        name = self.scenario["name"]
        return f"{self.robot} · {self.task} · {name} · {self.label} · seed {self.seed}"


def list_suites() -> list[str]:
    """The names that :func:`load_suite` takes, sorted."""
    return sorted(_files())


def load_suite(name_or_path: str | os.PathLike[str]) -> Suite:
    """A suite by name, or from a TOML file.

    Raises:
        UnknownNameError: If there is no such name.
        SpecError: If the file is not valid.
    """
    path = named_file("suite", name_or_path, _files())
    return validate(Suite, read_toml(path, "suite file"), str(path))


def _files() -> dict[str, Path]:
    return {path.stem: path for path in sorted(resource_folder("benchmarks").glob("*.toml"))}


def _problem(problems: list[str], where: str, find: Any, name: str) -> Any:
    try:
        return find(name)
    except MobmanError as error:
        problems.append(f"{where}: {error}")
        return None


def _fingerprint(robot: str) -> str:
    spec = find_spec(robot)
    text = json.dumps(spec.model_dump(mode="json", by_alias=True), sort_keys=True)
    urdf = urdf_sources(spec).sha256()
    return hashlib.sha256((text + urdf).encode()).hexdigest()[:16]


def _task(robot: str, task: str) -> dict[str, Any]:
    return task_parameters(make_task(task, load_robot(robot)))


def _scenario(name: str) -> dict[str, Any]:
    return load_scenario(name).model_dump(mode="json")
