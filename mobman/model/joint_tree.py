"""Kinematics of a tree of joints from real or complex q, with their second derivatives."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array


class TreePose(NamedTuple):
    """A chain at one q, in the frame in which its first joint is placed."""

    axes: Array  # axes of rotation, 0 of joints that slide, shape (joints, 3)
    slides: Array  # directions of sliding, 0 of joints that turn, shape (joints, 3)
    frames: Array  # poses of the joints' frames, shape (joints, 4, 4)

    def jacobian(self, points: Array) -> Array:
        """dp/dq of points that all joints move, shape (points, joints, 3)."""
        J: Array = self.slides + np.cross(self.axes, points[:, None] - self.frames[:, :3, 3])
        return J

    def pairs(self) -> tuple[Array, Array]:
        """The earlier and the later one of each two joints, shapes (joints, joints).

        For them, d2p/dq_k dq_i = a_earlier x J_later.
        """
        k, i = np.indices((len(self.axes), len(self.axes)))
        return np.minimum(k, i), np.maximum(k, i)


class JointTree:
    """Joints of one degree of freedom, each placed on one of those before it or on the root.

    Args:
        model: Has the joints.
        joints: Their numbers in it.

    Attributes:
        joints: Their numbers, increasing.
        index: Their places in q.
        moves: True where joint i is joint k or is before it on the way from the root, shape (k, i).
    """

    def __init__(self, model: pin.Model, joints: Iterable[int]) -> None:
        self.joints, data = sorted(joints), model.createData()
        self.index = np.array([model.idx_qs[i] for i in self.joints], dtype=np.int64)
        self.moves = np.array([[i in model.supports[k] for i in self.joints] for k in self.joints])
        own = {joint: number for number, joint in enumerate(self.joints)}
        motions = [np.asarray(data.joints[i].S).reshape(6) for i in self.joints]
        self._slides = [motion[:3] for motion in motions]
        self._turns = [motion[3:] for motion in motions]
        self._steps = []
        for i, turn in zip(self.joints, self._turns, strict=True):
            cross = np.zeros((4, 4))
            cross[:3, :3] = pin.skew(turn)
            placement = model.jointPlacements[i].homogeneous
            self._steps.append((own.get(model.parents[i]), placement, cross, cross @ cross))

    def at(self, q: Array) -> TreePose:
        """The chain at q, shape (nq,), real or complex."""
        own = q[self.index]
        sines, versines = np.sin(own), 1.0 - np.cos(own)
        frames = np.empty((len(own), 4, 4), dtype=q.dtype)
        for k, (parent, placement, cross, square) in enumerate(self._steps):
            moved = np.eye(4) + sines[k] * cross + versines[k] * square
            moved[:3, 3] = own[k] * self._slides[k]
            frames[k] = placement @ moved if parent is None else frames[parent] @ placement @ moved
        # a joint's own motion leaves its axis as it is
        turned = frames[:, :3, :3]
        return TreePose(
            np.einsum("kij,kj->ki", turned, np.array(self._turns)),
            np.einsum("kij,kj->ki", turned, np.array(self._slides)),
            frames,
        )
