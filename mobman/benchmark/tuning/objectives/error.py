"""``error``: the task error alone."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mobman.benchmark.tuning.objective import Objective, objectives

FLOOR = 1e-6
"""m: smaller errors count as this one; no robot would show the difference."""


def log_error(metrics: Mapping[str, float]) -> float:
    """log10 of the task error (m), of which less than :data:`FLOOR` is not rewarded."""
    return math.log10(max(metrics["task_error_rms"], FLOOR))


objectives.register(
    "error",
    Objective("error", f"log10(max(task_error_rms, {FLOOR:g} m))", ("task_error_rms",), log_error),
)
