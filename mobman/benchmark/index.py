"""``index.h5``: a link to every record of a folder, and a table of what they are."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mobman.errors import MobmanError
from mobman.files import temporary_beside
from mobman.simulation.record import RecordSummary
from mobman.simulation.run_spec import RunSpec

_SCHEMA_VERSION = 2


def write_index(path: Path, rows: Sequence[tuple[RunSpec, RecordSummary]]) -> Path:
    """Write the index of a folder: whole, or not at all.

    Args:
        path: The file; the records are in the folder ``runs`` beside it.
        rows: The runs that have a record.

    Raises:
        MobmanError: If it cannot be written.
    """
    temporary = temporary_beside(path)
    try:
        with h5py.File(temporary, "w") as file:
            _fill(file, rows)
        os.replace(temporary, path)
    except OSError as error:
        raise MobmanError(f"cannot write {path}: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)
    return path


def _fill(file: h5py.File, rows: Sequence[tuple[RunSpec, RecordSummary]]) -> None:
    file.attrs["schema_version"] = _SCHEMA_VERSION
    links = file.create_group("runs")
    table = file.create_group("table")
    text = h5py.string_dtype()
    ids = [run.run_id for run, _ in rows]
    for run_id in ids:
        links[run_id] = h5py.ExternalLink(f"runs/{run_id}.h5", "/")
    columns: dict[str, list[str]] = {
        "run_id": ids,
        "label": [run.label for run, _ in rows],
        "robot": [run.robot for run, _ in rows],
        "task": [run.task for run, _ in rows],
        "scenario": [run.scenario["name"] for run, _ in rows],
        "family": [run.family for run, _ in rows],
        "status": [record.status for _, record in rows],
        "message": [record.message for _, record in rows],
        "state_sha256": [record.state_sha256 for _, record in rows],
        "spec_json": [json.dumps(run.as_dict(), sort_keys=True, default=str) for run, _ in rows],
    }
    for name, values in columns.items():
        table.create_dataset(name, data=values, dtype=text)
    numbers: dict[str, type] = {"seed": int, "dt": float, "duration": float}
    for name, kind in numbers.items():
        column: Any = np.array([getattr(run, name) for run, _ in rows], dtype=kind)
        table.create_dataset(name, data=column)
    metrics = table.create_group("metrics")
    for name in sorted({name for _, record in rows for name in record.metrics}):
        metrics.create_dataset(
            name, data=[record.metrics.get(name, np.nan) for _, record in rows], dtype=float
        )
