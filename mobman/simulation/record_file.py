"""Layout of a record's HDF5 file, and writing it: one run a file, readable by xarray.

Reading is in :mod:`mobman.simulation.record_reader`.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import h5py
import numpy as np

from mobman.errors import UsageError

SCHEMA_VERSION = 3
EARLIER = (2,)
"""Schemas that are read, too."""


class Place(NamedTuple):
    """A dataset of a record's file: names along an axis, or a row for each sample."""

    units: str
    description: str
    field: str = ""
    """Field of the record; empty of a signal."""
    axis: str = ""
    """Axis of its columns, where they have names."""


_TABLE = """
joint |  | coordinates of q
velocity |  | components of z, and the motors
axis |  | world axes
auxiliary_component | 1 | components of e^a
error/component |  | components of e^e
tip/component |  | components of orientations
q | m or rad | configuration, platform and arm | q | joint
z | 1/s of its coordinate | reduced velocity (alpha, y') | z | velocity
torque | N m or N | commanded torque v, held from this tick to the next | torque | velocity
tip/position | m | task coordinates of the tip, f_e | tip_position | axis
tip/desired | m | desired trajectory p_d | tip_desired | axis
error/task | m | e^e = f_e - p_d | task_error | error/component
error/auxiliary | 1 | e^a = f_a of (11) | auxiliary_error | auxiliary_component
compute_time | s | time that the controller took for this tick | compute_time
tip/orientation | 1 | orientation of the tip: unit quaternion w, x, y, z, or the axis that points \
| tip_orientation | tip/component
tip/desired_orientation | 1 | the orientation desired | tip_desired_orientation | tip/component
sliding/s | m/s^2 | sliding variable of the kinematic stage, (31)
torque_applied | N m or N | torque that acts from this tick to the next
sliding/S | 1/s^2 of its coordinate | sliding variable of the dynamic stage, (51)
sliding/g | m/s^3 | integrand of s, (31)
sliding/n | 1 | unit vector of the kinematic stage, (34)
sliding/v_ref | 1/s^2 of its coordinate | reference acceleration at the tick's end
sliding/v_ref_dot | 1/s^3 of its coordinate | its rate in the tick, (35)
sliding/G | 1/s^3 of its coordinate | integrand of S, (51)
sliding/n_d | 1 | unit vector of the dynamic stage, (55)
sliding/v_dot | N m/s or N/s | rate of v, (56) or (65), before a motor's limit
sliding/z_dot | 1/s^2 of its coordinate | z' as the law takes it
monitors/lambda_min_J | 1 | lambda_min(J J^T) of (22)
monitors/lambda_min_B | 1 | lambda_min(B B^T) of (54)
monitors/lambda_min_M_inverse | 1/(kg m^2) | lambda_min(M^-1) of (64)
monitors/regularity_kinematic | 1 | lambda_min(J J^T)/a
monitors/regularity_dynamic | 1 | lambda_min(B B^T)/A, or lambda_min(M^-1)/A'
monitors/left_kinematic | m/s^3 | left side of (41)
monitors/left_dynamic | N m/s, or 1/s^3 with (65) | left side of (53)
monitors/bound_kinematic | m/s^3 | W of (34), which bounds it: the larger of a tick's ends
monitors/bound_dynamic | N m/s, or 1/s^3 with (65) | chi of (53), or chi' of (66), likewise
monitors/margin_kinematic | 1 | c/a lambda_min(J J^T) (W + c_0) over the left side of (41)
monitors/margin_dynamic | 1 | C/A lambda_min(B B^T) (chi + C_0) over that of (53)
monitors/V_kinematic | m^2/s^4 | V of (36)
monitors/V_dynamic | N m/s^2, or 1/s^4 with (65) | V of (57), or V' of Theorem 4
monitors/V_rate_kinematic | m^2/s^5 | its rate off the manifold, else NaN
monitors/V_rate_dynamic | N m/s^3, or 1/s^5 with (65) | its rate off the manifold, else NaN
monitors/V_rate_bound_kinematic | m^2/s^5 | the most that (42) allows, -c c_0 |s|
monitors/V_rate_bound_dynamic | N m/s^3, or 1/s^5 with (65) | that of (63), -C C_0 |S|
monitors/reaching_kinematic | s | time to s = 0 at most, by Theorem 1
monitors/reaching_dynamic | s | time to S = 0 at most, by Theorem 2 or 4
monitors/unit_kinematic | 1 | |n|: how much of the unit ball is used
monitors/unit_dynamic | 1 | |n_d|
monitors/stationarity | 1 | |N dF/dq| of (11)
monitors/stiffness | 1 | least eigenvalue of N (H + D) N^T: a minimum of F if above 0
contact/normal | N | normal force on each foot that grips
contact/friction | N | friction on each
contact/slip | m/s | speed over the ground of the point of each that touches it
contact/lift | m | gap between each and the ground
contact/base | m or rad | height, roll and pitch of the platform's frame
contact/tip | m | position of the tip, with what the platform tilts and sinks
"""
_PLACES = {
    place: Place(*about)
    for place, *about in (row.split(" | ") for row in _TABLE.strip().split("\n"))
}
FIELDS = {place: about for place, about in _PLACES.items() if about.field}
"""The record's own datasets, but for t; the others are mobman's signals."""
ORIENTATION = {place: about for place, about in FIELDS.items() if "orientation" in place}
"""Those of runs whose task has an orientation."""
TEXTS = (
    *("status", "message", "robot", "controller", "task", "scenario"),
    *("urdf_sha256", "state_sha256", "created"),
)
DICTIONARIES = ("spec", "settings", "versions", "machine")
OPTIONAL = ("singularity",)
"""Dictionaries that a file has where they are not empty."""
APPLIED = "torque_applied"
"""The signal of the torque that acts, where the scenario's actuation makes it another one."""
OWN_PLACES = {
    *("t", "q", "z", "torque", "tip", "error", "compute_time"),
    *("metrics", "joint", "velocity", "axis", "urdf"),
}
"""First parts of the places in a record's file that a controller's signals cannot have."""

_DIMENSION_ONLY = "This is a netCDF dimension but not a netCDF variable. %10d"
"""The name in netCDF of a dimension without coordinates."""
_ROWS = 16384  # of a chunk at most: what reads a moment of a long run need not read the whole

_names = itertools.count()


def places_of(record: Mapping[str, Any]) -> dict[str, Place]:
    """The datasets that a record has, of :data:`FIELDS`."""
    if record.get("tip_orientation") is not None:
        return FIELDS
    return {place: about for place, about in FIELDS.items() if place not in ORIENTATION}


def error_components(m: int) -> list[str]:
    """Names of the components of e^e: directions, then axes of the turn back, for a pose those of the
    world."""
    turns = {5: ["about b_1", "about b_2"], 6: ["about x", "about y", "about z"]}
    return ["x", "y", "z"][:m] + turns.get(m, [])


def axes_of(record: Mapping[str, Any]) -> dict[str, Any]:
    """Names along the axes of a record's datasets, or numbers; of e^e without an orientation, those of
    the world's axes."""
    names = error_components(record["task_error"].shape[1])
    axes = {
        "joint": record["joint_names"],
        "velocity": record["velocity_names"],
        "axis": names[:3],
        "auxiliary_component": np.arange(record["auxiliary_error"].shape[1]),
    }
    if (turned := record.get("tip_orientation")) is not None:
        components = ["w", *names[:3]][-turned.shape[1] :]
        axes |= {"error/component": names, "tip/component": components}
    return axes


def file_content(record: Mapping[str, Any], *, every: int = 1, compression: int = 4) -> bytes:
    """The content of the file of a record, given by the fields of a :class:`mobman.Record`, with every
    so many-th sample and the last; equal records make equal bytes. UsageError if ``every`` or
    ``compression`` is no such number."""
    for name, value, allowed, text in (
        ("every", every, range(1, 2**63), "1 or more"),
        ("compression", compression, range(10), "from 0 to 9"),
    ):
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
        if not whole or int(value) not in allowed:
            raise UsageError(f"{name} = {value!r}: must be a whole number, {text}")
    count = len(record["t"])
    # the last sample too: where a run ended early, it is the one that matters
    rows: Any = sorted({*range(0, count, every), count - 1}) if every > 1 else slice(None)
    content = _file_of(record, every, rows, compression)
    samples = [record["t"], *record["signals"].values()]
    samples += [record[about.field] for about in places_of(record).values()]
    if sum(np.asarray(values)[rows].nbytes for values in samples) > most_bytes(len(content)):
        return _file_of(record, every, rows, 0)  # a robot at rest, say: or it could not be read
    return content


def _file_of(record: Mapping[str, Any], every: int, rows: Any, compression: int) -> bytes:
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fapl_core(1 << 18, False)
    # readers since HDF5 1.10 (2016); smaller indices of chunks than before
    access.set_libver_bounds(h5py.h5f.LIBVER_V110, h5py.h5f.LIBVER_V110)
    creation = h5py.h5p.create(h5py.h5p.FILE_CREATE)
    creation.set_obj_track_times(False)  # which h5py.File has no option for
    # of a name of its own: HDF5 takes two files of one name for the same
    name = f"mobman-{next(_names)}".encode()
    with h5py.File(h5py.h5f.create(name, h5py.h5f.ACC_TRUNC, creation, access)) as file:
        _write_attributes(file, record, every)
        _write_samples(file, record, rows, compression)
        for place, content in record["urdf"].items():
            _write_urdf(file, f"urdf/{place}", content)
        file.flush()
        return bytes(file.id.get_file_image())


def most_bytes(size: int) -> float:
    """Bytes of all samples that a file of a size (bytes) may have: no small file fills the memory."""
    return max(64e6, 50.0 * size)


def as_in_file(content: dict[str, Any]) -> dict[str, Any]:
    """A dictionary of a record as it is once it was in a file: tuples are lists, for instance."""
    back: dict[str, Any] = json.loads(_json(content))
    return back


def _write_attributes(file: h5py.File, record: Mapping[str, Any], every: int) -> None:
    file.attrs["schema_version"] = SCHEMA_VERSION
    file.attrs["seed"] = np.int64(record["seed"])
    file.attrs["decimation"] = np.int64(record["decimation"] * every)
    for name in TEXTS:
        file.attrs[name] = _text(record[name])
    for name in (*DICTIONARIES, *(name for name in OPTIONAL if record[name])):
        file.attrs[f"{name}_json"] = _text(_json(record[name]))
    file.attrs["signals"] = np.array(list(record["signals"]), dtype=h5py.string_dtype())
    metrics = file.create_group("metrics", track_times=False)
    for name, value in record["metrics"].items():
        metrics.attrs[name] = float(value)


def _write_samples(file: h5py.File, record: Mapping[str, Any], rows: Any, compression: int) -> None:
    def axis(name: str, values: Any, about: Place) -> h5py.Dataset:
        kind = None if isinstance(values, np.ndarray) else h5py.string_dtype()
        found = _dataset(file, name, values, about, dtype=kind)
        found.make_scale(name)
        return found

    def samples(place: str, values: Any, about: Place) -> h5py.Dataset:
        values = np.asarray(values, dtype="<f8")[rows]
        options: dict[str, Any] = {}
        if compression and values.size:
            # chunks are some rows of one column
            count = math.ceil(values.shape[0] / max(1, math.ceil(values.shape[0] / _ROWS)))
            options = {"compression": "gzip", "compression_opts": compression, "shuffle": True}
            options["chunks"] = (max(1, count), *(1 for _ in values.shape[1:]))
        return _dataset(file, place, values, about, **options)

    time = samples("t", record["t"], Place("s", "time"))
    time.make_scale("t")
    scales = {name: axis(name, x, _PLACES[name]) for name, x in axes_of(record).items()}
    for place, about in places_of(record).items():
        if place == "error/task" and "error/component" in scales:
            about = about._replace(units="m, then 1")
        data = samples(place, record[about.field], about)
        data.dims[0].attach_scale(time)
        if about.axis:
            data.dims[1].attach_scale(scales.get(about.axis, scales["axis"]))
    for place, values in record["signals"].items():
        data = samples(place, values, _PLACES.get(place, Place("", "signal of the controller")))
        data.dims[0].attach_scale(time)
        for i, size in enumerate(data.shape[1:], start=1):
            name = f"{place.replace('/', '_')}_component" + (f"_{i}" if i > 1 else "")
            components = Place("1", f"components of {place}")
            data.dims[i].attach_scale(axis(name, np.arange(size), components))


def _write_urdf(file: h5py.File, place: str, content: bytes) -> None:
    """A file's bytes; readers of netCDF want a name for the axis, too."""
    values = np.frombuffer(content, dtype=np.uint8)
    options = {"compression": "gzip", "compression_opts": 9}
    data = _dataset(file, place, values, Place("", "URDF file, byte by byte"), **options)
    # allocated when it is written, which it never is
    byte = data.parent.create_dataset("byte", shape=values.shape, dtype=">f4")
    byte.make_scale(_DIMENSION_ONLY % len(values))
    data.dims[0].attach_scale(byte)


def _dataset(
    file: h5py.File, place: str, values: Any, about: Place, **options: Any
) -> h5py.Dataset:
    if np.asarray(values).dtype.kind in "biuf" and np.size(values):  # HDF5 has none of texts
        # a checksum a chunk: what is damaged is not read as if it were not
        options = {"chunks": np.shape(values), **options, "fletcher32": True}
    dataset = file.create_dataset(place, data=values, track_times=False, **options)
    dataset.attrs["units"] = about.units
    dataset.attrs["description"] = about.description
    return dataset


def _text(text: str) -> str:
    """Text that HDF5 takes: valid UTF-8 without NUL, whatever a message or a name has in it."""
    return text.replace("\0", "\\0").encode("utf-8", errors="backslashreplace").decode("utf-8")


def _json(content: dict[str, Any]) -> str:
    return json.dumps(_plain(content), sort_keys=True)


def _plain(value: Any) -> Any:
    """Convert numpy's numbers and arrays, and whatever a user's controller or task has in it, to values
    of JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value if isinstance(value, str | int | float | None) else str(value)
