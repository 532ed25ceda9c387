"""Random states of a robot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

STATES = 200


def random_configuration(robot, random) -> np.ndarray:
    """Anywhere within the joint limits, the platform within 3 m of the origin and any heading."""
    lower = np.maximum(robot.model.lowerPositionLimit, -np.pi)
    upper = np.minimum(robot.model.upperPositionLimit, np.pi)
    return random.uniform(lower, upper)


def random_states(robot, count: int = STATES, seed: int = 1) -> Iterator[tuple]:
    """``count`` pairs (q, z)."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield random_configuration(robot, random), random.standard_normal(robot.nz)
