"""The colours that tell runs apart."""

from __future__ import annotations

_RUNS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c564b")
"""The first are told apart with any colour vision (Okabe and Ito)."""


def run_colour(index: int) -> str:
    """The colour of a comparison's run; they come again after the eighth."""
    return _RUNS[index % len(_RUNS)]
