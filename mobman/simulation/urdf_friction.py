"""The friction that a robot's URDF states, on its joints, as a piece of a scenario."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from mobman.arrays import Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.simulation.friction import Resistance, frictions
from mobman.simulation.pieces import Piece, Setting


class UrdfFriction(Piece):
    r"""``<dynamics damping="b" friction="c">`` of every joint that moves.

    A joint of rate :math:`\dot q_i` is braked by
    :math:`b_i\dot q_i + c_i\tanh(\dot q_i/\mathrm{velocity})`. The rates are
    :math:`\dot q = C B^{-T}r` for the motors' axes' rates :math:`r = B^T z`, so that the axes are braked
    by :math:`B^{-1}C^T` times that; C and B are those at rest, which are constant but for the wheels of
    a car, whose share in its speed depends on the steering.
    """

    factor: float = Field(1.0, ge=0)
    """Multiplies what the URDF states."""
    velocity: float = Field(0.05, gt=0)
    """Rate at which 76 % of ``friction`` is reached (rad/s, m/s)."""

    def start(self, setting: Setting) -> Resistance | None:
        """See :class:`Piece`."""
        robot = setting.robot
        moved = [i for i, n in enumerate(robot.joint_names) if n not in robot.platform.base_joints]
        damping = self.factor * robot.model.damping[moved]
        dry = self.factor * robot.model.upperDryFrictionLimit[moved]
        if not np.any(damping) and not np.any(dry):
            return None
        C = robot.velocity_map(robot.q_rest)
        B = C.T @ robot.actuation(robot.q_rest)
        share = np.ascontiguousarray(C[moved] @ np.linalg.inv(B).T)
        steepest, velocity = damping + dry / self.velocity, self.velocity
        slope = np.abs(share).T @ (steepest * np.abs(share).sum(axis=1))
        return Resistance(
            lambda rate, torque: bind(_brake, share, damping, dry, velocity, rate, torque), slope
        )


@kernel
def _brake(
    share: Matrix, damping: Vector, dry: Vector, velocity: float, rate: Vector, torque: Vector
) -> None:
    for i in range(share.shape[0]):
        own = 0.0
        for j in range(rate.shape[0]):
            own += share[i, j] * rate[j]
        braked = damping[i] * own + dry[i] * math.tanh(own / velocity)
        for j in range(rate.shape[0]):
            torque[j] -= share[i, j] * braked


frictions.register("urdf", UrdfFriction)
