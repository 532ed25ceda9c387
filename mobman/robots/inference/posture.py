"""A rest posture from which the arm can move in every direction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference.chain import Chain
from mobman.robots.inference.tree import Joint

_SAMPLES = 4000
_SEED = 0
_INSIDE = 0.8  # of a joint's range is where it may rest
_ENDLESS = 0.5 * math.pi  # rad; how far a joint without limits may be from zero
_LEVER = 1.0  # rad; columns of the Jacobian are for so much of a turn, or for half a slide's way
_LOSS = 0.04  # of the score, for a joint that rests at zero or in the middle instead
_STEP = {True: 0.01, False: 0.05}  # m, rad; what numbers are rounded to
_RANK = 1e-3  # of the largest singular value
_REFINEMENTS = ((0.2, 600), (0.06, 600))  # of the range; samples


@dataclass(frozen=True)
class Place:
    """Where the arm is.

    Attributes:
        ground: Height of the ground in the root's frame (m).
        forward: Unit vector in the plane, shape (2,).
        box: Corners of the platform's body in the root's frame (m), shape (2, 3); None: not known.
    """

    ground: float
    forward: Array
    box: Array | None


def rest_posture(joints: Sequence[Joint], tip: Array, place: Place) -> dict[str, float]:
    """Rounded joint positions, by name (m, rad); the same for the same robot.

    The least singular value of the tip's linear Jacobian (of those that are not zero everywhere) is
    made large, with the joints away from their limits and the tip in front of or beside the platform
    and well above the ground; joints that matter little are at zero, or in the middle of their range.
    """
    chain = Chain(joints, tip)
    low, high = np.array([_range(joint) for joint in joints]).T
    random = np.random.default_rng(_SEED)
    score = _Score(chain, place, low, high, random)
    q = low + (high - low) * random.random((_SAMPLES, len(joints)))
    best = q[np.argmax(score(q))]
    for width, count in _REFINEMENTS:
        near = best + width * (high - low) * random.uniform(-1.0, 1.0, (count, len(joints)))
        near = np.vstack([best, np.clip(near, low, high)])
        best = near[np.argmax(score(near))]
    best = _simplified(best, joints, score, low, high)
    return {joint.name: value for joint, value in zip(joints, best.tolist(), strict=True)}


def _range(joint: Joint) -> tuple[float, float]:
    """Where a joint may rest."""
    if joint.endless or not math.isfinite(joint.width):
        return -_ENDLESS, _ENDLESS
    middle, half = 0.5 * (joint.lower + joint.upper), 0.5 * joint.width
    half *= _INSIDE
    low, high = middle - half, middle + half
    if not joint.prismatic:  # several turns are no more use than one
        low, high = max(low, min(-0.75 * math.pi, high)), min(high, max(0.75 * math.pi, low))
    return low, high


class _Score:
    """How good postures are: a number above 0 for each."""

    def __init__(
        self, chain: Chain, place: Place, low: Array, high: Array, random: np.random.Generator
    ) -> None:
        self._chain, self._place = chain, place
        self._middle, self._half = 0.5 * (low + high), 0.5 * np.maximum(high - low, 1e-9)
        self._scale = np.array(
            [
                half if joint.prismatic else min(_LEVER, half)
                for joint, half in zip(chain.joints, self._half, strict=True)
            ]
        )
        some = low + (high - low) * random.random((200, len(low)))
        values = self._singular_values(some)
        _, _, tip = chain.places(some)
        centres, _, _ = chain.places(some)
        self._size = float(np.max(np.linalg.norm(tip - centres[:, 0], axis=1))) or 1.0
        self._rank = max(int(np.sum(values > _RANK * self._size, axis=1).max()), 1)

    def __call__(self, q: Array) -> Array:
        values = self._singular_values(q)[:, self._rank - 1] / self._size
        if self._rank < 3:  # the platform does not move the tip up: what is left must
            vertical = np.linalg.norm(self._chain.jacobian(q)[:, 2] * self._scale, axis=1)
            values = values * np.minimum(vertical / self._size, 1.0)
        centres, _, tip = self._chain.places(q)
        used = np.abs(q - self._middle) / self._half
        margin = np.mean(1.0 - 0.5 * used**4, axis=1)
        small = np.exp(-0.02 * np.mean((q / np.maximum(self._half, 1e-9)) ** 2, axis=1))
        result: Array = (values + 1e-6) * margin * small * self._where(centres, tip)
        return result

    def _singular_values(self, q: Array) -> Array:
        scaled = self._chain.jacobian(q) * self._scale
        values: Array = np.linalg.svd(scaled, compute_uv=False)
        return values

    def _where(self, centres: Array, tip: Array) -> Array:
        """Below 1 for a tip behind, low or in the platform, and for links in the ground."""
        place, size = self._place, self._size
        # joints of a lift or turntable are not yet the arm: from where it begins to reach out
        out = tip - centres[:, 0]
        ahead, beside = out[:, :2] @ place.forward, np.linalg.norm(out[:, :2], axis=1)
        factor = np.where(ahead < -0.1 * beside, 0.3, 1.0)
        factor = factor * np.clip(beside / (0.35 * size), 0.05, 1.0)
        heights = tip[:, 2] - place.ground
        least = min(0.25, 0.35 * size)
        factor = factor * np.clip(heights / least, 0.02, 1.0)
        lowest = centres[:, :, 2].min(axis=1) - place.ground
        factor = factor * np.where(lowest < 0.02, 0.1, 1.0)
        if place.box is not None:
            low, high = place.box
            points = np.concatenate([centres, tip[:, None]], axis=1)
            # joints that start in the body, such as a lift's, cannot but be there
            own = (
                (self._chain.places(self._middle[None])[0] > low)
                & (self._chain.places(self._middle[None])[0] < high)
            ).all(axis=2)[0]
            inside = ((points > low) & (points < high)).all(axis=2)
            inside[:, :-1] &= ~own
            factor = factor * np.where(inside.any(axis=1), 0.1, 1.0)
        result: Array = factor
        return result


def _simplified(q: Array, joints: Sequence[Joint], score: _Score, low: Array, high: Array) -> Array:
    """Zero or the middle where that costs little, rounded numbers elsewhere."""

    def value(posture: Array) -> float:
        return float(score(posture[None])[0])

    for i, joint in enumerate(joints):
        simple = [0.0] if low[i] <= 0.0 <= high[i] else []
        for choice in (*simple, _rounded(0.5 * (low[i] + high[i]), joint)):
            trial = q.copy()
            trial[i] = choice
            if low[i] <= choice <= high[i] and value(trial) >= (1.0 - _LOSS) * value(q):
                q = trial
                break
    return np.array(
        [
            _rounded(float(x), joint, (joint.lower, joint.upper))
            for x, joint in zip(q, joints, strict=True)
        ]
    )


def _rounded(
    value: float, joint: Joint, limits: tuple[float, float] = (-math.inf, math.inf)
) -> float:
    step = _STEP[joint.prismatic]
    rounded = round(round(value / step) * step, 4)
    inside = limits[0] <= rounded <= limits[1]
    return rounded + 0.0 if inside else min(max(value, limits[0]), limits[1])
