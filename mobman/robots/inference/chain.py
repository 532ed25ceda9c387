"""Kinematics of one serial chain for many postures at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference.tree import Joint


class Chain:
    """The joints from the root link to a tip; other joints stay at zero.

    Args:
        joints: In order, in the root's frame at zero.
        tip: The tip's position with all joints at zero (m), shape (3,).
    """

    def __init__(self, joints: Sequence[Joint], tip: Array) -> None:
        self.joints = tuple(joints)
        self._tip = tip

    def places(self, q: Array) -> tuple[Array, Array, Array]:
        """Where joints and tip are.

        Args:
            q: Postures (m, rad), shape (m, n).

        Returns:
            Origins of the joints, shape (m, n, 3); their axes, shape (m, n, 3); the tip, (m, 3). All
            in the root's frame (m).
        """
        count = len(q)
        turn = np.broadcast_to(np.eye(3), (count, 3, 3))
        shift = np.zeros((count, 3))
        centres, axes = (
            np.empty((count, len(self.joints), 3)),
            np.empty((count, len(self.joints), 3)),
        )
        for i, joint in enumerate(self.joints):
            centres[:, i] = turn @ joint.centre + shift
            axes[:, i] = turn @ joint.axis
            if joint.prismatic:
                shift = shift + axes[:, i] * q[:, i, None]
            else:
                turn = turn @ rotation(joint.axis, q[:, i])
                shift = centres[:, i] - turn @ joint.centre
        return centres, axes, turn @ self._tip + shift

    def jacobian(self, q: Array) -> Array:
        """The tip's linear Jacobian for each posture (m/m, m/rad), shape (m, 3, n)."""
        centres, axes, tip = self.places(q)
        sliding = np.array([joint.prismatic for joint in self.joints])[None, :, None]
        columns = np.where(sliding, axes, np.cross(axes, tip[:, None] - centres))
        result: Array = columns.transpose(0, 2, 1)
        return result


def rotation(axis: Array, angles: Array) -> Array:
    """Rotations about one axis (unit vector, shape (3,)) by angles (rad, shape (m,)), (m, 3, 3)."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    result: Array = np.eye(3) + s * k + (1.0 - c) * (k @ k)
    return result
