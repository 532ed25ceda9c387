"""``suite.json``: the request of a folder of results, and the hashes of its records."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mobman.benchmark.suite import Suite
from mobman.errors import MobmanError, SpecError
from mobman.files import read_within, write_whole
from mobman.simulation.run_spec import RunSpec

SCHEMA_VERSION = 3
EARLIER = (2,)  # schemas that are read and shown, and not added to
NAME = "suite.json"
_MEGABYTES = 200.0  # 10,000 runs take some 5 MB
_ADVICE = (
    "Run the suite again, into another folder, or into this one without that file: runs that are there "
    "and still fit are used"
)
_TABLES = ("gains", "settings", "task_given", "task_parameters", "scenario")


@dataclass(frozen=True)
class Manifest:
    """The runs of a suite, the time that they took, and the hashes of their records."""

    suite: Suite
    runs: tuple[RunSpec, ...]  # in the suite's order
    seconds: float | None = None  # time that its runs took altogether (s); None if none was done
    workers: int | None = None  # number of workers of the last call
    hashes: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of records' files, by run id; of those that were done when a call ended."""
    schema_version: int = SCHEMA_VERSION

    def write(self, folder: Path) -> None:
        """
        Raises:
            OSError: If it cannot be written; one that is there is left as it was.
        """
        shared: dict[str, int] = {}  # tables that thousands of runs have in common, each once

        def folded(value: Any) -> Any:
            """The index of a table, in its place."""
            if not isinstance(value, dict):
                return value
            return shared.setdefault(json.dumps(value, sort_keys=True, default=str), len(shared))

        runs = [{key: folded(value) for key, value in run.as_dict().items()} for run in self.runs]
        content = {
            "schema_version": SCHEMA_VERSION,
            "suite": self.suite.model_dump(mode="json", by_alias=True),
            "seconds": self.seconds,
            "workers": self.workers,
            "runs": runs,
            "shared": [json.loads(text) for text in shared],
            "records": dict(self.hashes),
        }
        write_whole(folder / NAME, json.dumps(content).encode())


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder.

    Raises:
        MobmanError: If there is none, or it is not whole, or of another schema.
    """
    path = folder / NAME
    try:
        if folder.exists() and not folder.is_dir():
            raise MobmanError(f"{folder} is not a folder of results: it is a file")
        if not os.path.lexists(path):
            raise MobmanError(f"{folder} holds no results: there is no {NAME}")
        content = json.loads(read_within(path, folder, "manifest", _MEGABYTES))
    except OSError as error:
        raise MobmanError(f"cannot read {path}: {error.strerror or error}") from error
    except SpecError as error:
        raise MobmanError(str(error)) from error
    except (ValueError, RecursionError) as error:
        raise MobmanError(f"cannot read {path}: it is not JSON ({error}). {_ADVICE}") from error
    version = content.get("schema_version") if isinstance(content, dict) else None
    if version not in (*EARLIER, SCHEMA_VERSION):
        raise MobmanError(
            f"{path} has schema version {version}; this mobman reads version {SCHEMA_VERSION}. {_ADVICE}"
        )
    try:
        parts = content["shared"]
        runs = [
            RunSpec.of_fields({k: parts[v] if k in _TABLES else v for k, v in run.items()})
            for run in content["runs"]
        ]
        suite = Suite.model_validate(content["suite"])
        seconds, workers = content["seconds"], content["workers"]
        for name, value in (("seconds", seconds), ("workers", workers)):
            if value is not None and not (type(value) in (int, float) and 0 <= value < 1e12):
                raise ValueError(f"{name} is {value!r}")
        hashes = {str(key): str(value) for key, value in content.get("records", {}).items()}
        return Manifest(suite, tuple(runs), seconds, workers, hashes, version)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, MobmanError) as error:
        raise MobmanError(
            f"{path} is not whole ({type(error).__name__}: {error}). {_ADVICE}"
        ) from error
