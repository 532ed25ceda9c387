"""Samples as compressed chunks of an HDF5 file: smaller and several times as fast as HDF5's own way.

Every column is stored by itself, byte plane by byte plane (HDF5's shuffle filter), as a stream that its
gzip filter reads. Most planes of a measured double are noise, on which gzip spends most of its time for
nothing: these are put into the stream as they are. What is left are long runs of equal bytes.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array

Bytes = NDArray[np.uint8]

_ROWS = 16384  # of a chunk at most: what reads a moment of a long run need not read the whole
_EQUAL = 0.2  # of neighbouring bytes: a plane with fewer is noise
_SEARCH = 5  # from this level on, repeated sequences are looked for, too
_WINDOW, _MEMORY = 12, 6  # of zlib: planes are short
_LARGEST_STORED = 65535  # bytes in a block of a deflate stream (RFC 1951)
_HEADER, _LAST = b"\x78\x01", b"\x03\x00"


def chunk_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """The shape of the chunks of samples: some rows of one column."""
    parts = max(1, math.ceil(shape[0] / _ROWS))
    return (max(1, math.ceil(shape[0] / parts)), *(1 for _ in shape[1:]))


def chunks(samples: Array, level: int) -> Iterator[tuple[tuple[int, ...], bytes]]:
    """The chunks of samples: where each begins, and its content behind shuffle and gzip filters.

    Args:
        samples: Shape (N_s, ...).
        level: From 1, fast, to 9.
    """
    rows = chunk_shape(samples.shape)[0]
    columns = [(0, *index) for index in np.ndindex(samples.shape[1:])]
    for first in range(0, len(samples), rows):
        planes = _planes(samples[first : first + rows], rows)
        noise = np.count_nonzero(planes[:, :, 1:] == planes[:, :, :-1], axis=2) <= _EQUAL * rows
        for place, column, is_noise in zip(columns, planes, noise.tolist(), strict=True):
            yield (first, *place[1:]), _stream(column, is_noise, level)


def _planes(samples: Array, rows: int) -> Bytes:
    """Byte k of every number of a column in a row, shape (columns, 8, rows); zero beyond the samples."""
    table = samples.reshape(len(samples), -1)
    whole = np.zeros((table.shape[1], rows), dtype="<f8")
    whole[:, : len(table)] = table.T
    planes = whole.view(np.uint8).reshape(len(whole), rows, 8).transpose(0, 2, 1)
    return np.ascontiguousarray(planes)


def _stream(planes: Bytes, is_noise: list[bool], level: int) -> bytes:
    """A zlib stream (RFC 1950) of the planes: runs of noise stored, the others deflated."""
    content = planes.tobytes()
    size = planes.shape[1]
    parts, start = [_HEADER], 0
    for plane in range(1, 9):
        if plane < 8 and is_noise[plane] == is_noise[start]:
            continue
        part = content[start * size : plane * size]
        parts += _stored(part) if is_noise[start] else _deflated(part, level)
        start = plane
    return b"".join([*parts, _LAST, zlib.adler32(content).to_bytes(4, "big")])


def _stored(content: bytes) -> list[bytes]:
    blocks = []
    for first in range(0, len(content), _LARGEST_STORED):
        part = content[first : first + _LARGEST_STORED]
        size = len(part)
        blocks += [b"\x00", size.to_bytes(2, "little"), (size ^ 0xFFFF).to_bytes(2, "little"), part]
    return blocks


def _deflated(content: bytes, level: int) -> list[bytes]:
    strategy = zlib.Z_DEFAULT_STRATEGY if level >= _SEARCH else zlib.Z_RLE
    deflate = zlib.compressobj(level, zlib.DEFLATED, -_WINDOW, _MEMORY, strategy)
    return [deflate.compress(content), deflate.flush(zlib.Z_SYNC_FLUSH)]
