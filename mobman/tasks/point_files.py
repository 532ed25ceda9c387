"""Files of points, CSV or HDF5, of unknown origin: each part is checked, and every fault says where.

The names of the columns, in any order, say what they hold: ``t`` (s), ``x``, ``y``, ``z`` (m), and of an
orientation ``qw``, ``qx``, ``qy``, ``qz``, a unit quaternion. A CSV file has them in its first line. An
HDF5 file has a dataset ``points`` of shape (n, columns) with an attribute ``columns``, a list of names.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from numbers import Real
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mobman.arrays import LARGEST, SIZES, beyond_sizes
from mobman.errors import SpecError
from mobman.files import read_input
from mobman.hdf5 import own_dataset
from mobman.isolation import Crash, helper

POSITION, ORIENTATION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
COLUMNS = ("t", *POSITION, *ORIENTATION)
MOST_POINTS = 1000
"""They are kept in records."""
UNIT = 1e-3
"""Deviation from 1 that a quaternion's length may have by rounded decimals; it is made 1."""

_MEGABYTES = 1.0  # of a file
_SECONDS, _MEMORY = 20.0, 500.0  # of the process that reads HDF5 (s, MB)
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_SUFFIXES = (".h5", ".hdf5")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")

Table = dict[str, list[float]]


def points_of(given: Any) -> Any:
    """The points of a file: a list of numbers for each column, quaternions of length 1 and of signs
    that follow each other.

    Args:
        given: The file's path; or the points, as this function gives them. None remains None.

    Raises:
        SpecError: If the file cannot be read, or holds no such points.
    """
    if given is None:
        return None
    if isinstance(given, Mapping):
        return _checked_mapping(given)
    if not isinstance(given, (str, os.PathLike)):
        raise SpecError("must be the path of a file of points, CSV or HDF5")
    path = Path(given)
    content = read_input(path, "file of points", _MEGABYTES, "1000 points need less")
    what = f"the file of points {path}"
    if content.startswith(_SIGNATURE):
        try:
            names, values = helper.call(
                "mobman.tasks.point_files:read_hdf5",
                *(os.path.abspath(path), what),
                seconds=_SECONDS,
                megabytes=_MEMORY,
            )
        except Crash as error:
            raise SpecError(
                f"{what} is not a readable HDF5 file: it is damaged ({error})"
            ) from error
        rows = [f"row {number}" for number in range(len(values))]
        return _checked(what, "attribute 'columns'", names, rows, values.tolist())
    if path.suffix.lower() in _SUFFIXES:
        raise SpecError(
            f"{what} is not a readable HDF5 file: it starts with {content[:8]!r}, not with HDF5's "
            "signature"
        )
    return _csv(what, content)


def _checked_mapping(given: Mapping[str, Any]) -> Table:
    """Points that are given as such: as a file's columns."""
    columns = list(given.values())
    for name, column in given.items():
        numbers = isinstance(column, (list, tuple, np.ndarray)) and all(map(_is_number, column))
        if not numbers or len(column) != len(columns[0]):
            raise SpecError(
                f"column {name!r}: must be a list of numbers, as many as the other columns have"
            )
    rows = [f"point {number}" for number in range(len(columns[0]) if columns else 0)]
    values = [[float(x) for x in row] for row in zip(*columns, strict=True)]
    return _checked("the points", "columns", list(map(str, given)), rows, values)


def _is_number(x: Any) -> bool:
    """True but for what is too large for a float: a whole number may be as large as one likes."""
    if not isinstance(x, Real) or isinstance(x, bool):
        return False
    return not isinstance(x, int) or abs(x) <= LARGEST


# CSV -----------------------------------------------------------------------------------------------


def _csv(what: str, content: bytes) -> Table:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SpecError(
            f"{what} is neither HDF5 nor text in UTF-8 (byte {error.start}); allowed: CSV or HDF5"
        ) from None
    names: list[str] = []
    rows: list[str] = []
    values: list[list[float]] = []
    header = "the header"
    for number, line in enumerate(text.splitlines(), start=1):
        cells = [cell.strip() for cell in line.lstrip("# ").split(",")]
        comment = line.lstrip().startswith("#")  # numpy.savetxt writes the header as one
        if not line.strip() or (comment and (names or not set(cells) <= set(COLUMNS))):
            continue
        where = f"line {number}"
        if not names:
            names, header = cells, f"{where}, the header"
            continue
        if len(cells) != len(names):
            raise SpecError(
                f"{what}, {where}: it has {len(cells)} entries; needed: {len(names)}, one for each of "
                f"the columns {','.join(names)}"
            )
        if len(values) == MOST_POINTS:
            raise SpecError(
                f"{what}, {where}: more than {MOST_POINTS} points; allowed: 2 to {MOST_POINTS}"
            )
        rows.append(where)
        values.append(
            [_number(what, where, name, cell) for name, cell in zip(names, cells, strict=True)]
        )
    return _checked(what, header, names, rows, values)


def _number(what: str, where: str, name: str, cell: str) -> float:
    if _NUMBER.fullmatch(cell) is None:
        shown = cell if len(cell) <= 40 else cell[:37] + "..."
        raise SpecError(
            f"{what}, {where}, column {name!r}: found {shown!r}; allowed: a finite number"
        )
    return float(cell)


# HDF5 ----------------------------------------------------------------------------------------------


def read_hdf5(path: str, what: str) -> list[Any]:
    """Names of the columns, and the numbers, shape (n, columns): in the process of
    :mod:`mobman.isolation`.

    Raises:
        SpecError: If the file is no HDF5 file, or its data is elsewhere or too large.
    """
    try:
        with h5py.File(path, "r") as file:
            dataset, _ = own_dataset(file, "points")
            shape, kind = dataset.shape, dataset.dtype
            if len(shape) != 2 or shape[0] > MOST_POINTS or shape[1] > len(COLUMNS):
                raise SpecError(
                    f"points has shape {shape}; allowed: 2 to {MOST_POINTS} rows, {len(COLUMNS)} "
                    "columns at most"
                )
            if kind.kind not in "fiu" or kind.itemsize > 8:
                raise SpecError(f"points has entries of type {kind}; allowed: numbers")
            names = np.atleast_1d(dataset.attrs.get("columns", []))
            if names.ndim != 1 or not all(isinstance(name, (str, bytes)) for name in names):
                raise SpecError("attribute 'columns' of points must be a list of names")
            texts = [name if isinstance(name, str) else name.decode() for name in names]
            if shape[1] != len(texts):
                raise SpecError(
                    f"points has {shape[1]} columns, its attribute 'columns' {len(texts)} names; "
                    "needed: as many"
                )
            return [texts, dataset[()].astype("<f8")]
    except SpecError as error:
        raise SpecError(f"{what}: {error}") from error
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        text = " ".join(str(error).split())
        raise SpecError(f"{what} is not a readable HDF5 file: it is damaged ({text})") from error


# Both ----------------------------------------------------------------------------------------------


def _checked(
    what: str, header: str, names: Sequence[str], rows: Sequence[str], values: list[list[float]]
) -> Table:
    """The columns, in the order of COLUMNS."""
    allowed = f"allowed: {','.join(POSITION)}, with t and {','.join(ORIENTATION)} as wanted"
    found = ",".join(names) or "nothing"
    found = found if len(found) <= 60 else found[:57] + "..."
    if strange := [name for name in names if name not in COLUMNS]:
        raise SpecError(
            f"{what}, {header}: column {strange[0][:40]!r} is unknown in {found}; {allowed}"
        )
    if len(set(names)) < len(names):
        raise SpecError(f"{what}, {header}: a column is there twice in {found}; {allowed}")
    needed = POSITION + (ORIENTATION if set(names) & set(ORIENTATION) else ())
    if missing := [name for name in needed if name not in names]:
        raise SpecError(f"{what}, {header}: no column {', '.join(missing)} in {found}; {allowed}")
    if not 2 <= len(values) <= MOST_POINTS:
        raise SpecError(
            f"{what}: number of points: found {len(values)}; allowed: 2 to {MOST_POINTS}"
        )
    for row, point in zip(rows, values, strict=True):
        for name, number in zip(names, point, strict=True):
            if not math.isfinite(number) or beyond_sizes(number):
                raise SpecError(
                    f"{what}, {row}, column {name!r}: found {number:g}; allowed: {SIZES}"
                )
    table = {
        name: [point[names.index(name)] for point in values] for name in COLUMNS if name in names
    }
    if "t" in table:
        _check_times(what, rows, table["t"])
    if "qw" in table:
        _make_unit(what, rows, table)
    return table


def _check_times(what: str, rows: Sequence[str], times: Sequence[float]) -> None:
    if times[0] < 0.0:
        raise SpecError(f"{what}, {rows[0]}, column 't': found {times[0]:g} s; allowed: from 0")
    for i in range(1, len(times)):
        if times[i] <= times[i - 1]:
            raise SpecError(
                f"{what}, {rows[i]}, column 't': found {times[i]:g} s; allowed: later than "
                f"{times[i - 1]:g} s, the time of the point before"
            )


def _make_unit(what: str, rows: Sequence[str], table: Table) -> None:
    """Scale the quaternions to length 1, and choose of both signs that nearer to the one before."""
    quaternions = np.array([table[name] for name in ORIENTATION]).T
    for row, q in zip(rows, quaternions, strict=True):
        if not abs(math.hypot(*q) - 1.0) <= UNIT:
            raise SpecError(
                f"{what}, {row}, columns {','.join(ORIENTATION)}: found {q.tolist()}, of length "
                f"{math.hypot(*q):.6g}; allowed: length 1, to {UNIT:g}"
            )
        if abs(q @ q - 1.0) > 1e-15:  # what has been here before stays as it is
            q /= math.hypot(*q)
    for before, q in pairwise(quaternions):
        if before @ q < 0.0:
            q *= -1.0
    table |= {name: quaternions[:, i].tolist() for i, name in enumerate(ORIENTATION)}
