"""Which controllers of a suite are tuned, and in what space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mobman.benchmark.tuning.declaration import Tuning
from mobman.benchmark.tuning.law_space import checked_space, law_space
from mobman.benchmark.tuning.search_range import Space
from mobman.errors import SpecError, UnknownNameError

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite

SUFFIX = "-tuned"
"""What the label of tuned gains ends with."""


@dataclass(frozen=True)
class Candidates:
    """The controllers of a suite, as far as tuning goes."""

    spaces: Mapping[str, Space]
    """Of those that are tuned, by label."""
    left_out: Mapping[str, str]
    """Why the others are not, by label."""


def candidates(suite: Suite, asked: Sequence[str] | None = None) -> Candidates:
    """Which of a suite's controllers can be tuned.

    Args:
        suite: The suite.
        asked: Labels; all by default.

    Raises:
        UnknownNameError: If a label is not there.
        SpecError: If one that is asked for cannot be tuned, none can, or a space is not valid.
    """
    tuning = suite.tuning or Tuning()
    for label in [*(asked or []), *tuning.spaces]:
        if label not in suite.controllers:
            raise UnknownNameError("label of the suite", label, suite.controllers)
    spaces: dict[str, Space] = {}
    left_out: dict[str, str] = {}
    for label in dict.fromkeys(asked or suite.controllers):
        found = _space(suite, tuning, label)
        if isinstance(found, str):
            left_out[label] = found
        else:
            spaces[label] = found
    if left_out and (asked or not spaces):
        told = "; ".join(f"{label!r} {why}" for label, why in left_out.items())
        raise SpecError(f"cannot tune {told}")
    return Candidates(spaces, left_out)


def _space(suite: Suite, tuning: Tuning, label: str) -> Space | str:
    """A controller's space, or why it has none."""
    entry = suite.controllers[label]
    if entry.tuned is not None:
        return "is tuned already"
    if entry.grid:
        return "stands for several controllers, by its grid; give those to tune labels of their own"
    if label + SUFFIX in suite.controllers:
        return f"has been tuned: there is {label + SUFFIX!r}"
    if label in tuning.spaces:
        return checked_space(entry.law, tuning.spaces[label], f"tuning.spaces.{label}")
    space = law_space(entry.law)
    if space is None:
        return (
            f"has no search space: none is declared for its law {entry.law!r}; give one in the suite, "
            f"such as [tuning.spaces.{label}] GAIN = {{ low = 1.0, high = 100.0, log = true }}"
        )
    return space
