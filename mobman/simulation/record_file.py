"""Records as HDF5 files: one run a file, with units and named axes, readable by xarray."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

import h5py
import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import RecordError, UsageError
from mobman.simulation.record import Record
from mobman.simulation.record_chunks import chunks
from mobman.simulation.record_layout import (
    DICTIONARIES,
    FIELDS,
    SCHEMA_VERSION,
    TEXTS,
    empty_file,
    layout_of,
    open_in_memory,
)
from mobman.simulation.temporary import temporary_beside

T = TypeVar("T")

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def record_bytes(record: Record, *, every: int = 1, compression: int = 4) -> bytes:
    """See :meth:`Record.to_bytes`."""
    _check_number("every", every, 1, None)
    _check_number("compression", compression, 0, 9)
    kept = _kept(len(record.t), every)
    file = open_in_memory(empty_file(layout_of(record, len(kept), compression)))
    try:
        _fill(file, record, every, kept, compression)
        h5py.h5f.flush(file)
        content: bytes = file.get_file_image()
    finally:
        file.close()
    return content


def write_record(record: Record, path: Path, *, every: int = 1, compression: int = 4) -> Path:
    """See :meth:`Record.save`."""
    if not path.name:
        raise UsageError(f"{str(path)!r} is not the name of a file")
    content = record_bytes(record, every=every, compression=compression)
    temporary = temporary_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            temporary.write_bytes(content)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        if error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
            reason += f" ({len(content) / 1e6:.3g} MB are needed)"
        raise RecordError(f"cannot write the record {path}: {reason}") from error
    return path


def read_record(path: Path) -> Record:
    """See :func:`mobman.load_record`."""
    return _read(path, _parse)


@dataclass(frozen=True)
class RecordSummary:
    """What a record's file says without its samples."""

    status: str
    message: str
    robot: str
    controller: str
    task: str
    scenario: str
    seed: int
    state_sha256: str
    metrics: dict[str, float]
    settings: Mapping[str, Any]
    """Not to be changed: records with the same settings share them, as for what follows."""
    versions: Mapping[str, str]
    machine: Mapping[str, str]
    created: str


def read_summary(path: Path) -> RecordSummary:
    """The summary of a record.

    Raises:
        RecordError: As for :func:`mobman.load_record`.
    """
    return _read(path, _summary)


def _check_number(name: str, value: int, least: int, most: int | None) -> None:
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):
        allowed = f"{least} or more" if most is None else f"from {least} to {most}"
        raise UsageError(f"{name} = {value!r}: must be a whole number, {allowed}")


def _kept(count: int, every: int) -> Index:
    # the last sample too: where a run ended early, it is the one that matters
    rows = np.arange(0, count, every)
    return rows if (count - 1) % every == 0 else np.append(rows, count - 1)


def _fill(file: h5py.h5f.FileID, record: Record, every: int, kept: Index, compression: int) -> None:
    texts = {name: getattr(record, name) for name in TEXTS}
    for name in DICTIONARIES:
        texts[f"{name}_json"] = _json(getattr(record, name))
    for name, text in texts.items():
        h5py.h5a.open(file, name.encode()).write(_text(text))
    for name, number in {"seed": record.seed, "decimation": record.decimation * every}.items():
        h5py.h5a.open(file, name.encode()).write(np.array(number, dtype=np.int64))
    metrics = h5py.h5g.open(file, b"metrics")
    for name, value in record.metrics.items():
        h5py.h5a.open(metrics, name.encode()).write(np.array(value, dtype=float))
    samples = {place: getattr(record, field) for place, (field, *_) in FIELDS.items()}
    rows: Any = slice(None) if len(kept) == len(record.t) else kept
    for place, values in {"t": record.t, **samples, **record.signals}.items():
        _write(file, place, np.ascontiguousarray(values[rows], dtype="<f8"), compression)


def _write(file: h5py.h5f.FileID, place: str, values: Array, compression: int) -> None:
    dataset = h5py.h5d.open(file, place.encode())
    if not values.size:
        return
    if not compression:
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, values)
        return
    for start, content in chunks(values, compression):
        dataset.write_direct_chunk(start, content)


def _text(text: str) -> Any:
    """As HDF5 takes it: valid UTF-8 without NUL, whatever a message or a name has in it."""
    valid = text.replace("\0", "\\0").encode("utf-8", errors="backslashreplace").decode("utf-8")
    return np.array(valid, dtype=h5py.string_dtype())


def as_in_file(content: dict[str, Any]) -> dict[str, Any]:
    """What a dictionary of a record is once it was in a file: tuples are lists, for instance."""
    back: dict[str, Any] = json.loads(_json(content))
    return back


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, sort_keys=True, default=_plain)


def _plain(value: Any) -> Any:
    """What JSON has no word for: numpy's numbers and arrays, and whatever a custom law reports."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)


def _read(path: Path, parse: Callable[[h5py.File, Path], T]) -> T:
    try:
        if not path.is_file():
            what = "it is a folder" if path.is_dir() else "it is no file"
            raise RecordError(f"there is no record {path}" + (f": {what}" if path.exists() else ""))
        # before HDF5, whose messages are long
        with path.open("rb") as stream:
            start = stream.read(len(_SIGNATURE))
    except OSError as error:
        raise RecordError(f"cannot read the record {path}: {error.strerror}") from error
    try:
        with h5py.File(path, "r") as file:
            return parse(file, path)
    except OSError as error:
        raise RecordError(
            f"{path} is not a readable HDF5 file: {_reason(start, error)}; allowed: a record that "
            "mobman wrote"
        ) from error
    except (KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise RecordError(f"{path} is not a whole record: {reason}") from error


def _reason(start: bytes, error: OSError) -> str:
    if not start:
        return "it is empty"
    if start != _SIGNATURE:
        return f"it starts with {start!r}, not with HDF5's signature"
    text = " ".join(str(error).split())
    return f"it is damaged or cut off ({text})"


def _summary(file: h5py.File, path: Path) -> RecordSummary:
    _check_version(file, path)
    texts = (
        "status",
        "message",
        "robot",
        "controller",
        "task",
        "scenario",
        "state_sha256",
        "created",
    )
    return RecordSummary(
        seed=int(file.attrs["seed"]),
        metrics=_metrics(file),
        settings=_shared(_read_text(file, "settings_json")),
        versions=_shared(_read_text(file, "versions_json")),
        machine=_shared(_read_text(file, "machine_json")),
        **{name: _read_text(file, name) for name in texts},
    )


def _metrics(file: h5py.File) -> dict[str, float]:
    """By HDF5's own functions, since indices of suites read many files."""
    group, metrics = file["metrics"].id, {}
    for index in range(h5py.h5a.get_num_attrs(group)):
        attribute = h5py.h5a.open(group, index=index)
        value = np.empty((), dtype=float)
        if attribute.shape != ():
            raise ValueError(f"its metric {attribute.name.decode()!r} is no number")
        attribute.read(value)
        metrics[attribute.name.decode()] = float(value)
    return metrics


def _read_text(file: h5py.File, name: str) -> str:
    value = file.attrs[name]
    if not isinstance(value, str):
        raise TypeError(f"its attribute {name!r} is no text")
    return value


def _dictionary(file: h5py.File, name: str) -> dict[str, Any]:
    value = json.loads(_read_text(file, f"{name}_json"))
    if not isinstance(value, dict):
        raise TypeError(f"its attribute '{name}_json' is no dictionary")
    return value


@lru_cache(maxsize=512)
def _shared(text: str) -> Mapping[str, Any]:
    """A dictionary; of thousands of records, few differ in theirs."""
    return MappingProxyType(json.loads(text))


def _check_version(file: h5py.File, path: Path) -> None:
    version = file.attrs.get("schema_version")
    if version is None:
        raise RecordError(
            f"{path} is an HDF5 file, but not a mobman record (no schema_version); allowed: a record of "
            f"schema version {SCHEMA_VERSION}"
        )
    if np.ndim(version) != 0 or version != SCHEMA_VERSION:
        raise RecordError(
            f"{path} has schema version {version}; this mobman reads version {SCHEMA_VERSION}: "
            + _advice(version)
        )


def _advice(version: Any) -> str:
    if np.ndim(version) == 0 and isinstance(version, (int, np.integer)) and version > 0:
        older = version < SCHEMA_VERSION
        return "run it again" if older else "a later mobman wrote it; install that"
    return "mobman did not write it"


def _parse(file: h5py.File, path: Path) -> Record:
    _check_version(file, path)
    fields: dict[str, Any] = {field: file[place][()] for place, (field, *_) in FIELDS.items()}
    signals = {str(place): file[place][()] for place in file.attrs["signals"]}
    t = file["t"][()]
    for place, values in {**fields, **signals}.items():
        if np.shape(values)[:1] != t.shape:
            raise ValueError(f"{place} has shape {np.shape(values)} for {len(t)} times")
    fields |= {name: _read_text(file, name) for name in TEXTS}
    fields |= {name: _dictionary(file, name) for name in DICTIONARIES}
    return Record(
        t=t,
        **fields,
        signals=signals,
        metrics=_metrics(file),
        seed=int(file.attrs["seed"]),
        joint_names=[name.decode() for name in file["joint"][()]],
        velocity_names=[name.decode() for name in file["velocity"][()]],
        decimation=int(file.attrs["decimation"]),
        urdf=_urdf(file),
    )


def _urdf(file: h5py.File) -> dict[str, bytes]:
    found: dict[str, bytes] = {}

    def take(place: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not item.is_scale:
            found[place] = item[()].astype(np.uint8).tobytes()

    if "urdf" in file:
        file["urdf"].visititems(take)
    return found
