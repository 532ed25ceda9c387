"""Records as HDF5 files: one run a file, with units and named axes, readable by xarray."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from mobman.arrays import Array
from mobman.errors import RecordError, UsageError
from mobman.simulation.record import Record
from mobman.simulation.temporary import temporary_beside

SCHEMA_VERSION = 1

T = TypeVar("T")

_FIELDS: dict[str, tuple[str, str, str, str]] = {
    # place in the file: field, axis of its columns, units, description
    "q": ("q", "joint", "m or rad", "configuration, platform and arm"),
    "z": ("z", "velocity", "1/s of its coordinate", "reduced velocity (alpha, y')"),
    "torque": ("torque", "velocity", "N m or N", "torque v held from this tick to the next"),
    "tip/position": ("tip_position", "axis", "m", "task coordinates of the tip, f_e"),
    "tip/desired": ("tip_desired", "axis", "m", "desired trajectory p_d"),
    "error/task": ("task_error", "axis", "m", "e^e = f_e - p_d"),
    "error/auxiliary": ("auxiliary_error", "auxiliary_component", "1", "e^a = f_a of (11)"),
    "compute_time": ("compute_time", "", "s", "time that the controller took for this tick"),
}
_SIGNALS = {
    "sliding/s": ("m/s^2", "sliding variable of the kinematic stage, (31)"),
    "sliding/S": ("1/s^2 of its coordinate", "sliding variable of the dynamic stage, (51)"),
}
_TEXTS = ("status", "message", "robot", "controller", "task", "scenario", "urdf_sha256", "created")
_DICTIONARIES = ("spec", "settings", "versions")


def write_record(record: Record, path: Path, every: int = 1) -> Path:
    """See :meth:`Record.save`."""
    if every < 1:
        raise UsageError(f"every = {every!r}: must be a whole number, 1 or more")
    if not path.name:
        raise UsageError(f"{str(path)!r} is not the name of a file")
    temporary = temporary_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with h5py.File(temporary, "w") as file:
                _fill(file, record, every)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RecordError(f"cannot write the record {path}: {error}") from error
    return path


def read_record(path: Path) -> Record:
    """See :func:`mobman.load_record`."""
    return _read(path, _parse)


@dataclass(frozen=True)
class RecordSummary:
    """What a record's file says without its samples."""

    status: str
    message: str
    scenario: str
    metrics: dict[str, float]


def read_summary(path: Path) -> RecordSummary:
    """The summary of a record.

    Raises:
        RecordError: As for :func:`mobman.load_record`.
    """
    return _read(path, _summary)


def _read(path: Path, parse: Callable[[h5py.File, Path], T]) -> T:
    if not path.is_file():
        raise RecordError(f"there is no record {path}")
    try:
        with h5py.File(path, "r") as file:
            return parse(file, path)
    except OSError as error:
        raise RecordError(f"{path} is not a readable HDF5 file: {error}") from error
    except (KeyError, ValueError, TypeError) as error:
        raise RecordError(f"{path} is not a whole record: {error}") from error


def _fill(file: h5py.File, record: Record, every: int) -> None:
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs["seed"] = record.seed
    file.attrs["decimation"] = record.decimation * every
    for name in _TEXTS:
        file.attrs[name] = getattr(record, name)
    for name in _DICTIONARIES:
        file.attrs[f"{name}_json"] = json.dumps(
            getattr(record, name), sort_keys=True, default=_plain
        )
    # the last sample too: where a run ended early, it is the one that matters
    kept = np.unique(np.append(np.arange(0, len(record.t), every), len(record.t) - 1))
    m = record.task_error.shape[1]
    _axis(file, "t", record.t[kept], "s", "time")
    _axis(file, "joint", record.joint_names, "", "coordinates of q")
    _axis(file, "velocity", record.velocity_names, "", "components of z, and the motors")
    _axis(file, "axis", ["x", "y", "z"][:m], "", "world axes")
    components = np.arange(record.auxiliary_error.shape[1])
    _axis(file, "auxiliary_component", components, "1", "components of e^a")
    for place, (field, axis, units, description) in _FIELDS.items():
        _samples(file, place, getattr(record, field)[kept], axis, units, description)
    for place, samples in record.signals.items():
        units, description = _SIGNALS.get(place, ("", "signal of the controller"))
        axis = ""
        if samples.ndim == 2:
            axis = place.replace("/", "_") + "_component"
            _axis(file, axis, np.arange(samples.shape[1]), "1", f"components of {place}")
        _samples(file, place, samples[kept], axis, units, description)
    file.attrs["signals"] = list(record.signals)
    metrics = file.create_group("metrics")
    for name, value in record.metrics.items():
        metrics.attrs[name] = value


def _plain(value: Any) -> Any:
    """What JSON has no word for: numpy's numbers and arrays, and whatever a custom law reports."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)


def _axis(file: h5py.File, name: str, values: Any, units: str, description: str) -> None:
    kind = h5py.string_dtype() if isinstance(values, list) else None
    scale = file.create_dataset(name, data=values, dtype=kind)
    scale.attrs["units"] = units
    scale.attrs["description"] = description
    scale.make_scale(name)


def _samples(
    file: h5py.File, place: str, values: Array, axis: str, units: str, description: str
) -> None:
    dataset = file.create_dataset(
        place, data=values, compression="gzip", compression_opts=4, shuffle=True
    )
    dataset.attrs["units"] = units
    dataset.attrs["description"] = description
    dataset.dims[0].attach_scale(file["t"])
    if axis:
        dataset.dims[1].attach_scale(file[axis])


def _summary(file: h5py.File, path: Path) -> RecordSummary:
    _check_version(file, path)
    return RecordSummary(
        status=str(file.attrs["status"]),
        message=str(file.attrs["message"]),
        scenario=str(file.attrs["scenario"]),
        metrics={name: float(value) for name, value in file["metrics"].attrs.items()},
    )


def _check_version(file: h5py.File, path: Path) -> None:
    version = file.attrs.get("schema_version")
    if version is None:
        raise RecordError(f"{path} is an HDF5 file, but not a mobman record (no schema_version)")
    if version != SCHEMA_VERSION:
        raise RecordError(
            f"{path} has schema version {version}; this mobman reads version {SCHEMA_VERSION}"
        )


def _parse(file: h5py.File, path: Path) -> Record:
    _check_version(file, path)
    fields: dict[str, Any] = {field: file[place][()] for place, (field, *_) in _FIELDS.items()}
    fields |= {name: str(file.attrs[name]) for name in _TEXTS}
    fields |= {name: json.loads(file.attrs[f"{name}_json"]) for name in _DICTIONARIES}
    return Record(
        t=file["t"][()],
        **fields,
        signals={str(place): file[place][()] for place in file.attrs["signals"]},
        metrics={name: float(value) for name, value in file["metrics"].attrs.items()},
        seed=int(file.attrs["seed"]),
        joint_names=[name.decode() for name in file["joint"][()]],
        velocity_names=[name.decode() for name in file["velocity"][()]],
        decimation=int(file.attrs["decimation"]),
    )
