"""A run's samples at the rate of a display."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array, Index
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.simulation.record import Record
from mobman.viewer.encoding import packed

FRAMES_PER_SECOND = 60.0
"""Of most displays."""
MOST_FRAMES = 12_000
"""Of all runs of a page together; longer ones get fewer a second. The page goes from frame to frame
along cubics with the run's own rates, so that few frames do not show."""
_FEWEST = 600


@dataclass(frozen=True)
class Motion:
    """A run at N of its own samples."""

    t: Array
    """s, shape (N,)."""
    tip: Array
    """Tip position (m), shape (N, 3)."""
    desired: Array
    """p_d (m), shape (N, 3)."""
    error: Array
    """|e^e| (m), shape (N,)."""
    platform: Array
    """The platform's reference point (m), shape (N, 3)."""
    q: Array | None = None
    """Configuration, shape (N, nq); None without a robot."""
    q_dot: Array | None = None
    """Its rate, shape (N, nq)."""
    effort: Array | None = None
    """B' v: the generalised force on each coordinate (N m, N), shape (N, nq)."""

    def described(self) -> dict[str, Any]:
        """For the page."""
        doubles = {
            "t": self.t,
            "tip": self.tip,
            "desired": self.desired,
            "q": self.q,
            "q_dot": self.q_dot,
        }
        singles = {"error": self.error, "platform": self.platform, "effort": self.effort}
        return {
            name: None if array is None else packed(array, kind)
            for kind, arrays in (("f8", doubles), ("f4", singles))
            for name, array in arrays.items()
        }


def motion(record: Record, robot: MobileManipulator | None, *, runs: int = 1) -> Motion:
    """A run's motion.

    Args:
        record: The run.
        robot: Its robot; None if it is not known.
        runs: How many runs share the page.
    """
    kept = frames(record.t, max(_FEWEST, MOST_FRAMES // runs))
    q, z = record.q[kept], record.z[kept]
    tip, desired = _points(record.tip_position[kept]), _points(record.tip_desired[kept])
    error = np.linalg.norm(record.task_error[kept], axis=1)
    platform = np.zeros((len(kept), 3))
    for column, name in enumerate(BASE_JOINTS[:2]):
        if name in record.joint_names:
            platform[:, column] = q[:, record.joint_names.index(name)]
    if robot is None:
        return Motion(record.t[kept], tip, desired, error, platform)
    if record.tip_position.shape[1] < 3:  # a planar task says nothing of the height
        tip[:, 2] = desired[:, 2] = [robot.tip_pose(row).translation[2] for row in q]
    torque = record.torque[kept]
    return Motion(
        record.t[kept],
        tip,
        desired,
        error,
        platform,
        q=q,
        q_dot=np.array([robot.velocity_map(a) @ b for a, b in zip(q, z, strict=True)]),
        effort=np.array([robot.actuation(a) @ b for a, b in zip(q, torque, strict=True)]),
    )


def frames(t: Array, most: int = MOST_FRAMES) -> Index:
    """Which samples to show: the first, the last, and about 60 a second between, never more than
    ``most``.

    Args:
        t: Times of the samples (s), rising.
        most: Of them, 2 or more.
    """
    duration = float(t[-1] - t[0])
    count = min(most, int(np.ceil(duration * FRAMES_PER_SECOND)) + 1)
    if len(t) <= count:
        return np.arange(len(t))
    wanted = np.linspace(t[0], t[-1], max(count, 2))
    after = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    nearer = wanted - t[after - 1] < t[after] - wanted
    return np.unique(np.where(nearer, after - 1, after))


def _points(task_coordinates: Array) -> Array:
    """Points in space of a task's coordinates: a planar task is on the ground until it is lifted."""
    points = np.zeros((len(task_coordinates), 3))
    columns = min(3, task_coordinates.shape[1])
    points[:, :columns] = task_coordinates[:, :columns]
    return points
