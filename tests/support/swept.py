"""Sweeps over robots: one of each platform type always, the others in ``make test-slow``."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

import mobman as mm
from mobman.robots.catalogue import find_spec, origin_of

OWN = [name for name in mm.list_robots() if origin_of(name) == "mobman"]
PLATFORM = {name: find_spec(name).platform.type for name in OWN}
"""Type of the platform of every robot that comes with mobman."""

_CHOSEN = (
    *("youbot", "jackal_z1", "hunter_ur10", "ridgeback_panda"),
    *("ranger_xarm7", "hsr", "kmr_iiwa", "fixed_panda"),
)
ONE_OF_EACH = tuple({PLATFORM[name]: name for name in (*reversed(OWN), *_CHOSEN)}.values())
"""One robot of each platform type: with joints that slide or follow others, with redundant arms and
without; of a type that is new, the first."""


def swept(items: Iterable[Any] = OWN, always: Collection[Any] = ONE_OF_EACH) -> list[Any]:
    """Give parameters of a test of which those that are not ``always`` run are marked slow."""
    return [
        item if item in always else pytest.param(item, marks=pytest.mark.slow) for item in items
    ]
