"""Curves as paths, in few letters."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array

_TOLERANCE = 1.5  # units that a curve may be off, so that straight parts need no points


def path(x: Array, y: Array) -> str:
    """A line in whole units, without the points that it does not need; gaps where there are none.

    Args:
        x: Across (units), shape (n,).
        y: Down (units), shape (n,).
    """
    parts = []
    finite = np.isfinite(x) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], finite.view(np.int8), [0]])))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        points = np.rint(np.stack([x[start:end], y[start:end]], axis=1)).astype(np.int64)
        parts.append(_commands(_simplified(points)))
    return "".join(parts)


def _simplified(points: np.ndarray) -> np.ndarray:
    """Fewer points: without those that lie near the line through their neighbours."""
    if len(points) < 3:
        return points
    same = np.concatenate([[False], np.all(points[1:] == points[:-1], axis=1)])
    points = points[~same]
    for _ in range(8):
        n = len(points)
        if n < 3:
            break
        before, here, after = points[:-2], points[1:-1], points[2:]
        chord, offset = after - before, here - before
        area = np.abs(chord[:, 0] * offset[:, 1] - chord[:, 1] * offset[:, 0])
        length = np.hypot(chord[:, 0], chord[:, 1])
        between = np.sum(offset * (after - here), axis=1) >= 0  # not where a line turns back
        near = (area <= _TOLERANCE * length) & between
        near[1::2] = False  # not two neighbours at once
        if not near.any():
            near = (area <= _TOLERANCE * length) & between
            near[::2] = False
            if not near.any():
                break
        points = points[np.concatenate([[True], ~near, [True]])]
    return points


def _commands(points: np.ndarray) -> str:
    """A path's commands: relative, since small numbers are short."""
    first = f"M{points[0, 0]} {points[0, 1]}"
    if len(points) == 1:
        return f"{first}h1"
    steps = np.diff(points, axis=0).tolist()
    return f"{first}l" + " ".join(f"{dx}{dy}" if dy < 0 else f"{dx} {dy}" for dx, dy in steps)
