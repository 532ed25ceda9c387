"""Reading a record's HDF5 file, whoever made it: each part is checked before it is read.

These functions run in the helper process of :mod:`mobman.isolation`. A record holds its data itself:
links, external storage and virtual datasets are refused, and so is a size that its file cannot have.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mobman.arrays import Array
from mobman.errors import RecordError
from mobman.simulation.record_file import (
    DICTIONARIES,
    EARLIER,
    FIELDS,
    OPTIONAL,
    ORIENTATION,
    OWN_PLACES,
    SCHEMA_VERSION,
    TEXTS,
    most_bytes,
)

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_DEEPEST = 50  # levels of what is described
_LONGEST = 20_000_000  # characters of a text
_MOST_NAMES = 10_000  # of joints, metrics and signals
_URDF_NAME = re.compile(r"(plant/)?[0-9]{1,4}/(?!\.{1,2}$)[^/\0]{1,255}")
_LINKS = {h5py.h5l.TYPE_SOFT: "a soft link", h5py.h5l.TYPE_EXTERNAL: "an external link"}
# samples that are finite in every run, and those that are in a run that went to its end
_FINITE, _FINITE_IF_OK = {"q", "z"}, {"tip/position", "tip/desired", "error/task"}


def read(path: str, shown: str, whole: bool) -> dict[str, Any]:
    """The content of a record: texts by name, dictionaries as JSON text, ``seed``, ``decimation``,
    ``metrics``; and if ``whole``, in addition ``t``, ``fields``, ``signals``, ``joint_names``,
    ``velocity_names``, ``urdf``.

    Args:
        path: The file, absolute.
        shown: Its name in messages.
        whole: False to leave its samples.

    Raises:
        RecordError: If it is not a record of this schema, not whole, or not what a record may be.
    """
    try:
        with h5py.File(path, "r") as file:
            reader = _Reader(file, Path(path).stat().st_size)
            reader.check_version(shown)
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


class _Reader:
    """Checks and reads the parts of an open file.

    Args:
        file: The file.
        size: Of the file (bytes).
    """

    def __init__(self, file: h5py.File, size: int) -> None:
        self._file, self._attributes = file, file.attrs
        self._left = most_bytes(size)
        self._bound = self._left

    def check_version(self, shown: str) -> None:
        """
        Raises:
            RecordError: If the file is of another schema.
        """
        if "schema_version" not in self._attributes:
            raise RecordError(
                f"{shown} is an HDF5 file, but not a mobman record (no schema_version); allowed: a "
                f"record of schema version {SCHEMA_VERSION}"
            )
        one = self._attributes.get_id("schema_version").shape == ()
        version = self._attributes["schema_version"] if one else "of several numbers"
        if one and version in (SCHEMA_VERSION, *EARLIER):
            return
        advice = "mobman did not write it"
        if isinstance(version, (int, np.integer)) and version > 0:
            older = version < SCHEMA_VERSION
            advice = "run it again" if older else "a later mobman wrote it; install that"
        raise RecordError(
            f"{shown} has schema version {version}; this mobman reads version {SCHEMA_VERSION}: {advice}"
        )

    def head(self) -> dict[str, Any]:
        """Everything but the samples."""
        found: dict[str, Any] = {name: self._text(name) for name in TEXTS}
        found |= {f"{name}_json": self._json(f"{name}_json") for name in DICTIONARIES}
        found |= {
            f"{name}_json": self._json(f"{name}_json")
            if f"{name}_json" in self._attributes
            else "{}"
            for name in OPTIONAL
        }
        for name in ("versions", "machine"):
            values = json.loads(found[f"{name}_json"]).values()
            if not all(isinstance(value, str) for value in values):
                raise TypeError(f"its attribute '{name}_json' has entries that are not text")
        found["seed"] = self._integer("seed")
        found["decimation"] = self._integer("decimation")
        if found["decimation"] < 1:
            raise ValueError(
                f"its attribute 'decimation' is {found['decimation']}; allowed: from 1"
            )
        found["metrics"] = self._metrics()
        return found

    def samples(self) -> dict[str, Any]:
        """The samples, their names, and the URDFs."""
        ok = self._text("status") == "ok"
        joints, velocities = self._names("joint"), self._names("velocity")
        t = self._samples("t", (None,))
        if not len(t) or not np.all(np.isfinite(t)):
            raise ValueError("t has entries that are not finite" if len(t) else "t has no times")
        rows = len(t)
        nq, nz = (len(joints),), (len(velocities),)
        columns: dict[str, tuple[int, ...]] = {"q": nq, "z": nz, "torque": nz, "compute_time": ()}
        fields: dict[str, Array] = {}
        places = dict(FIELDS)
        if isinstance(tip := self._open("tip"), h5py.h5g.GroupID) and b"orientation" in tip:
            places |= ORIENTATION
        for place, (field, *_) in places.items():
            found = self._samples(place, (rows, *columns.get(place, (None,))))
            must_be_finite = place in _FINITE or (ok and place in _FINITE_IF_OK)
            if must_be_finite and not np.all(np.isfinite(found)):
                raise ValueError(f"{place} has entries that are not finite")
            fields[field] = found
        if fields["tip_position"].shape != fields["tip_desired"].shape:
            raise ValueError(
                f"tip/desired has shape {fields['tip_desired'].shape}, and tip/position "
                f"{fields['tip_position'].shape}"
            )
        turned = [fields[field].shape for field, *_ in ORIENTATION.values() if field in fields]
        if turned:
            m = {4: 6, 3: 5}.get(turned[0][1], 0)
            if turned[0] != turned[1] or fields["task_error"].shape[1] != m:
                raise ValueError(
                    f"tip/orientation has shape {turned[0]}, tip/desired_orientation {turned[1]}, and "
                    f"error/task {fields['task_error'].shape}"
                )
        return {
            "t": t,
            "fields": fields,
            "signals": {name: self._samples(name, (rows, ...)) for name in self._signals()},
            "joint_names": joints,
            "velocity_names": velocities,
            "urdf": dict(self._urdfs()),
        }

    def _attribute(self, name: str) -> h5py.h5a.AttrID:
        if name not in self._attributes:
            raise KeyError(f"its attribute {name!r} is missing")
        return self._attributes.get_id(name)

    def _text(self, name: str) -> str:
        found = self._attribute(name)
        if h5py.check_string_dtype(found.dtype) is None or found.shape != ():
            raise TypeError(f"its attribute {name!r} is no text")
        text = _unicode(str(self._attributes[name]), f"its attribute {name!r}")
        if len(text) > _LONGEST:
            raise ValueError(f"its attribute {name!r} has {len(text)} characters")
        return text

    def _json(self, name: str) -> str:
        text = self._text(name)
        try:
            content = json.loads(text)
        except RecursionError as error:
            raise ValueError(f"its attribute {name!r} is nested too deeply") from error
        except ValueError as error:
            raise ValueError(f"its attribute {name!r} is not JSON: {error}") from error
        if not isinstance(content, dict):
            raise TypeError(f"its attribute {name!r} is no dictionary")
        if _depth(content) > _DEEPEST:
            raise ValueError(f"its attribute {name!r} is nested too deeply")
        return text

    def _integer(self, name: str) -> int:
        found = self._attribute(name)
        if found.dtype.kind not in "iu" or found.shape != ():
            raise TypeError(f"its attribute {name!r} is no whole number")
        return int(self._attributes[name])

    def _signals(self) -> list[str]:
        found = self._attribute("signals")
        if len(found.shape) != 1 or found.shape[0] > _MOST_NAMES:
            raise TypeError("its attribute 'signals' is no list of names")
        if found.shape[0] == 0:
            return []
        if h5py.check_string_dtype(found.dtype) is None:
            raise TypeError("its attribute 'signals' is no list of names")
        names = [_unicode(str(name), "a signal") for name in self._attributes["signals"]]
        for name in names:
            if name.partition("/")[0] in OWN_PLACES:
                raise ValueError(f"its signal {name!r} has the name of another part of a record")
        return names

    def _metrics(self) -> dict[str, float]:
        """Metrics, read by HDF5's own functions, since indices of suites read many files."""
        group = self._open("metrics")
        if not isinstance(group, h5py.h5g.GroupID):
            raise TypeError("metrics is not a group")
        count = h5py.h5a.get_num_attrs(group)
        if count > _MOST_NAMES:
            raise ValueError(f"it has {count} metrics; allowed: {_MOST_NAMES}")
        metrics = {}
        for index in range(count):
            attribute = h5py.h5a.open(group, index=index)
            name = attribute.name.decode()
            if attribute.shape != () or attribute.dtype.kind not in "fiu":
                raise ValueError(f"its metric {name!r} is no number")
            value = np.empty((), dtype=float)
            attribute.read(value)
            if name in ("", ".", "..") or "/" in name:
                raise ValueError(f"its metric {name!r} has a name that no dataset can have")
            metrics[name] = float(value)
        return metrics

    def _names(self, place: str) -> list[str]:
        dataset = self._dataset(place)
        if len(dataset.shape) != 1 or dataset.shape[0] > _MOST_NAMES:
            raise ValueError(f"{place} has shape {dataset.shape}; allowed: a list of names")
        if h5py.check_string_dtype(dataset.dtype) is None:
            raise TypeError(f"{place} has entries of type {dataset.dtype}; allowed: text")
        return [_unicode(str(name), place) for name in dataset.asstr()[()]]

    def _samples(self, place: str, shape: tuple[Any, ...]) -> Array:
        """Samples of a shape: None stands for any size of an axis, a last ``...`` for any axes."""
        dataset = self._dataset(place)
        open_end = shape[-1] is ...
        sizes = shape[:-1] if open_end else shape
        found = dataset.shape
        fits = len(found) >= len(sizes) if open_end else len(found) == len(sizes)
        fits &= all(size in (None, own) for size, own in zip(sizes, found, strict=False))
        if not fits:
            if found[:1] != sizes[:1] and sizes[0] is not None:
                raise ValueError(f"{place} has shape {found} for {sizes[0]} times")
            needed = ", ".join("any" if size in (None, ...) else str(size) for size in shape)
            raise ValueError(f"{place} has shape {found}; allowed: ({needed})")
        if dataset.dtype.kind != "f" or dataset.dtype.itemsize > 8:
            raise TypeError(f"{place} has entries of type {dataset.dtype}; allowed: 64-bit floats")
        values: Array = dataset[()].astype("<f8", copy=False)
        return values

    def _urdfs(self) -> Iterator[tuple[str, bytes]]:
        if "urdf" not in self._file:
            return
        for place in self._below("urdf", 3):
            name = place.removeprefix("urdf/")
            if name.endswith("/byte"):  # its axis
                continue
            if not _URDF_NAME.fullmatch(name):
                raise ValueError(f"{place} is no place of a URDF; allowed: urdf/NUMBER/NAME")
            dataset = self._dataset(place)
            if dataset.dtype != np.uint8 or len(dataset.shape) != 1:
                raise TypeError(f"{place} has entries of type {dataset.dtype}; allowed: bytes")
            yield name, dataset[()].tobytes()

    def _below(self, place: str, levels: int) -> Iterator[str]:
        """The datasets in a group and in those below it."""
        group = self._open(place)
        if isinstance(group, h5py.h5d.DatasetID):
            yield place
            return
        if levels == 0 or group.get_num_objs() > _MOST_NAMES:
            raise ValueError(f"{place} holds more than the URDFs of a robot")
        for name in list(group):
            yield from self._below(f"{place}/{name.decode()}", levels - 1)

    def _open(self, place: str) -> h5py.h5g.GroupID | h5py.h5d.DatasetID:
        """A group or a dataset, reached by hard links alone.

        Raises:
            ValueError: If there is a link on the way.
        """
        found: Any = h5py.h5g.open(self._file.id, b"/")
        passed = ""
        for part in place.split("/"):
            passed = f"{passed}/{part}".lstrip("/")
            if not isinstance(found, h5py.h5g.GroupID) or part.encode() not in found:
                raise KeyError(f"{passed} is missing")
            kind = found.links.get_info(part.encode()).type
            if kind != h5py.h5l.TYPE_HARD:
                target = found.links.get_val(part.encode())
                raise ValueError(
                    f"{passed} is {_LINKS.get(kind, 'a link')} to {_decoded(target)}; a record holds "
                    "its data itself"
                )
            found = h5py.h5o.open(found, part.encode())
        return found

    def _dataset(self, place: str) -> h5py.Dataset:
        """A dataset that can be read without reading anything else, and without more memory than
        what is left for this file.

        Raises:
            KeyError: If it is missing.
            TypeError: If it is no dataset.
            ValueError: If it may not be read.
        """
        found = self._open(place)
        if not isinstance(found, h5py.h5d.DatasetID):
            raise TypeError(f"{place} is not a dataset")
        plan = found.get_create_plist()
        if plan.get_external_count():
            name = _decoded(plan.get_external(0)[0])
            raise ValueError(
                f"the values of {place} are in another file, {name}; a record holds its data itself"
            )
        if plan.get_layout() == h5py.h5d.VIRTUAL:
            raise ValueError(
                f"{place} is a virtual dataset, a view of other files; a record holds its data itself"
            )
        for index in range(plan.get_nfilters()):
            if plan.get_filter(index)[0] not in _FILTERS:
                raise ValueError(
                    f"{place} is stored by the filter {plan.get_filter(index)[0]}; allowed: gzip, "
                    "shuffle, fletcher32"
                )
        dataset = h5py.Dataset(found)
        if dataset.shape is None:
            raise ValueError(f"{place} is empty")
        size = math.prod(dataset.shape) * dataset.dtype.itemsize
        if plan.get_layout() == h5py.h5d.CHUNKED:
            # a chunk is held whole, whatever the shape is
            size = max(size, math.prod(plan.get_chunk()) * dataset.dtype.itemsize)
        if size > self._left:
            raise ValueError(
                f"{place} has shape {dataset.shape}, {size / 1e6:.3g} MB; allowed in a file of this "
                f"size: {self._bound / 1e6:.3g} MB altogether"
            )
        self._left -= size
        return dataset


def _depth(value: Any) -> int:
    """Levels of lists and dictionaries in a value of JSON."""
    parts = value.values() if isinstance(value, dict) else value
    return 1 + max(map(_depth, parts), default=0) if isinstance(value, (dict, list)) else 0


def _unicode(text: str, where: str) -> str:
    """The text.

    Raises:
        ValueError: If it has what no file or terminal can be given.
    """
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise ValueError(f"{where} is not valid UTF-8") from error
    return text


def _decoded(name: Any) -> str:
    parts = name if isinstance(name, tuple) else (name,)
    return ":".join(repr(part.decode("utf-8", errors="replace")) for part in parts)
