"""The layout of a record's file: what is where, in which units, with which coordinates.

Making the places costs HDF5 more than filling them does, and most records of a suite have the same ones:
an empty file is made once for each layout.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import h5py
import numpy as np

from mobman.simulation.record import Record
from mobman.simulation.record_chunks import chunk_shape

SCHEMA_VERSION = 2

FIELDS: dict[str, tuple[str, str, str, str]] = {
    # place in the file: field, axis of its columns, units, description
    "q": ("q", "joint", "m or rad", "configuration, platform and arm"),
    "z": ("z", "velocity", "1/s of its coordinate", "reduced velocity (alpha, y')"),
    "torque": (
        "torque",
        "velocity",
        "N m or N",
        "commanded torque v, held from this tick to the next",
    ),
    "tip/position": ("tip_position", "axis", "m", "task coordinates of the tip, f_e"),
    "tip/desired": ("tip_desired", "axis", "m", "desired trajectory p_d"),
    "error/task": ("task_error", "axis", "m", "e^e = f_e - p_d"),
    "error/auxiliary": ("auxiliary_error", "auxiliary_component", "1", "e^a = f_a of (11)"),
    "compute_time": ("compute_time", "", "s", "time that the controller took for this tick"),
}
TEXTS = (
    "status",
    "message",
    "robot",
    "controller",
    "task",
    "scenario",
    "urdf_sha256",
    "state_sha256",
    "created",
)
DICTIONARIES = ("spec", "settings", "versions", "machine")

_SIGNALS = {
    "sliding/s": ("m/s^2", "sliding variable of the kinematic stage, (31)"),
    "torque_applied": ("N m or N", "torque that acts from this tick to the next"),
    "sliding/S": ("1/s^2 of its coordinate", "sliding variable of the dynamic stage, (51)"),
}
_DIMENSION_ONLY = "This is a netCDF dimension but not a netCDF variable. %10d"
"""What netCDF names a dimension without coordinates."""
_LARGEST_IN_HEADER = 255
"""Attributes of a group that stand in its header; beyond, HDF5 makes a slower table of them."""

_names = itertools.count()


@dataclass(frozen=True)
class Layout:
    """All that the places in a record's file depend on."""

    shapes: tuple[tuple[str, tuple[int, ...]], ...]
    """Of the samples, by place; all but ``t``, which has the first axis."""
    signals: tuple[str, ...]
    joint_names: tuple[str, ...]
    velocity_names: tuple[str, ...]
    metrics: tuple[str, ...]
    urdf: tuple[tuple[str, bytes], ...]
    rows: int
    compression: int


def layout_of(record: Record, rows: int, compression: int) -> Layout:
    """The layout of a record of which so many samples are kept."""
    shapes = {place: getattr(record, field).shape for place, (field, *_) in FIELDS.items()}
    shapes |= {place: np.shape(values) for place, values in record.signals.items()}
    return Layout(
        shapes=tuple((place, (rows, *shape[1:])) for place, shape in shapes.items()),
        signals=tuple(record.signals),
        joint_names=tuple(record.joint_names),
        velocity_names=tuple(record.velocity_names),
        metrics=tuple(record.metrics),
        urdf=tuple(record.urdf.items()),
        rows=rows,
        compression=compression,
    )


def open_in_memory(image: bytes | None = None) -> h5py.h5f.FileID:
    """A file in memory, new or with a content; it is never on disk."""
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fapl_core(1 << 18, False)
    # readers since HDF5 1.10 (2016); smaller indices of chunks than before
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    # of a name of its own: HDF5 takes two files of one name for the same
    name = f"mobman-{next(_names)}".encode()
    if image is not None:
        access.set_file_image(image)
        return h5py.h5f.open(name, h5py.h5f.ACC_RDWR, access)
    creation = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    creation.set_obj_track_times(False)  # the same record makes the same bytes, whenever
    creation.set_attr_phase_change(_LARGEST_IN_HEADER, 0)
    return h5py.h5f.create(name, h5py.h5f.ACC_TRUNC, creation, access)


@lru_cache(maxsize=32)
def empty_file(layout: Layout) -> bytes:
    """The content of a file with all places, whose samples, texts and metrics are not there yet."""
    with h5py.File(open_in_memory()) as file:
        _fill(file, layout)
        file.flush()
        image: bytes = file.id.get_file_image()
    return image


def _fill(file: h5py.File, layout: Layout) -> None:
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs.create("seed", 0, dtype=np.int64)
    file.attrs.create("decimation", 0, dtype=np.int64)
    for name in (*TEXTS, *(f"{name}_json" for name in DICTIONARIES)):
        file.attrs[name] = ""
    file.attrs["signals"] = np.array(layout.signals, dtype=h5py.string_dtype())
    shapes = dict(layout.shapes)
    time = _dataset(file, layout, "t", (layout.rows,), "s", "time")
    time.make_scale("t")
    _axis(file, "joint", layout.joint_names, "", "coordinates of q")
    _axis(file, "velocity", layout.velocity_names, "", "components of z, and the motors")
    _axis(file, "axis", ["x", "y", "z"][: shapes["error/task"][1]], "", "world axes")
    components = np.arange(shapes["error/auxiliary"][1])
    _axis(file, "auxiliary_component", components, "1", "components of e^a")
    for place, (_, axis, units, description) in FIELDS.items():
        samples = _dataset(file, layout, place, shapes[place], units, description)
        _attach(file, samples, [axis] if axis else [])
    for place in layout.signals:
        units, description = _SIGNALS.get(place, ("", "signal of the controller"))
        samples = _dataset(file, layout, place, shapes[place], units, description)
        _attach(file, samples, _axes_of_signal(file, place, shapes[place]))
    for place, content in layout.urdf:
        _urdf(file.create_group(f"urdf/{place.rpartition('/')[0]}"), place, content)
    metrics = _group_of_attributes(file, "metrics")
    for name in layout.metrics:
        metrics.attrs[name] = np.nan


def _group_of_attributes(file: h5py.File, name: str) -> h5py.Group:
    creation = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
    creation.set_obj_track_times(False)
    creation.set_attr_phase_change(_LARGEST_IN_HEADER, 0)
    return h5py.Group(h5py.h5g.create(file.id, name.encode(), gcpl=creation))


def _dataset(
    file: h5py.File,
    layout: Layout,
    place: str,
    shape: tuple[int, ...],
    units: str,
    description: str,
) -> h5py.Dataset:
    options: dict[str, Any] = {}
    if layout.compression and np.prod(shape):
        options = {
            "chunks": chunk_shape(shape),
            "shuffle": True,
            "compression": "gzip",
            "compression_opts": layout.compression,
        }
    dataset = file.create_dataset(place, shape=shape, dtype="<f8", **options)
    dataset.attrs["units"] = units
    dataset.attrs["description"] = description
    return dataset


def _axis(file: h5py.File, name: str, values: Any, units: str, description: str) -> None:
    kind = None if isinstance(values, np.ndarray) else h5py.string_dtype()
    scale = file.create_dataset(name, data=values, dtype=kind)
    scale.attrs["units"] = units
    scale.attrs["description"] = description
    scale.make_scale(name)


def _axes_of_signal(file: h5py.File, place: str, shape: tuple[int, ...]) -> list[str]:
    names = []
    for i, size in enumerate(shape[1:]):
        names.append(place.replace("/", "_") + "_component" + (f"_{i + 1}" if i else ""))
        _axis(file, names[-1], np.arange(size), "1", f"components of {place}")
    return names


def _attach(file: h5py.File, samples: h5py.Dataset, axes: Sequence[str]) -> None:
    samples.dims[0].attach_scale(file["t"])
    for i, axis in enumerate(axes, start=1):
        samples.dims[i].attach_scale(file[axis])


def _urdf(group: h5py.Group, place: str, content: bytes) -> None:
    """A file's bytes; readers of netCDF want a name for the axis, too."""
    values = np.frombuffer(content, dtype=np.uint8)
    data = group.create_dataset(
        place.rpartition("/")[2], data=values, compression="gzip", compression_opts=9
    )
    data.attrs["units"] = ""
    data.attrs["description"] = "URDF file, byte by byte"
    # allocated when it is written, which it never is
    byte = group.create_dataset("byte", shape=values.shape, dtype=">f4")
    byte.make_scale(_DIMENSION_ONLY % len(values))
    data.dims[0].attach_scale(byte)
