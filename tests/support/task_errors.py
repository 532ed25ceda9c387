"""Task errors of a task space, from what the laws see."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class TaskErrors(NamedTuple):
    """e, e' and what e'' = J z' + J' z - p_d'' is made of; all of p rows."""

    e: np.ndarray
    e_dot: np.ndarray
    J: np.ndarray
    J_dot_z: np.ndarray
    p_ddot: np.ndarray
    p_dddot: np.ndarray


def errors_of(space, z) -> TaskErrors:
    """The errors where the space has been filled last, z being that of the state."""
    p, p_dot, p_ddot, p_dddot = np.pad(space.p_d, ((0, 0), (0, space.p - space.p_d.shape[1])))
    J = space.J.copy()
    return TaskErrors(space.f - p, J @ z - p_dot, J, space.J_dot_z.copy(), p_ddot, p_dddot)


def errors_at(space, t, q, z) -> TaskErrors:
    """The errors at time t and state (q, z)."""
    space.at(t, q, z)
    return errors_of(space, z)
