"""Where tuned gains come from."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from mobman.benchmark.tuning.search_range import Space
from mobman.toml_model import Strict


class TunedFrom(Strict):
    """What was tuned, and what came of it.

    An entry that says so of itself (``label`` is its own) was tuned in vain: no trial was better
    than its own gains.
    """

    label: str
    """The entry whose gains were tuned."""
    trials: int = Field(ge=1)
    """Sets of gains that were tried, the entry's own among them."""
    trial: int = Field(ge=0)
    """Which of them is the best; 0 is the entry's own."""
    objective: str
    """What was made small."""
    score_default: float
    """Of the entry's own gains, on the tuning set; less is better."""
    score: float
    """Of the best."""
    space: Annotated[Space, Field(min_length=1)]
    """In what ranges, by gain."""
