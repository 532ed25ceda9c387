"""The task error, alone or with a price: ``error``, ``error-effort`` and ``error-chattering``."""

from __future__ import annotations

import math
from collections.abc import Mapping

from mobman.benchmark.tuning.objective import Objective, objectives

_FLOOR = 1e-6  # m: smaller errors count as this one; no robot would show the difference
_WEIGHT = 0.5


def _register(name: str, *prices: str) -> None:
    """Register the logarithm of the error, and of metrics that are half as dear."""

    def score(metrics: Mapping[str, float]) -> float:
        own = [_WEIGHT * math.log10(max(metrics[price], _FLOOR)) for price in prices]
        return sum(own, math.log10(max(metrics["task_error_rms"], _FLOOR)))

    terms = [f"log10(max(task_error_rms, {_FLOOR:g} m))"]
    terms += [f"{_WEIGHT:g} log10({price})" for price in prices]
    objectives.register(
        name, Objective(name, " + ".join(terms), ("task_error_rms", *prices), score)
    )


_register("error")
_register("error-effort", "torque_energy")
_register("error-chattering", "torque_variation")
