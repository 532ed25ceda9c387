"""Stored results (goldens): reading, writing and comparing them; the command line in this process."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import h5py
import numpy as np

import mobman as mm
from support import command_line

FOLDER = Path(__file__).parents[1] / "goldens"
ROUNDING = 1e-15
"""Allowed in any case: rounding of numbers that should be 0."""

making = False
"""True while the files are being made: they need not be there yet."""


# Files ------------------------------------------------------------------------------------------


def write(name: str, content: Mapping[str, Any]) -> None:
    """Write nested dictionaries of arrays, and of texts for what JSON holds, to an HDF5 file."""
    path = FOLDER / name
    path.parent.mkdir(exist_ok=True)
    with h5py.File(path, "w", libver="latest") as file:
        _fill(file, content)


def _fill(group: h5py.Group, content: Mapping[str, Any]) -> None:
    for key, value in content.items():
        if isinstance(value, Mapping):
            _fill(group.create_group(key), value)
        elif isinstance(value, str):
            group[key] = value
        else:
            array = np.asarray(value, dtype=float)
            large = array.nbytes > 300
            group.create_dataset(
                key,
                data=array,
                chunks=array.shape if large else None,
                compression="gzip" if large else None,
                shuffle=large or None,
            )


@cache
def read(name: str) -> dict[str, Any]:
    """Read what :func:`write` wrote."""
    if making and not (FOLDER / name).exists():
        return {}
    with h5py.File(FOLDER / name) as file:
        return _content(file)


def _content(group: h5py.Group) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in group.items():
        if isinstance(value, h5py.Group):
            found[key] = _content(value)
        else:
            found[key] = value.asstr()[()] if value.dtype == object else value[()]
    return found


def write_json(name: str, content: Any) -> None:
    """Write JSON with one number or name a line."""
    text = json.dumps(plain(content), indent=1, ensure_ascii=False)
    # lists of numbers on one line
    text = re.sub(r"\[\s+([^\[\]{}\"]*?)\s+\]", lambda m: f"[{' '.join(m[1].split())}]", text)
    (FOLDER / name).write_text(text + "\n", encoding="utf-8")


@cache
def read_json(name: str) -> Any:
    """Read JSON."""
    if making and not (FOLDER / name).exists():
        return {}
    return json.loads((FOLDER / name).read_text(encoding="utf-8"))


def plain(value: Any) -> Any:
    """Replace arrays by lists, tuples by lists, numbers of NumPy by those of Python."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


# Comparison -------------------------------------------------------------------------------------


def differences(
    found: Any, stored: Any, tolerance: float, *, by_row: bool = False, where: str = ""
) -> Iterator[str]:
    """List the differences of two results.

    Args:
        found: Numbers, arrays, texts, or dictionaries and lists of them.
        stored: The same, as stored.
        tolerance: Largest difference of two numbers, over the largest stored one of their array.
        by_row: Compare with the largest of the row, not of the array.
        where: Name of the result.
    """
    if isinstance(stored, Mapping):
        yield from _differences_of_items(found, stored, tolerance, by_row, where)
    elif isinstance(stored, (list, tuple)) and not _numeric(stored):
        if not isinstance(found, (list, tuple)) or len(found) != len(stored):
            yield f"{where}: {found!r}; stored: {stored!r}"
            return
        for i, pair in enumerate(zip(found, stored, strict=True)):
            yield from differences(*pair, tolerance, by_row=by_row, where=f"{where}[{i}]")
    elif _numeric(stored):
        if not _numeric(found):
            yield f"{where}: {found!r}; stored: {stored!r}"
            return
        share = relative_difference(found, stored, by_row=by_row)
        if not share <= tolerance:
            yield f"{where}: differs by {share:.1e} of the largest; allowed: {tolerance:.0e}"
    elif found != stored:
        yield f"{where}: {found!r}; stored: {stored!r}"


def _differences_of_items(
    found: Any, stored: Mapping[str, Any], tolerance: float, by_row: bool, where: str
) -> Iterator[str]:
    if not isinstance(found, Mapping):
        yield f"{where}: {found!r}; stored: {stored!r}"
        return
    for key in stored.keys() - found.keys():
        yield f"{where}/{key}: missing"
    for key in found.keys() - stored.keys():
        yield f"{where}/{key}: not stored"
    for key in stored.keys() & found.keys():
        place = f"{where}/{key}" if where else key
        yield from differences(found[key], stored[key], tolerance, by_row=by_row, where=place)


def _numeric(value: Any) -> bool:
    """True for a number and for an array or list of numbers."""
    if isinstance(value, (str, bool, Mapping)) or value is None:
        return False
    try:
        array = np.asarray(value)
    except ValueError:
        return False
    return array.dtype.kind in "fiu"


def relative_difference(found: Any, stored: Any, *, by_row: bool = False) -> float:
    """The largest difference over the largest stored number; inf where one alone is NaN or inf."""
    found, stored = np.asarray(found, dtype=float), np.asarray(stored, dtype=float)
    if found.shape != stored.shape:
        return np.inf
    finite = np.isfinite(stored)
    if not np.array_equal(found[~finite], stored[~finite], equal_nan=True):
        return np.inf
    if not np.isfinite(found[finite]).all():
        return np.inf
    if not finite.any():
        return 0.0
    size = np.abs(np.where(finite, stored, 0.0))
    scale = size.max(axis=-1, keepdims=True) if by_row and size.ndim else size.max()
    difference = np.abs(np.where(finite, found, 0.0) - np.where(finite, stored, 0.0))
    beyond = np.maximum(difference - ROUNDING, 0.0)
    return float(
        np.divide(beyond, scale, out=np.where(beyond > 0, np.inf, 0.0), where=scale > 0).max()
    )


RESIDUALS = {"constraint_residual", "energy_residual"}
"""Metrics that are rounding alone in an ideal run: compared without regard to their size."""


def steady_metrics(metrics: Mapping[str, float]) -> dict[str, float]:
    """The metrics without computing times."""
    return {key: float(value) for key, value in metrics.items() if "compute_time" not in key}


def metrics_apart(metrics: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """Split the metrics without computing times: those to compare by size, and residuals."""
    kept = steady_metrics(metrics)
    return (
        {key: value for key, value in kept.items() if key not in RESIDUALS},
        {key: value for key, value in kept.items() if key in RESIDUALS},
    )


def metric_differences(
    found: Mapping[str, float], stored: Mapping[str, float], tolerance: float, where: str = ""
) -> Iterator[str]:
    """List the metrics that differ, without computing times; later ones are not in what is stored."""
    (found, residuals), (stored, stored_residuals) = metrics_apart(found), metrics_apart(stored)
    found = {name: value for name, value in found.items() if name in stored}
    yield from differences(found, stored, tolerance, where=where)
    for name, value in stored_residuals.items():
        other = residuals.get(name, np.inf)
        if not (abs(other - value) <= 1e-12 or (np.isnan(other) and np.isnan(value))):
            yield f"{where}/{name}: {other:.3e}; stored: {value:.3e}"


# States -----------------------------------------------------------------------------------------


def a_last_place_away(q: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Each entry one unit in its last place off, up or down; of entries below 1, the place of 1."""
    unit = np.spacing(np.maximum(np.abs(q), 0.5))
    return q + unit * generator.choice([-1.0, 1.0], size=q.shape)


# The command line -------------------------------------------------------------------------------


def mobman(*arguments: str) -> tuple[int, str, str]:
    """Run ``python -m mobman`` in this process: its exit status, stdout and stderr."""
    done = command_line.mobman(*arguments)
    return done.returncode, done.stdout, done.stderr


@contextmanager
def terminal() -> Iterator[None]:
    """An environment in which the command line prints the same everywhere."""
    fixed = {"COLUMNS": "140", "LINES": "50", "TERM": "dumb", "NO_COLOR": "1"}
    with patch.dict(os.environ, fixed):
        for name in ("FORCE_COLOR", "MOBMAN_DEBUG", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
            os.environ.pop(name, None)
        yield


_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\+00:00)?)?( UTC)?")
_HASH = re.compile(r"\b[0-9a-f]{16}(?:[0-9a-f]{48})?\b")
_PATH = re.compile(r"(?<![\w./)>])/(?:[^\s/'\",:;()\[\]]+/)*(?=[^\s/'\",:;()\[\]])")


def normalised(text: str, *folders: Path) -> str:
    """Remove from a text what differs between machines: folders, dates, versions, hashes.

    Args:
        text: The text.
        folders: Working folders; paths in them become relative to ``<work>``.
    """
    # these may have spaces, and lie one in another
    names = {Path(mm.__file__).parents[1]: "/folder", Path(sys.prefix): "/folder"}
    names |= dict.fromkeys(folders, "<work>")
    for folder in sorted(names, key=lambda folder: -len(str(folder))):
        text = text.replace(str(folder), names[folder])
    text = text.replace(mm.__version__, "<version>")
    text = _DATE.sub("<date>", text)
    text = _HASH.sub("<hash>", text)
    text = _PATH.sub("<path>/", text)
    return "\n".join(line.rstrip() for line in text.splitlines()) + ("\n" if text else "")


_NUMBER = re.compile(
    r"(?<![\w.])[−-]?\d+(?:\.\d+)?(?:e[−+-]?\d+)?(?![\w])|(?<!\w)[−-]?(?:inf|nan)(?!\w)"
)


def numbers_in(text: str) -> list[str]:
    """The numbers of a text, as they are written."""
    return _NUMBER.findall(text)


def alike(found: str, stored: str, *, negligible: float = 1e-8) -> bool:
    """True if two written numbers are equal to a unit in the last digit, or both negligible."""
    if found == stored:
        return True
    a, b = (float(text.replace("−", "-")) for text in (found, stored))
    if max(abs(a), abs(b)) < negligible:
        return True
    mantissa, _, exponent = stored.partition("e")
    if not ("." in mantissa or exponent):
        return a == b
    decimals = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent.replace("−", "-") or 0) - decimals)
    return abs(a - b) <= max(1.001 * unit, 1e-9 * abs(b))


def text_differences(found: str, stored: str) -> Iterator[str]:
    """List the lines that differ in more than column widths and last digits of numbers."""
    ours, theirs = found.splitlines(), stored.splitlines()
    if len(ours) != len(theirs):
        yield f"{len(ours)} lines; stored: {len(theirs)}"
    for line, other in zip(ours, theirs, strict=False):
        words, others = (" ".join(_NUMBER.sub("#", text).split()) for text in (line, other))
        numbers = zip(numbers_in(line), numbers_in(other), strict=False)
        if words != others or not all(alike(*pair) for pair in numbers):
            yield f"{line!r}\nstored: {other!r}"
