"""Suites: which robots do which tasks under which controllers, scenarios and seeds."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from mobman.benchmark.expansion.expansion import number_of_runs, runs_of
from mobman.benchmark.tuning.declaration import Tuning
from mobman.benchmark.tuning.tuned_from import TunedFrom
from mobman.resources import resource_folder
from mobman.simulation.run_spec import RunSpec
from mobman.toml_model import Strict, named_file, read_toml, validate

Label = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
Grid = dict[str, Annotated[list[Any], Field(min_length=1)]]
"""Values by field; the entry stands for all combinations."""
Positive = Annotated[float, Field(gt=0)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Names = Annotated[list[str], Field(min_length=1)]


class ControllerEntry(Strict):
    """A controller of a suite, under a label of its own."""

    law: str
    """Name of a controller."""
    gains: dict[str, Any] = {}
    """Gains that differ from the law's defaults."""
    grid: Grid = {}
    """Values of gains."""
    tuned: TunedFrom | None = None
    """Where its gains come from, if ``mobman bench tune`` found them."""


class TaskEntry(Strict):
    """A task of a suite, under a label of its own."""

    task: str
    """Name of a task."""
    parameters: dict[str, Any] = {}
    """Parameters that differ from its defaults."""
    grid: Grid = {}
    """Values of parameters."""


class ScenarioEntry(Strict):
    """A scenario of a suite; the other fields are a scenario's own."""

    model_config = ConfigDict(extra="allow", frozen=True)

    grid: Grid = {}
    """Values of the scenario's fields."""

    @property
    def fields(self) -> dict[str, Any]:
        """Those of the scenario."""
        return dict(self.__pydantic_extra__ or {})


class Changes(Strict):
    """What a part of a suite may have of its own; what is not given is the suite's."""

    duration: Positive | None = None
    """Of each run (s)."""
    dt: Positive | Annotated[list[Positive], Field(min_length=1)] | None = None
    """Sampling period (s), or several: each is a run."""
    seeds: Annotated[list[Seed], Field(min_length=1)] | None = None


class Group(Changes):
    """All combinations of the names in it.

    A name is one thing, all that a grid makes of it, or a pattern such as ``"*"`` or ``"payload-*"``.
    """

    robots: Names
    tasks: Names
    scenarios: Names = ["nominal"]
    controllers: Names | None = None
    """Labels of the suite's controllers; all of them by default."""
    gains: dict[str, dict[str, Any]] = {}
    """Gains that differ in this group, by label."""


class Where(Strict):
    """Which runs an override is for: those that fit all that is given."""

    robots: Names | None = None
    tasks: Names | None = None
    scenarios: Names | None = None
    controllers: Names | None = None

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("say of which robots, tasks, scenarios or controllers")
        return self


class Override(Changes):
    """What differs for some of the runs; later ones win."""

    where: Where
    gains: dict[str, Any] = {}
    """Gains that differ."""
    skip: bool = False
    """Leave these runs out."""


class Suite(Strict):
    """A suite: what a file ``benchmarks/NAME.toml`` says."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    description: str = ""
    duration: Positive
    """Of every run (s)."""
    dt: Positive | Annotated[list[Positive], Field(min_length=1)] = 1e-3
    """Sampling period (s), or several: each is a run."""
    seeds: Annotated[list[Seed], Field(min_length=1)] = [0]
    time_limit: Positive = 600.0
    """Wall time that a run may take (s); one that takes longer gives no result."""
    record_period: Positive = 5e-3
    """Time from one recorded sample to the next (s); metrics are always those of all ticks."""
    compression: int = Field(4, ge=0, le=9)
    """Of the files, from 0, none, to 9."""
    controllers: dict[Label, ControllerEntry] = Field(min_length=1)
    tasks: dict[Label, TaskEntry] = {}
    """Beside those that have names."""
    scenarios: dict[Label, ScenarioEntry] = {}
    """Beside those that have names."""
    groups: list[Group] = Field(min_length=1)
    overrides: list[Override] = []
    tuning: Tuning | None = None
    """How its controllers are tuned, or were."""

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        parts: list[Suite | Changes] = [self, *self.groups, *self.overrides]
        for part in parts:
            duration = self.duration if part.duration is None else part.duration
            periods = self.dt if part.dt is None else part.dt
            for dt in periods if isinstance(periods, list) else [periods]:
                if duration < dt:
                    raise ValueError(f"duration {duration:g} s is shorter than dt {dt:g} s")
        return self

    def runs(self) -> list[RunSpec]:
        """Every run, in the order of the file.

        Raises:
            SpecError: With everything that is wrong: unknown names, labels and gains.
        """
        return runs_of(self)

    def size(self) -> int:
        """How many runs there are, by the names alone.

        Raises:
            SpecError: With all names that are unknown.
        """
        return number_of_runs(self)


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
