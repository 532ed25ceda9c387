"""What a tuning leaves behind: ``tuning.json``, and the suite with the tuned gains."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mobman.benchmark.tuning.declaration import Tuning
from mobman.benchmark.tuning.search import Search
from mobman.benchmark.tuning.trial import Trial, best
from mobman.benchmark.tuning.tuned_from import TunedFrom
from mobman.benchmark.tuning.tuned_suite import tuned_suite
from mobman.errors import MobmanError
from mobman.files import temporary_beside
from mobman.provenance import versions

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite

_SCHEMA_VERSION = 1


@dataclass(frozen=True)
class TuningResult:
    """How a tuning went."""

    json_file: Path
    """Everything: the budget, the spaces, all trials."""
    suite_file: Path
    """The suite with the tuned gains beside its own."""
    suite: Suite
    """The same."""
    trials: Mapping[str, Sequence[Trial]]
    """By label."""
    left_out: Mapping[str, str]
    """Why a controller was not tuned, by label."""
    seconds: float
    """Wall time of this call."""

    def best(self, label: str) -> Trial:
        """A controller's best trial; trial 0 if no gains were better than its own."""
        return best(self.trials[label])


def write_result(
    suite: Suite,
    tuning: Tuning,
    folder: Path,
    searches: Mapping[str, Search],
    trials: Mapping[str, Sequence[Trial]],
    *,
    left_out: Mapping[str, str],
    sampler: Mapping[str, Any],
    seconds: float,
    workers: int | None,
) -> TuningResult:
    """Write both files.

    Raises:
        MobmanError: If they cannot be written.
    """
    found = {label: _provenance(searches[label], own) for label, own in trials.items()}
    gains = {label: best(own).gains for label, own in trials.items()}
    written = tuned_suite(suite, tuning, found, gains)
    content = {
        "schema_version": _SCHEMA_VERSION,
        "suite": suite.name,
        "tuning": tuning.model_dump(mode="json"),
        "objective": searches[next(iter(searches))].objective.formula,
        "sampler": dict(sampler),
        "controllers": {
            label: {
                **searches[label].as_dict(),
                "score_default": own[0].score,
                "score": best(own).score,
                "trial": best(own).number,
                "gains": best(own).gains,
                "simulated_runs": sum(len(trial.runs) for trial in own),
                "evaluation_seconds": sum(run.seconds for trial in own for run in trial.runs),
                "trials": [trial.as_dict() for trial in own],
            }
            for label, own in trials.items()
        },
        "not_tuned": dict(left_out),
        "versions": versions(),
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "architecture": platform.machine(),
            "system": platform.platform(),
            "cores": os.cpu_count(),
        },
        "workers": workers,
        "seconds": seconds,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    json_file, suite_file = folder / "tuning.json", folder / f"{written.name}.toml"
    _write(json_file, json.dumps(_plain(content), indent=1, default=str) + "\n")
    _write(suite_file, _toml(written))
    return TuningResult(json_file, suite_file, written, trials, left_out, seconds)


def _provenance(search: Search, trials: Sequence[Trial]) -> TunedFrom:
    chosen = best(trials)
    return TunedFrom(
        label=search.label,
        trials=len(trials),
        trial=chosen.number,
        objective=search.objective.name,
        score_default=trials[0].score,
        score=chosen.score,
        space=search.space,
    )


def _toml(suite: Suite) -> str:
    import tomli_w

    content = suite.model_dump(mode="json", by_alias=True, exclude_unset=True)
    return (
        "# Written by mobman bench tune; tuning.json beside it has every trial.\n"
        + tomli_w.dumps(content)
    )


def _plain(value: Any) -> Any:
    """Numbers that JSON has no word for (inf, NaN) are null."""
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def _write(path: Path, text: str) -> None:
    temporary = temporary_beside(path)
    try:
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise MobmanError(f"cannot write {path}: {error.strerror}") from error
