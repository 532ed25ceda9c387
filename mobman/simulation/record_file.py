"""Records as HDF5 files: one run a file, with units and named axes, readable by xarray."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import RecordError, UsageError
from mobman.isolation import Crash, helper, limits
from mobman.simulation.record import Record
from mobman.simulation.record_chunks import chunks
from mobman.simulation.record_layout import (
    DICTIONARIES,
    FIELDS,
    TEXTS,
    empty_file,
    layout_of,
    open_in_memory,
)
from mobman.simulation.temporary import temporary_beside

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_ALLOWED = "allowed: a record that mobman wrote"
# Processor time and memory that reading a record may take: a hundred times what it does take.
_SECONDS, _SECONDS_PER_MB = 2.0, 0.5
_MEGABYTES, _MEGABYTES_PER_MB = 256.0, 100.0


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
    content = _read("read_whole", path)
    head = content.pop("attributes")
    for name in DICTIONARIES:
        head[name] = json.loads(head.pop(f"{name}_json"))
    fields: dict[str, Any] = content.pop("fields")
    return Record(**content, **head, **fields)


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
    head = _read("read_head", path)
    shared = {name: _shared(head.pop(f"{name}_json")) for name in DICTIONARIES}
    kept = {field.name for field in fields(RecordSummary)}
    return RecordSummary(**{k: v for k, v in {**head, **shared}.items() if k in kept})


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


def _read(function: str, path: Path) -> Any:
    """The answer of a function of :mod:`mobman.simulation.record_reader`, which may crash or hang."""
    try:
        if not path.is_file():
            what = "it is a folder" if path.is_dir() else "it is no file"
            raise RecordError(f"there is no record {path}" + (f": {what}" if path.exists() else ""))
        with path.open("rb") as stream:
            start = stream.read(len(_SIGNATURE))
        if start != _SIGNATURE:
            reason = (
                f"it starts with {start!r}, not with HDF5's signature" if start else "it is empty"
            )
            raise RecordError(f"{path} is not a readable HDF5 file: {reason}; {_ALLOWED}")
        megabytes, seconds = limits(path, seconds=_SECONDS, per_megabyte=_SECONDS_PER_MB)
        return helper.call(
            f"mobman.simulation.record_reader:{function}",
            os.path.abspath(path),
            str(path),
            seconds=seconds,
            megabytes=_MEGABYTES + _MEGABYTES_PER_MB * megabytes,
        )
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        why = getattr(error, "strerror", None) or error
        raise RecordError(f"cannot read the record {path}: {why}") from error
    except Crash as error:
        raise RecordError(
            f"{path} is not a readable HDF5 file: it is damaged ({error}); {_ALLOWED}"
        ) from error


@lru_cache(maxsize=512)
def _shared(text: str) -> Mapping[str, Any]:
    """A dictionary; of thousands of records, few differ in theirs."""
    return MappingProxyType(json.loads(text))
