"""Whether the code has become slower: ratios of this measurement against those kept in git.

Ratios, not times: each has both sides measured in the same minute on the same machine.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TOLERANCE = 0.25
"""By what part a ratio may be worse before it counts: two full runs on a busy machine of two cores
differed by 18 % at worst, by 7 % or less in half of the ratios."""

EXPONENT_TOLERANCE = 0.3
"""By how much an exponent may be larger before it counts; two such runs differed by 0.1."""

_EXPONENT = "exponent larger half"

_COMPARED = {
    "tick_over_bare": False,
    "step_over_bare": False,
    "step_over_pink": False,
    "plain_over_tick": True,
}
"""Ratios that are kept, and whether more is better."""


@dataclass(frozen=True)
class Comparison:
    """One ratio, then and now."""

    name: str
    old: float
    new: float | None
    """None if it was not measured this time."""
    tolerance: float

    @property
    def worse_by(self) -> float:
        """The part by which a ratio is worse, the amount by which an exponent is larger; negative if
        it is better, NaN if it was not measured."""
        if self.new is None:
            return math.nan
        if self.name == _EXPONENT:
            return self.new - self.old
        better_with_more = _COMPARED[self.name.split()[-1]]
        return (self.old / self.new if better_with_more else self.new / self.old) - 1.0

    @property
    def failed(self) -> bool:
        """Whether it is worse by more than the tolerance, or has stopped being a number."""
        return self.new is not None and not self.worse_by <= self.tolerance


def kept_ratios(result: dict[str, Any]) -> dict[str, float]:
    """The ratios of a measurement that a baseline keeps, by name."""
    found = {
        f"{robot} {name}": measured["ratios"][name]["median"]
        for robot, measured in result.get("robots", {}).items()
        for name in _COMPARED
        if name in measured["ratios"]
    }
    if joints := result.get("growth", {}).get("joints"):
        found[_EXPONENT] = joints["exponent"]["larger half"]
    return found


def compare(result: dict[str, Any], baseline: dict[str, Any]) -> list[Comparison]:
    """Every ratio of the baseline with that of the measurement."""
    new = kept_ratios(result)
    return [
        Comparison(
            name=name,
            old=old,
            new=new.get(name),
            tolerance=baseline["exponent_tolerance" if name == _EXPONENT else "tolerance"],
        )
        for name, old in baseline["ratios"].items()
    ]


def as_table(comparisons: list[Comparison]) -> str:
    """One line a ratio, for a terminal."""
    width = max((len(one.name) for one in comparisons), default=0)
    lines = [f"{'ratio':{width}}  {'old':>8}  {'new':>8}  {'worse by':>8}  tolerance"]
    for one in comparisons:
        new, change, verdict = "-", "-", "not measured"
        if one.new is not None:
            new, change = f"{one.new:.3f}", f"{one.worse_by:+.2f}"
            verdict = "WORSE" if one.failed else "ok"
        lines.append(
            f"{one.name:{width}}  {one.old:8.3f}  {new:>8}  {change:>8}  {one.tolerance:9.2f} {verdict}"
        )
    return "\n".join(lines)


def read_baseline(path: Path) -> dict[str, Any] | None:
    """What is kept; None if nothing is."""
    if not path.is_file():
        return None
    kept: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return kept


def write_baseline(path: Path, result: dict[str, Any]) -> None:
    """Keep the ratios of a measurement; the tolerances stay, and what was not measured this time."""
    before = read_baseline(path) or {}
    content = {
        "tolerance": before.get("tolerance", TOLERANCE),
        "exponent_tolerance": before.get("exponent_tolerance", EXPONENT_TOLERANCE),
        "ratios": {
            **before.get("ratios", {}),
            **{name: round(value, 4) for name, value in kept_ratios(result).items()},
        },
    }
    path.write_text(json.dumps(content, indent=2) + "\n")
