"""Weights of the posture criterion that make metres and radians comparable."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mobman.robots.inference.findings import Finding
from mobman.robots.inference.tree import Joint

PLATFORM = 0.001
"""Of the platform's pose: a tenth of a radian of the arm weighs as much as 0.7 m."""
DEFAULT = 0.05
"""Of a radian of the arm."""
_LONG = 1.0  # m; an arm of this reach moves its tip by a metre a radian


def weights(
    wheels: Sequence[str], radius: float | None, slides: Sequence[Joint], reach: float
) -> dict[str, Finding]:
    """The weights that are not the default, by joint name.

    A wheel's weight is for the metres that it rolls: with a long arm a metre weighs as much as a
    radian; the less an arm reaches, the more of the way is the platform's, and the less it weighs.
    A slide's whole way weighs as much as a radian.

    Args:
        wheels: Joints of the wheels that are coordinates.
        radius: Of them (m).
        slides: Prismatic joints of the arm.
        reach: Of the arm (m).
    """
    found = {}
    if radius is not None:
        share = min(reach / _LONG, 1.0)
        why = f"default * (wheel_radius * {share:.2g} / m)^2: by the metres that it rolls"
        rolling = Finding(_short(DEFAULT * (radius * share) ** 2), why)
        found = dict.fromkeys(wheels, rolling)
    for joint in slides:
        if 0.0 < joint.width < math.inf:
            why = f"default / ({joint.width:.3g} m)^2: its way"
            found[joint.name] = Finding(_short(DEFAULT / joint.width**2), why)
    return found


def _short(value: float) -> float:
    return float(f"{value:.2g}")
