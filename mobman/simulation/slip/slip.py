"""What slip is, and the registry of kinds."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mobman.arrays import Array, Index, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import Call, call
from mobman.registry import Registry


class Slip(Protocol):
    """A kind of slip with its parameters: a velocity of the platform's pose beside that of rolling."""

    def start(
        self, random: np.random.Generator, pose: Array, rolling: Array, slipping: Array
    ) -> Call | None:
        """The slip of one run as a step that adds to ``slipping``; None if there is none.

        Args:
            random: Generator of this piece alone.
            pose: (x1, x2, theta) (m, m, rad), shape (3,), read in place by the step.
            rolling: Its rate if the wheels roll, the pose's part of C z, shape (3,).
            slipping: Its rate besides, shape (3,), to which the step adds.
        """
        ...


slips: Registry[type[Slip]] = Registry("slip type", "mobman.simulation.slip.kinds")
"""The kinds of slip; each module registers its own."""


def begin_step(
    index: Index, q: Array, q_dot: Array, pose: Array, rolling: Array, slipping: Array
) -> Call:
    """Look at the pose, and no slip yet."""
    return call(_begin, index, q, q_dot, pose, rolling, slipping)


def add_step(index: Index, slipping: Array, q_dot: Array) -> Call:
    """Add the slip to q'."""
    return call(_add, index, slipping, q_dot)


@kernel
def _begin(
    index: Index, q: Vector, q_dot: Vector, pose: Vector, rolling: Vector, slipping: Vector
) -> None:
    for i in range(index.shape[0]):
        pose[i] = q[index[i]]
        rolling[i] = q_dot[index[i]]
        slipping[i] = 0.0


@kernel
def _add(index: Index, slipping: Vector, q_dot: Vector) -> None:
    for i in range(index.shape[0]):
        q_dot[index[i]] += slipping[i]
