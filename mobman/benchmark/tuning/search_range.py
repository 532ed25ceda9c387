"""In what range a gain is searched."""

from __future__ import annotations

import math
from typing import Self

from pydantic import model_validator

from mobman.toml_model import Strict


class SearchRange(Strict):
    """From where to where a gain is searched, both ends included."""

    low: float
    high: float
    log: bool = False
    """Whether its logarithm is searched: for gains whose order of magnitude matters."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"low = {self.low:g} must be below high = {self.high:g}")
        if self.log and not self.low > 0.0:
            raise ValueError(f"low = {self.low:g} must be above 0 where log = true")
        return self

    def rounded(self, value: float, digits: int = 4) -> float:
        """The value with so many significant digits, and inside the range."""
        return min(max(float(f"{value:.{digits}g}"), self.low), self.high)

    def __contains__(self, value: object) -> bool:
        return (
            isinstance(value, (int, float))
            and not isinstance(value, bool)
            and math.isfinite(value)
            and self.low <= value <= self.high
        )


Space = dict[str, SearchRange]
"""Ranges by gain."""
