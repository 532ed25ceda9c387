"""Boxes with wells cut out, so that the wheels of a body that is given by its numbers can be seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobman.arrays import Array
from mobman.viewer.meshes import Surface


def hollowed(box: Array, wells: Sequence[Array]) -> Surface:
    """The surface of a box without what lies in other boxes.

    Args:
        box: Lowest and highest corner (m), shape (2, 3).
        wells: The same of each box that is cut out, along the same axes; they may reach out of the box,
            to infinity too.
    """
    cuts = [np.clip(well, *box) for well in wells]
    edges = [np.unique([box[:, axis], *(cut[:, axis] for cut in cuts)]) for axis in range(3)]
    middles = np.meshgrid(*(0.5 * (edge[1:] + edge[:-1]) for edge in edges), indexing="ij")
    centres = np.stack(middles, axis=-1)
    full = np.ones(centres.shape[:3], dtype=bool)
    for low, high in wells:
        full &= ~np.all((centres > low) & (centres < high), axis=-1)
    quads: list[Array] = []
    padded = np.pad(full, 1)
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        for side in (0, 1):  # faces towards the lower cell and the upper one
            beyond = np.roll(padded, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            for cell in np.argwhere(full & ~beyond):
                quad = np.empty((4, 3))
                quad[:, axis] = edges[axis][cell[axis] + side]
                turns = ((0, 0), (1, 0), (1, 1), (0, 1))
                for corner, steps in zip(quad, turns if side else turns[::-1], strict=True):
                    for other, step in zip(across, steps, strict=True):
                        corner[other] = edges[other][cell[other] + step]
                quads.append(quad)
    corners = np.arange(4 * len(quads)).reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return Surface(np.reshape(quads, (-1, 3)), faces)
