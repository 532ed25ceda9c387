"""What the project promises of its speed, and whether a measurement keeps it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

MB = 1e6


@dataclass(frozen=True)
class Target:
    """A promise."""

    text: str
    """In plain words."""
    found: float
    limit: float
    at_most: bool = True
    """Whether the value must be at most the limit, or else at least."""
    strictly: bool = False
    """Whether it must not be the limit itself."""
    stretch: float | None = None
    """A limit that it would be good to keep."""
    unit: str = ""

    @property
    def met(self) -> bool:
        """Whether the value, not rounded, keeps the limit; one that is no number does not."""
        return self._keeps(self.limit)

    @property
    def verdict(self) -> str:
        """``met`` or ``not met``, and the same of the stretch."""
        words = "met" if self.met else "**not met**"
        if self.stretch is not None:
            reached = "met" if self._keeps(self.stretch) else "not met"
            words += f"; stretch of {self.stretch:g}{self.unit} {reached}"
        return words

    @property
    def value(self) -> str:
        """The value with three digits, rounded to the side that speaks against it."""
        return f"{rounded_against(self.found, self.at_most)}{self.unit}"

    @property
    def bound(self) -> str:
        """The limit in words."""
        words = {(True, False): "at most", (True, True): "under", (False, False): "at least"}
        return f"{words[self.at_most, self.strictly]} {self.limit:g}{self.unit}"

    def _keeps(self, limit: float) -> bool:
        if self.strictly:
            return self.found < limit
        return self.found <= limit if self.at_most else self.found >= limit


def rounded_against(value: float, upwards: bool, digits: int = 3) -> str:
    """A value with so many digits, rounded up or down; integers beyond them are not shortened."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    # what is a round number but for its last bits stays one
    steps = round(value * 10**decimals, 6)
    rounded = (math.ceil(steps) if upwards else math.floor(steps)) / 10**decimals
    return f"{rounded:.{decimals}f}"


def targets(result: dict[str, Any]) -> list[Target]:
    """The promises of which a measurement, as ``speed.json`` holds it, has the numbers."""
    found: list[Target] = []
    robots = result.get("robots", {})
    for name in ("youbot", "tiago_no_hand"):
        if ratio := _ratio(robots, name, "tick_over_bare"):
            text = f"{name}: our whole tick (c) over the bare Pinocchio calls (a)"
            found.append(Target(text, ratio, 3.0, stretch=1.5))
    if ratio := _ratio(robots, "tiago_no_hand", "step_over_pink"):
        text = "tiago_no_hand: our controller step (b) over Pink's solve_ik (d)"
        found.append(Target(text, ratio, 0.5))
    for name in robots:
        if ratio := _ratio(robots, name, "plain_over_tick"):
            text = f"{name}: the loop written plainly (f) over our whole tick (c)"
            found.append(Target(text, ratio, 10.0, at_most=False))
    for name, run in result.get("long_runs", {}).items():
        seconds = run["duration"]
        text = f"{name}: p99 of the controller step over its median, {seconds:g} s at 1 kHz"
        found.append(Target(text, run["p99_over_median"], 2.0, strictly=True))
        text = f"{name}: peak memory of that run beyond its record"
        found.append(Target(text, run["beyond_record"] / MB, 50.0, unit=" MB"))
        for key, what in (
            ("kept_growth_per_tick", "what it keeps beyond the record"),
            ("growth_per_tick", "its peak beyond the record"),
        ):
            text = f"{name}: growth of {what}, with the ticks (none can be told)"
            found.append(Target(text, run[key], run["resolution"], unit=" B/tick"))
    if real_time := result.get("real_time"):
        text = "youbot at 1 kHz on one core: times faster than real time"
        found.append(Target(text, real_time["factor"]["median"], 20.0, at_most=False))
    if joints := result.get("growth", {}).get("joints"):
        for sizes, exponent in joints["exponent"].items():
            text = f"exponent of the law's own work over r, chains of 3 to 40 joints, {sizes}"
            found.append(Target(text, exponent, 3.0))
    if imports := result.get("imports"):
        text = "import mobman, beyond import pinocchio"
        found.append(Target(text, imports["difference"]["median"], 0.3, unit=" s"))
    return found


def _ratio(robots: dict[str, Any], name: str, which: str) -> float | None:
    ratios = robots.get(name, {}).get("ratios", {})
    return float(ratios[which]["median"]) if which in ratios else None
