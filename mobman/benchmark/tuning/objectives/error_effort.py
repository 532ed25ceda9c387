"""``error-effort``: the task error, and the torque that it takes."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mobman.benchmark.tuning.objective import Objective, objectives
from mobman.benchmark.tuning.objectives.error import FLOOR, log_error

_WEIGHT = 0.5


def _score(metrics: Mapping[str, float]) -> float:
    return log_error(metrics) + _WEIGHT * math.log10(max(metrics["torque_energy"], FLOOR))


objectives.register(
    "error-effort",
    Objective(
        "error-effort",
        f"log10(max(task_error_rms, {FLOOR:g} m)) + {_WEIGHT:g} log10(torque_energy)",
        ("task_error_rms", "torque_energy"),
        _score,
    ),
)
