"""``suite.json``: what a folder of results was asked for."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from mobman.benchmark.run_spec import RunSpec
from mobman.benchmark.suite import Suite
from mobman.errors import MobmanError
from mobman.files import temporary_beside

SCHEMA_VERSION = 2
NAME = "suite.json"
_ADVICE = (
    "Run the suite again, into another folder, or into this one without that file: runs that are there "
    "and still fit are used"
)


@dataclass(frozen=True)
class Manifest:
    """What a suite asked for, and how long it took."""

    suite: Suite
    runs: tuple[RunSpec, ...]
    """In the suite's order."""
    seconds: float | None = None
    """How long its runs took altogether (s); None if none was done."""
    workers: int | None = None
    """With how many workers at last."""

    def write(self, folder: Path) -> None:
        """
        Raises:
            OSError: If it cannot be written; one that is there is left as it was.
        """
        shared = _Shared()
        content = {
            "schema_version": SCHEMA_VERSION,
            "suite": self.suite.model_dump(mode="json", by_alias=True),
            "seconds": self.seconds,
            "workers": self.workers,
            "runs": [shared.fold(asdict(run)) for run in self.runs],
            "shared": shared.parts,
        }
        path = folder / NAME
        temporary = temporary_beside(path)
        try:
            temporary.write_text(json.dumps(content), encoding="utf-8")
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def read_manifest(folder: Path) -> Manifest:
    """The manifest of a folder.

    Raises:
        MobmanError: If there is none, or it is not whole, or of another schema.
    """
    path = folder / NAME
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MobmanError(f"{folder} holds no results: there is no {NAME}") from error
    except NotADirectoryError as error:
        raise MobmanError(f"{folder} is no folder of results: it is a file") from error
    except OSError as error:
        raise MobmanError(f"cannot read {path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise MobmanError(f"cannot read {path}: it is not JSON ({error}). {_ADVICE}") from error
    version = content.get("schema_version") if isinstance(content, dict) else None
    if version != SCHEMA_VERSION:
        raise MobmanError(
            f"{path} has schema version {version}; this mobman reads version {SCHEMA_VERSION}. {_ADVICE}"
        )
    try:
        parts = content["shared"]
        runs = [RunSpec(**_unfold(run, parts)) for run in content["runs"]]
        suite = Suite.model_validate(content["suite"])
        return Manifest(suite, tuple(runs), content["seconds"], content["workers"])
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, MobmanError) as error:
        raise MobmanError(
            f"{path} is not whole ({type(error).__name__}: {error}). {_ADVICE}"
        ) from error


class _Shared:
    """Tables that thousands of runs have in common, each kept once."""

    def __init__(self) -> None:
        self.parts: list[Any] = []
        self._places: dict[str, int] = {}

    def fold(self, run: dict[str, Any]) -> dict[str, Any]:
        """A run with the places of its tables instead of these."""
        return {
            key: self._place(value) if isinstance(value, dict) else value
            for key, value in run.items()
        }

    def _place(self, part: dict[str, Any]) -> int:
        text = json.dumps(part, sort_keys=True, default=str)
        if text not in self._places:
            self._places[text] = len(self.parts)
            self.parts.append(json.loads(text))
        return self._places[text]


_TABLES = {field.name for field in fields(RunSpec) if str(field.type).startswith("dict")}


def _unfold(run: dict[str, Any], parts: list[Any]) -> dict[str, Any]:
    return {key: parts[value] if key in _TABLES else value for key, value in run.items()}
