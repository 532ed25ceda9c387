"""``error-chattering``: the task error, and how much the torque moves."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mobman.benchmark.tuning.objective import Objective, objectives
from mobman.benchmark.tuning.objectives.error import FLOOR, log_error

_WEIGHT = 0.5


def _score(metrics: Mapping[str, float]) -> float:
    return log_error(metrics) + _WEIGHT * math.log10(max(metrics["torque_variation"], FLOOR))


objectives.register(
    "error-chattering",
    Objective(
        "error-chattering",
        f"log10(max(task_error_rms, {FLOOR:g} m)) + {_WEIGHT:g} log10(torque_variation)",
        ("task_error_rms", "torque_variation"),
        _score,
    ),
)
