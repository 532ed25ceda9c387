"""Arrays in JSON: compact, and exact."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array, Index

Packed = dict[str, Any]


def packed(array: NDArray[Any], kind: str) -> Packed:
    """An array as base64 of its bytes, little endian, row by row.

    Args:
        array: The array.
        kind: ``"f8"``, ``"f4"``, ``"u1"``, ``"u2"`` or ``"u4"``: the page reads these.
    """
    plain = np.ascontiguousarray(array, dtype="<" + kind)
    return {
        "kind": kind,
        "shape": list(plain.shape),
        "data": base64.b64encode(plain.tobytes()).decode("ascii"),
    }


def packed_indices(faces: Index) -> Packed:
    """Whole numbers, with two bytes each where that is enough."""
    small = faces.size == 0 or int(faces.max()) < 2**16
    return packed(faces, "u2" if small else "u4")


def rows(matrix: Array) -> list[float]:
    """A matrix as a plain list, row by row, with all digits."""
    return [float(value) for value in np.asarray(matrix).ravel()]
