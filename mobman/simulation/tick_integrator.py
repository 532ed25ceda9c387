"""The plant from one tick to the next, under the torque that is held."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.errors import SingularityError
from mobman.kernels.program import program
from mobman.simulation.actuation.chain import ActuationChain
from mobman.simulation.divergence import divergence_reason, divergence_step
from mobman.simulation.integrator import RungeKutta
from mobman.simulation.plant import Plant
from mobman.simulation.samples import Samples

_LARGEST_STEP = 1e-3  # s: the plant's integration step is at most this


class _Part(NamedTuple):
    """A tick, or a part of one."""

    state: RungeKutta
    length: float
    """s."""
    steps: int


class TickIntegrator:
    """Integrates the plant tick by tick, from rest, in equal steps of at most 1 ms.

    Where torques arrive between ticks, a tick has two parts, each in steps of its own.

    Args:
        plant: The plant, with the torque that acts from a tick on.
        actuation: Gives the torque that arrives later in the tick; None if none does.
        q0: Start (m, rad), shape (nq,).
        dt: Sampling period (s).
        samples: What is told if the state diverges.

    Raises:
        SpecError: If friction is too steep to be integrated in these steps.
    """

    def __init__(
        self,
        plant: Plant,
        actuation: ActuationChain | None,
        q0: Array,
        dt: float,
        samples: Samples,
    ) -> None:
        steps = _steps_of(dt)
        plant.require_followed(q0, dt / steps)
        self._plant, self._actuation, self._samples = plant, actuation, samples
        self._state = RungeKutta(plant, q0, np.zeros(plant.robot.nz), dt / steps)
        self._first = _Part(self._state, dt, steps)
        self._second: _Part | None = None
        if actuation is not None and actuation.split:
            self._first = self._part(actuation.split * dt)
            self._second = self._part((1.0 - actuation.split) * dt)
        self._runs_away = program(
            [divergence_step(plant.now.q, plant.now.z, np.zeros(3), np.zeros((4, 3)))]
        )

    @property
    def work(self) -> float:
        """Integral of z^T (B v - D) since the start (J)."""
        return float(self._state.work[0])

    def advance(self, t: float) -> None:
        """Go from a tick to the next; if the state diverges on the way, the samples say so.

        Args:
            t: The tick's time (s); the dynamics are evaluated at the state.

        Raises:
            SingularityError: If M is not positive definite somewhere on the way.
        """
        first, second = self._first, self._second
        self._integrate(first, t)
        if second is not None and self._actuation is not None and self._samples.status == "ok":
            self._plant.v[:] = self._actuation.late
            self._integrate(second, t + first.length, evaluated=False)

    def _part(self, length: float) -> _Part:
        steps = _steps_of(length)
        return _Part(self._state.of_step(length / steps), length, steps)

    def _integrate(self, part: _Part, t: float, evaluated: bool = True) -> None:
        """A part that starts at t; the dynamics are evaluated at the state already, or not."""
        state, length, steps = part
        try:
            if not evaluated:
                state.evaluate(t)
            state.step(t)
            for step in range(1, steps):
                later = t + step * length / steps
                state.evaluate(later)
                state.step(later)
        except SingularityError:
            # far and fast enough, rounding makes M indefinite before anything overflows
            z = self._plant.now.z
            if (reason := divergence_reason(self._runs_away(), z, np.zeros(3))) is None:
                raise
            self._samples.diverged(t + length, reason)


def _steps_of(length: float) -> int:
    """Number of integration steps in so many seconds."""
    return max(1, math.ceil(length / _LARGEST_STEP - 1e-9))
