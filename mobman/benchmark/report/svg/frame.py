"""Where a panel is, and where its values are in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.benchmark.report.chart import Panel


@dataclass(frozen=True)
class Frame:
    """A panel's place, in units."""

    panel: Panel
    left: int
    right: int
    top: int
    bottom: int

    @property
    def width(self) -> int:
        """Across."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """Down."""
        return self.bottom - self.top

    def x(self, values: Array | float) -> Array:
        """Across; beyond the frame's ends at most by its width."""
        part = self.panel.x.fractions(np.asarray(values, dtype=float))
        return self.left + self.width * np.clip(part, -1.0, 2.0)

    def y(self, values: Array | float, *, inside: bool = True) -> Array:
        """Down; what is beyond the frame is drawn at its edge, as all curves have to stay in it."""
        part = self.panel.y.fractions(np.asarray(values, dtype=float))
        part = np.clip(part, 0.0, 1.0) if inside else part
        return self.bottom - self.height * part

    def y_within(self, values: Array) -> Array:
        """As :meth:`y`; where a curve stays outside of the frame, a gap."""
        part = self.panel.y.fractions(np.asarray(values, dtype=float))
        outside = (part < 0.0) | (part > 1.0)
        around = np.concatenate([[True], outside, [True]])
        lost = outside & around[:-2] & around[2:]
        return np.where(lost, np.nan, self.y(values))
