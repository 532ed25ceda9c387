"""Limits of a robot's joints and motors, as bounds of q, z and the torques."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array

_NO_BOUND = 1e8  # joints without limits have some 1e9 in the model


class Limits(NamedTuple):
    """Bounds; inf where a URDF states none (0 or a very large number, by convention)."""

    lower: Array
    """Of q (m, rad), shape (nq,)."""
    upper: Array
    """Of q (m, rad), shape (nq,)."""
    velocity: Array
    """Of each entry of |z| alone (m/s, rad/s), shape (nz,)."""
    torque: Array
    """Of each entry of |v| alone (N, N m), shape (nz,)."""


def limits(model: pin.Model, joints: list[int], C: Array, B: Array) -> Limits:
    """The limits of a robot, from those of its URDF's joints.

    A joint of the platform that turns at N_ij for one of alpha_j bounds it by its own largest rate over
    |N_ij|, and likewise B'' the torques.

    Args:
        model: The model.
        joints: Where the coordinates are in q that joints of the URDF move: all but the base's pose, on
            whose heading wheels do not depend.
        C: C of (9), shape (nq, nz).
        B: B' of (16), shape (nq, nz).
    """
    rate, effort = _stated(model.velocityLimit), _stated(model.effortLimit)
    per_velocity, per_torque = np.abs(C)[joints], np.abs(B)[joints]
    return Limits(
        lower=np.where(model.lowerPositionLimit < -_NO_BOUND, -np.inf, model.lowerPositionLimit),
        upper=np.where(model.upperPositionLimit > _NO_BOUND, np.inf, model.upperPositionLimit),
        velocity=_least(rate[joints], per_velocity),
        torque=_least(effort[joints], per_torque),
    )


def _stated(bound: Array) -> Array:
    result: Array = np.where((bound <= 0.0) | (bound > _NO_BOUND), np.inf, bound)
    return result


def _least(bounds: Array, per_entry: Array) -> Array:
    """The least bound over the factor, for each column of factors."""
    with np.errstate(divide="ignore"):
        ratios = np.where(per_entry > 0.0, bounds[:, None] / per_entry, np.inf)
    result: Array = ratios.min(axis=0, initial=np.inf)
    return result
