"""Metrics of monitored runs: how far what the theorems suppose was from failing, in each stage."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mobman.simulation.metrics import Run, metric
from mobman.simulation.monitors import BALL, STAGES, bound_ratio, least_of


def _is_monitored(run: Run) -> bool:
    return "monitors/margin_dynamic" in run.monitors


_OfStage = Callable[[Run, str], float]


def _theorems(
    name: str, unit: str, description: str, better: str = "lower"
) -> Callable[[_OfStage], _OfStage]:
    """Decorator: register a function of a run and a stage as a metric of each."""

    def register(function: _OfStage) -> _OfStage:
        for stage in STAGES:
            text = f"{stage} stage: {description}"
            add = metric(
                f"{name}_{stage}", unit, text, better, section="theorems", applies=_is_monitored
            )

            def of_stage(run: Run, stage: str = stage) -> float:
                return function(run, stage)

            add(of_stage)
        return function

    return register


@_theorems("gain_margin", "1", "least of what the gain gives over what is needed", "higher")
def gain_margin(run: Run, stage: str) -> float:
    return least_of(run.monitors[f"monitors/margin_{stage}"])


@_theorems("regularity", "1", "least lambda_min of (22), (54) or (64) over a or A", "higher")
def regularity(run: Run, stage: str) -> float:
    return least_of(run.monitors[f"monitors/regularity_{stage}"])


@_theorems("bound_ratio", "1", "largest left side of (41) or (53) over W or chi")
def largest_bound_ratio(run: Run, stage: str) -> float:
    return float(np.nanmax(bound_ratio(run.monitors, stage), initial=0.0))


@_theorems("bound_exceeded", "1", "share of the ticks at which (41) or (53) does not hold")
def bound_exceeded(run: Run, stage: str) -> float:
    return float(np.mean(bound_ratio(run.monitors, stage) > 1.0))


@_theorems(
    "off_manifold", "1", "share of the ticks at which the unit vector is not inside its ball"
)
def off_manifold(run: Run, stage: str) -> float:
    return float(np.mean(run.monitors[f"monitors/unit_{stage}"] >= BALL))


@_theorems("decrease_missed", "1", "share of those at which V falls more slowly than (42) or (63)")
def decrease_missed(run: Run, stage: str) -> float:
    rate, bound = (run.monitors[f"monitors/V_rate{name}_{stage}"] for name in ("", "_bound"))
    known = np.isfinite(rate)
    return float(np.mean(rate[known] > bound[known])) if known.any() else 0.0


@_theorems("reaching_time", "s", "first time on the manifold; inf if it is not reached")
def reaching_time(run: Run, stage: str) -> float:
    """The unit vector is inside its ball, or the sliding variable has turned."""
    s = run.monitors["sliding/s" if stage == "kinematic" else "sliding/S"]
    turned = np.append(False, np.sum(s[1:] * s[:-1], axis=1) <= 0.0)
    reached = np.flatnonzero(turned | (run.monitors[f"monitors/unit_{stage}"] < BALL))
    return float(run.t[reached[0]]) if len(reached) else math.inf


@_theorems("reaching_bound", "s", "time by which it is, by Theorem 1, 2 or 4", "")
def reaching_bound(run: Run, stage: str) -> float:
    return float(run.monitors[f"monitors/reaching_{stage}"][0])
