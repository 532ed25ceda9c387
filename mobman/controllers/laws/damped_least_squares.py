"""``damped-least-squares``: resolved acceleration on a damped pseudo-inverse."""

from __future__ import annotations

from dataclasses import dataclass

from mobman.controllers.computed_torque import RedundancyGains
from mobman.controllers.gains import gain, require_positive
from mobman.controllers.laws.pseudo_inverse import PseudoInverse
from mobman.controllers.protocol import controllers


@dataclass(frozen=True, kw_only=True)
class DampedGains(RedundancyGains):
    """Gains of :class:`PseudoInverse`, and the damping."""

    mu: float = gain(0.01, "1", "damping of the inverse, j_e^T (j_e j_e^T + mu^2 I)^-1")

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(self, "mu")


class DampedLeastSquares(PseudoInverse):
    """As ``pseudo-inverse``, with j_e^T (j_e j_e^T + mu^2 I)^-1 in the place of j_e^+ for the task
    (Nakamura and Hanafusa; Wampler): bounded at singularities, inexact everywhere else. The
    null-space projector keeps the exact j_e^+, since a damped one leaks the descent into the task."""

    name = "damped-least-squares"
    Gains = DampedGains
    gains: DampedGains

    @property
    def damping(self) -> float:  # type: ignore[override]
        """mu."""
        return float(self.gains.mu)


controllers.register(DampedLeastSquares.name, DampedLeastSquares)
