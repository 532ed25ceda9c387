"""The tables of a suite's file."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from mobman.toml_model import Strict

Label = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
Grid = dict[str, Annotated[list[Any], Field(min_length=1)]]
"""Values by field; the entry stands for all combinations."""
Positive = Annotated[float, Field(gt=0, strict=True)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Names = Annotated[list[str], Field(min_length=1)]
MOST_PLACEMENTS = 1000
"""Placements of a suite; its tuning has those that follow after so many."""
Placements = Annotated[int, Field(ge=1, le=MOST_PLACEMENTS)]


class SearchRange(Strict):
    """From where to where tuning searches a gain, both ends included."""

    low: float
    high: float
    log: bool = False
    """True if its logarithm is searched: for gains whose order of magnitude matters."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"low = {self.low:g} must be below high = {self.high:g}")
        if self.log and not self.low > 0.0:
            raise ValueError(f"low = {self.low:g} must be above 0 where log = true")
        return self

    def rounded(self, value: float, digits: int = 4) -> float:
        """The value with so many significant digits, and inside the range."""
        return min(max(float(f"{value:.{digits}g}"), self.low), self.high)

    def __contains__(self, value: object) -> bool:
        return (
            isinstance(value, (int, float))
            and not isinstance(value, bool)
            and self.low <= value <= self.high
        )


Space = dict[str, SearchRange]
"""Ranges by gain."""


class Tuning(Strict):
    """The table ``[tuning]``: the budget, which is the same for each controller."""

    trials: int = Field(30, ge=1, le=10_000)
    """Sets of gains that are tried of each controller; the first is the suite's own."""
    seeds: list[Seed] = Field([1000], min_length=1)
    """Each is a run of each trial."""
    robots: Names | None = None
    """Those of the suite by default."""
    tasks: Names | None = None
    """Those of the suite by default; a robot does those that it does in the suite."""
    placements: Placements | None = None
    """Number of placements, none of them the suite's: each is a run of each trial. By default two where
    the suite has several, and else the robot's rest."""
    scenarios: Names | None = None
    """Names of ``definitions``, of the suite's scenarios or of mobman's; by default all of
    ``definitions``, or mobman's own for tuning if there are none."""
    definitions: dict[Label, dict[str, Any]] = {}
    """Scenarios of the tuning alone, by label: a scenario's fields."""
    duration: Positive | None = None
    """Duration of each run (s); the suite's by default."""
    dt: Positive | None = None
    """Sampling period (s); by default that of the suite's first run of the robot and task."""
    objective: str = "error"
    """Name of the quantity that is minimized; see :mod:`mobman.benchmark.tuning.objective`."""
    spaces: dict[str, Space] = {}
    """Ranges by gain, by the controller's label, in the place of those of its law."""


class TunedFrom(Strict):
    """The origin of tuned gains.

    An entry that names itself (``label`` is its own) was tuned in vain: no trial was better than its
    own gains.
    """

    label: str
    """The entry whose gains were tuned."""
    trials: int = Field(ge=1)
    """Sets of gains that were tried, the entry's own among them."""
    trial: int = Field(ge=0)
    """Number of the best of them; 0 is the entry's own."""
    objective: str
    """Name of the quantity that was minimized."""
    score_default: float
    """Score of the entry's own gains, on the tuning set; less is better."""
    score: float
    """Score of the best."""
    space: Annotated[Space, Field(min_length=1)]
    """The ranges that were searched, by gain."""


class ControllerEntry(Strict):
    """A controller of a suite, under a label of its own."""

    law: str
    """Name of a controller."""
    gains: dict[str, Any] = {}
    """Gains that differ from the law's defaults."""
    grid: Grid = {}
    """Values of gains."""
    tuned: TunedFrom | None = None
    """Source of its gains, if ``mobman bench tune`` found them."""


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
    """Settings that a part of a suite may have of its own; the suite's where they are not given."""

    duration: Positive | None = None
    """Duration of each run (s)."""
    dt: Positive | Annotated[list[Positive], Field(min_length=1)] | None = None
    """Sampling period (s), or several: each is a run."""
    seeds: Annotated[list[Seed], Field(min_length=1)] | None = None
    placements: Placements | None = None


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
    """Runs that an override is for: those that fit all that is given."""

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
    """Differences for some of the runs; later ones win."""

    where: Where
    gains: dict[str, Any] = {}
    """Gains that differ."""
    skip: bool = False
    """Leave these runs out."""


class SuiteTables(Strict):
    """All of a file ``benchmarks/NAME.toml``."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    description: str = ""
    duration: Positive
    """Duration of every run (s)."""
    dt: Positive | Annotated[list[Positive], Field(min_length=1)] = 1e-3
    """Sampling period (s), or several: each is a run."""
    seeds: Annotated[list[Seed], Field(min_length=1)] = [0]
    placements: Placements = 1
    """Number of starts, with the task placed at each: the robot's rest, and others that are drawn."""
    first_placement: Annotated[int, Field(ge=0, lt=2**31)] = 0
    """Number of the first of them; 0 is the robot's rest, with the task as it is given."""
    time_limit: Positive = 600.0
    """Wall time that a run may take (s); one that takes longer gives no result."""
    record_period: Positive = 5e-3
    """Time from one recorded sample to the next (s); metrics are always those of all ticks."""
    compression: int = Field(4, ge=0, le=9)
    """Compression of the files, from 0, none, to 9."""
    monitor: bool = False
    """Whether what the theorems suppose is recorded of the runs of sliding laws."""
    controllers: dict[Label, ControllerEntry] = Field(min_length=1)
    tasks: dict[Label, TaskEntry] = {}
    """In addition to those that have names."""
    scenarios: dict[Label, ScenarioEntry] = {}
    """In addition to those that have names."""
    groups: list[Group] = Field(min_length=1)
    overrides: list[Override] = []
    tuning: Tuning | None = None
    """Budget of tuning its controllers."""

    @model_validator(mode="after")
    def _long_enough(self) -> Self:
        parts: list[SuiteTables | Changes] = [self, *self.groups, *self.overrides]
        for part in parts:
            duration = self.duration if part.duration is None else part.duration
            periods = self.dt if part.dt is None else part.dt
            for dt in periods if isinstance(periods, list) else [periods]:
                if duration < dt:
                    raise ValueError(f"duration {duration:g} s is shorter than dt {dt:g} s")
        return self
