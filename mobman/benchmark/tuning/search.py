"""The search for one controller's gains: what is to be tried, and what has been."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mobman.benchmark.tuning.evaluation import Evaluation
from mobman.benchmark.tuning.objective import Objective
from mobman.benchmark.tuning.proposals import BATCH, propose, sampler_settings
from mobman.benchmark.tuning.search_range import Space
from mobman.benchmark.tuning.trial import Trial
from mobman.controllers.protocol import gains_by_field
from mobman.simulation.run_spec import RunSpec


@dataclass(frozen=True)
class Search:
    """One controller's search."""

    label: str
    space: Space
    runs: Sequence[RunSpec]
    """The tuning set, with the suite's own gains."""
    objective: Objective

    @property
    def problem(self) -> str:
        """Hash of all that a trial and its score depend on."""
        content = {
            "runs": [run.run_id for run in self.runs],
            "gains": [gains_by_field(run.law, run.gains) for run in self.runs],
            "space": {name: own.model_dump() for name, own in self.space.items()},
            "objective": [self.objective.name, self.objective.formula],
            "sampler": sampler_settings(),
        }
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def default(self) -> dict[str, float] | None:
        """The suite's own gains as a point of the space; None if they are none.

        They are none where one is not a number (``"auto"``, a list), is outside its range, or is not
        the same for all robots and tasks.
        """
        point: dict[str, float] = {}
        for name, own in self.space.items():
            values = {str(run.settings.get(name)): run.settings.get(name) for run in self.runs}
            value: Any = next(iter(values.values()))
            if len(values) > 1 or value not in own:
                return None
            point[name] = float(value)
        return point

    def gains_of_batch(
        self, before: Sequence[Trial], first: int, count: int
    ) -> list[dict[str, float]]:
        """The gains of the trials ``first`` to ``first + count - 1``, all of one batch.

        Args:
            before: All trials before ``first``.
            first: A multiple of the batch's size.
            count: How many, at most the batch's size.
        """
        own: list[dict[str, float]] = [{}] if first == 0 else []
        default = self.default
        tried = [
            (point, trial.score)
            for trial in before
            if (point := trial.gains if trial.number else default) is not None
        ]
        return own + propose(self.space, tried, first // BATCH, count - len(own))

    def evaluations(self, gains: dict[str, float]) -> list[Evaluation]:
        """The runs of a trial."""
        return [
            Evaluation.of(run, gains={**gains_by_field(run.law, run.gains), **gains})
            for run in self.runs
        ]

    def as_dict(self) -> dict[str, Any]:
        """What is searched, as plain values."""
        return {
            "law": self.runs[0].law,
            "space": {name: own.model_dump() for name, own in self.space.items()},
            "default": self.default,
            "problem": self.problem,
            "runs": [replace(run, settings={}).as_dict() for run in self.runs],
        }
