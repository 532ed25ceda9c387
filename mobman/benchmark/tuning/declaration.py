"""What a suite says of tuning: the budget, and on what it is spent."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from mobman.benchmark.tuning.search_range import Space
from mobman.toml_model import Strict

_Names = Annotated[list[str], Field(min_length=1)]


class Tuning(Strict):
    """The table ``[tuning]`` of a suite; the same for each of its controllers."""

    trials: int = Field(30, ge=1, le=10_000)
    """Sets of gains that are tried of each controller; the first is the suite's own."""
    seeds: list[Annotated[int, Field(ge=0, lt=2**63)]] = Field([1000], min_length=1)
    """Each is a run of each trial."""
    robots: _Names | None = None
    """Those of the suite by default."""
    tasks: _Names | None = None
    """Those of the suite by default; a robot does those that it does in the suite."""
    scenarios: _Names | None = None
    """Names of ``definitions``, of the suite's scenarios or of mobman's; by default all of
    ``definitions``, or mobman's own for tuning if there are none."""
    definitions: dict[
        Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")], dict[str, Any]
    ] = {}
    """Scenarios of the tuning alone, by label: a scenario's fields."""
    duration: float | None = Field(None, gt=0)
    """Of each run (s); the suite's by default."""
    dt: float | None = Field(None, gt=0)
    """Sampling period (s); by default that of the suite's first run of the robot and task."""
    objective: str = "error"
    """Name of what is made small; see :mod:`mobman.benchmark.tuning.objective`."""
    spaces: dict[str, Space] = {}
    """Ranges by gain, by the controller's label, in the place of those of its law."""
