"""Computed torque with a disturbance observer, ``disturbance-observer``."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel, sequence
from mobman.controllers.baselines import TrackingGains, computed_torque, workspace
from mobman.controllers.gains import Positive, gain
from mobman.controllers.integral_action import StillAtLimits
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry
from mobman.linalg import dot
from mobman.model.dynamics import Buffers


@dataclass(frozen=True, kw_only=True)
class ObserverGains(TrackingGains):
    """Gains of the outer loop, and the observer's bandwidth."""

    K_O: Positive = gain(100.0, "s^-1", "bandwidth of the observer")


@controllers.register("disturbance-observer")
class DisturbanceObserver(StillAtLimits):
    r"""Law ``extended-jacobian``, less the estimate of what the nominal model does not explain:

    .. math:: B v = M \dot z_d + Pz + G + \hat D, \quad
        \dot{\hat D} = K_O\,(B v - M \dot z - Pz - G - \hat D).

    :math:`\hat D` is D of (17) behind a first-order low pass, here a wrong model included. Over a tick
    :math:`M\dot z` is the difference of z, so no acceleration is measured; with the exact step response
    of the low pass the observer is stable at every ``dt``. A tick in which a torque was beyond a limit
    that acts tells it nothing.

    K. Ohnishi, M. Shibata, T. Murakami, "Motion control for advanced mechatronics", IEEE/ASME
    Transactions on Mechatronics 1(1), 1996; W.-H. Chen, D. J. Ballance, P. J. Gawthrop, J. O'Reilly, "A
    nonlinear disturbance observer for robotic manipulators", IEEE Transactions on Industrial
    Electronics 47(4), 2000.
    """

    name = "disturbance-observer"
    Gains = ObserverGains
    signals_in_place = True

    def torque(self, now: Buffers, z_dot: Array, v: Array) -> Entry:
        share = -math.expm1(-float(self.gains.K_O) * self._dt)
        self.D, with_D, last_z_dot = np.zeros((3, len(v)))
        self._state = np.full(len(v), math.nan)  # the last z
        given = (now.M, now.bias, now.z, z_dot, share, self._dt)
        return sequence(
            bind(observe, *given, self._state, last_z_dot, self.D, with_D),
            bind(computed_torque, now.M, with_D, now.B, z_dot, v, *workspace(len(v))),
        )

    def stand_still(self, before: Array) -> None:
        """Take the next tick for the first: the torque of this one is not known."""
        self._state[:] = math.nan

    def signals(self) -> dict[str, Array]:
        """The estimate of D (N m, N), shape (nz,)."""
        return {"disturbance/estimate": self.D}


@kernel
def observe(
    M: Matrix,
    bias: Vector,
    z: Vector,
    z_dot: Vector,
    share: float,
    dt: float,
    last_z: Vector,
    last_z_dot: Vector,
    D: Vector,
    with_D: Vector,
) -> None:
    """Update the estimate D by the tick that is over, and write Pz + G + D.

    Under B v = M z'_d + Pz + G + D the observer's B v - M z' - Pz - G - D is M (z'_d - z').

    Args:
        M, bias, z: The robot now.
        z_dot: Acceleration that is wanted now, z'_d.
        share: What an update makes up for of the estimate's error.
        dt: Sampling period (s).
        last_z: z at the last tick; not a number before the first.
        last_z_dot: z'_d at the last tick.
        D: The estimate.
        with_D: For the result.
    """
    if math.isfinite(last_z[0]):
        for i in range(z.shape[0]):
            last_z_dot[i] -= (z[i] - last_z[i]) / dt
        for i in range(z.shape[0]):
            D[i] += share * dot(M[i], last_z_dot)
    for i in range(z.shape[0]):
        with_D[i] = bias[i] + D[i]
        last_z[i] = z[i]
        last_z_dot[i] = z_dot[i]
