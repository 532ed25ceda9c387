"""Reading a record's HDF5 file, whoever made it: each part is checked before it is read.

These functions run in the helper process of :mod:`mobman.isolation`. A record holds its data itself:
links, external storage and virtual datasets are refused, and so is a size that its file cannot have.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mobman.arrays import Array
from mobman.errors import RecordError
from mobman.hdf5 import own_dataset, own_part
from mobman.simulation import record_file as layout
from mobman.simulation.record_file import (
    DICTIONARIES,
    FIELDS,
    OPTIONAL,
    ORIENTATION,
    SCHEMA_VERSION,
)

_DEEPEST = 50  # levels of what is described
_LONGEST = 20_000_000  # characters of a text
_MOST_NAMES = 10_000  # of joints, metrics and signals
_URDF_NAME = re.compile(r"(plant/)?[0-9]{1,4}/(?!\.{1,2}$)[^/\0]{1,255}")
# samples that are finite in every run, and those that are in a run that went to its end
_FINITE, _FINITE_IF_OK = {"q", "z"}, {"tip/position", "tip/desired", "error/task"}


def read(path: str, shown: str, whole: bool) -> dict[str, Any]:
    """The content of a record: texts by name, dictionaries as JSON text, ``seed``, ``decimation``,
    ``metrics``; and if ``whole``, in addition ``t``, ``fields``, ``signals``, ``joint_names``,
    ``velocity_names``, ``urdf``. The path is absolute, and ``shown`` in messages. RecordError if the
    file is not a record of this schema, not whole, or not what a record may be."""
    try:
        with h5py.File(path, "r") as file:
            _check_version(file.attrs, shown)
            reader = _Reader(file, Path(path).stat().st_size)
            return reader.head() | (reader.samples() if whole else {})
    except OSError as error:
        text = " ".join(str(error).split())
        raise RecordError(
            f"{shown} is not a readable HDF5 file: it is damaged or cut off ({text}); allowed: a record "
            "that mobman wrote"
        ) from error
    except (KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
        raise RecordError(f"{shown} is not a whole record: {' '.join(text.split())}") from error


def _check_version(attributes: h5py.AttributeManager, shown: str) -> None:
    """Raise RecordError if the file is of another schema."""
    if "schema_version" not in attributes:
        raise RecordError(
            f"{shown} is an HDF5 file, but not a mobman record (no schema_version); allowed: a "
            f"record of schema version {SCHEMA_VERSION}"
        )
    version = attributes["schema_version"]
    if isinstance(version, np.ndarray):
        version = "of several numbers"
    elif version in (SCHEMA_VERSION, *layout.EARLIER):
        return
    advice = "mobman did not write it"
    if isinstance(version, (int, np.integer)) and version > 0:
        later = version > SCHEMA_VERSION
        advice = "a later mobman wrote it; install that" if later else "run it again"
    raise RecordError(
        f"{shown} has schema version {version}; this mobman reads version {SCHEMA_VERSION}: {advice}"
    )


def _require(fine: bool, otherwise: str) -> None:
    if not fine:
        raise ValueError(otherwise)


def _require_finite(place: str, values: Array) -> None:
    _require(bool(np.all(np.isfinite(values))), f"{place} has entries that are not finite")


class _Reader:
    """Checks and reads the parts of an open file, of a size (bytes)."""

    def __init__(self, file: h5py.File, size: int) -> None:
        self._file, self._attributes = file, file.attrs
        self._left = self._bound = layout.most_bytes(size)

    def head(self) -> dict[str, Any]:
        """Everything but the samples."""
        found: dict[str, Any] = {name: self._text(name) for name in layout.TEXTS}
        for name in (*DICTIONARIES, *OPTIONAL):
            key = f"{name}_json"
            left_out = name in OPTIONAL and key not in self._attributes
            found[key] = "{}" if left_out else self._json(key)
        for key in ("versions_json", "machine_json"):
            texts = all(isinstance(value, str) for value in json.loads(found[key]).values())
            _require(texts, f"its attribute {key!r} has entries that are not text")
        for name in ("seed", "decimation"):
            found[name] = int(self._attribute(name, np.integer, "whole number"))
        every = found["decimation"]
        _require(every >= 1, f"its attribute 'decimation' is {every}; allowed: from 1")
        return {**found, "metrics": self._metrics()}

    def samples(self) -> dict[str, Any]:
        """The samples, their names, and the URDFs."""
        ok = self._text("status") == "ok"
        joints, velocities = self._names("joint"), self._names("velocity")
        t = self._samples("t", (None,))
        _require(len(t) > 0, "t has no times")
        _require_finite("t", t)
        rows = len(t)
        columns = {"joint": (len(joints),), "velocity": (len(velocities),), "": ()}
        fields: dict[str, Array] = {}
        tip = own_part(self._file, "tip")
        oriented = isinstance(tip, h5py.h5g.GroupID) and b"orientation" in tip
        for place, about in FIELDS.items():
            if place in ORIENTATION and not oriented:
                continue
            found = self._samples(place, (rows, *columns.get(about.axis, (None,))))
            if place in _FINITE or (ok and place in _FINITE_IF_OK):
                _require_finite(place, found)
            fields[about.field] = found
        position, desired = (fields[name].shape for name in ("tip_position", "tip_desired"))
        _require(
            position == desired, f"tip/desired has shape {desired}, and tip/position {position}"
        )
        if oriented:
            turned, wanted = (fields[about.field].shape for about in ORIENTATION.values())
            error = fields["task_error"].shape
            _require(
                turned == wanted and error[1] == {4: 6, 3: 5}.get(turned[1], 0),
                f"tip/orientation has shape {turned}, tip/desired_orientation {wanted}, and "
                f"error/task {error}",
            )
        return {
            "t": t,
            "fields": fields,
            "signals": {name: self._samples(name, (rows, ...)) for name in self._signals()},
            "joint_names": joints,
            "velocity_names": velocities,
            "urdf": dict(self._urdfs()),
        }

    # Attributes ----------------------------------------------------------------------------------

    def _attribute(self, name: str, kind: type, what: str) -> Any:
        """An attribute's value of a type, which messages call ``what``."""
        _require(name in self._attributes, f"its attribute {name!r} is missing")
        value = self._attributes[name]
        _require(isinstance(value, kind), f"its attribute {name!r} is no {what}")
        return value

    def _text(self, name: str) -> str:
        text = _unicode(self._attribute(name, str, "text"), f"its attribute {name!r}")
        _require(len(text) <= _LONGEST, f"its attribute {name!r} has {len(text)} characters")
        return text

    def _json(self, name: str) -> str:
        text, content, deep = self._text(name), {}, True
        try:
            content = json.loads(text)
            deep = _depth(content) > _DEEPEST
        except RecursionError:
            pass
        except ValueError as error:
            raise ValueError(f"its attribute {name!r} is not JSON: {error}") from error
        _require(isinstance(content, dict), f"its attribute {name!r} is no dictionary")
        _require(not deep, f"its attribute {name!r} is nested too deeply")
        return text

    def _signals(self) -> list[str]:
        names = self._attribute("signals", np.ndarray, "list of names").tolist()
        is_list = isinstance(names, list) and len(names) <= _MOST_NAMES
        is_list = is_list and all(isinstance(name, str) for name in names)
        _require(is_list, "its attribute 'signals' is no list of names")
        for name in names:
            own = _unicode(name, "a signal").partition("/")[0] in layout.OWN_PLACES
            _require(not own, f"its signal {name!r} has the name of another part of a record")
        return [str(name) for name in names]

    def _metrics(self) -> dict[str, float]:
        """Metrics, read by HDF5's own functions, since indices of suites read many files."""
        group = own_part(self._file, "metrics")
        _require(isinstance(group, h5py.h5g.GroupID), "metrics is not a group")
        count = h5py.h5a.get_num_attrs(group)
        _require(count <= _MOST_NAMES, f"it has {count} metrics; allowed: {_MOST_NAMES}")
        metrics = {}
        for index in range(count):
            attribute = h5py.h5a.open(group, index=index)
            name = attribute.name.decode()
            number = attribute.shape == () and attribute.dtype.kind in "fiu"
            _require(number, f"its metric {name!r} is no number")
            value = np.empty((), dtype=float)
            attribute.read(value)
            fine = name not in ("", ".", "..") and "/" not in name
            _require(fine, f"its metric {name!r} has a name that no dataset can have")
            metrics[name] = float(value)
        return metrics

    # Datasets ------------------------------------------------------------------------------------

    def _names(self, place: str) -> list[str]:
        dataset = self._dataset(place)
        shape, kind = dataset.shape, dataset.dtype
        is_list = len(shape) == 1 and shape[0] <= _MOST_NAMES
        _require(is_list, f"{place} has shape {shape}; allowed: a list of names")
        is_text = h5py.check_string_dtype(kind) is not None
        _require(is_text, f"{place} has entries of type {kind}; allowed: text")
        return [_unicode(str(name), place) for name in dataset.asstr()[()]]

    def _samples(self, place: str, shape: tuple[Any, ...]) -> Array:
        """Samples of a shape: None stands for any size of an axis, a last ``...`` for any axes."""
        dataset = self._dataset(place)
        sizes = shape[:-1] if shape[-1] is ... else shape
        found, kind = dataset.shape, dataset.dtype
        fits = len(found) >= len(sizes) if shape[-1] is ... else len(found) == len(sizes)
        if not fits or any(a not in (None, b) for a, b in zip(sizes, found, strict=False)):
            times = found[:1] == sizes[:1] or sizes[0] is None
            _require(times, f"{place} has shape {found} for {sizes[0]} times")
            needed = ", ".join("any" if size in (None, ...) else str(size) for size in shape)
            raise ValueError(f"{place} has shape {found}; allowed: ({needed})")
        floats = kind.kind == "f" and kind.itemsize <= 8
        _require(floats, f"{place} has entries of type {kind}; allowed: 64-bit floats")
        values: Array = dataset[()].astype("<f8", copy=False)
        return values

    def _urdfs(self) -> Iterator[tuple[str, bytes]]:
        for place in self._below("urdf", 3) if "urdf" in self._file else ():
            name = place.removeprefix("urdf/")
            if name.endswith("/byte"):  # its axis
                continue
            fine = _URDF_NAME.fullmatch(name) is not None
            _require(fine, f"{place} is no place of a URDF; allowed: urdf/NUMBER/NAME")
            dataset = self._dataset(place)
            fine = dataset.dtype == np.uint8 and len(dataset.shape) == 1
            _require(fine, f"{place} has entries of type {dataset.dtype}; allowed: bytes")
            yield name, dataset[()].tobytes()

    def _below(self, place: str, levels: int) -> Iterator[str]:
        """The datasets in a group and in those below it."""
        group = own_part(self._file, place)
        if isinstance(group, h5py.h5d.DatasetID):
            yield place
            return
        few = levels > 0 and group.get_num_objs() <= _MOST_NAMES
        _require(few, f"{place} holds more than the URDFs of a robot")
        for name in list(group):
            yield from self._below(f"{place}/{name.decode()}", levels - 1)

    def _dataset(self, place: str) -> h5py.Dataset:
        """A dataset that holds its data itself, and needs no more memory than what is left for this
        file."""
        dataset, size = own_dataset(self._file, place)
        _require(
            size <= self._left,
            f"{place} has shape {dataset.shape}, {size / 1e6:.3g} MB; allowed in a file of this "
            f"size: {self._bound / 1e6:.3g} MB altogether",
        )
        self._left -= size
        return dataset


def _depth(value: Any) -> int:
    """Levels of lists and dictionaries in a value of JSON."""
    parts = value.values() if isinstance(value, dict) else value
    return 1 + max(map(_depth, parts), default=0) if isinstance(value, (dict, list)) else 0


def _unicode(text: str, where: str) -> str:
    """The text, unless it has what no file or terminal can be given."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise ValueError(f"{where} is not valid UTF-8") from error
    return text
