"""A tip that is measured: what a law whose model is wrong is told of where it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task, task_entry


class MeasuredTip:
    r"""A task for a law whose tip is measured: the desired motion, less what the law's model errs by.

    A law finds :math:`f(q) - p_d` and :math:`J z - \dot p_d` with a model's f and J. With
    :math:`p_d - (p - f)` and :math:`\dot p_d - (\dot p - J z)` for what it takes for desired, these are
    the errors of the measured position p and velocity :math:`\dot p`, for any law, and its Jacobian
    is the model's. The same of a pose with the rotation :math:`R_d R^T R_f` and the velocity
    :math:`\Omega_d - R_d R^T (\omega - \omega_f)` of the tip's R and the model's R_f; the axis of a
    pointing task turns by :math:`R_f R^T`.

    Args:
        task: The task.
        robot: The law's robot.

    Attributes:
        task: As given; what a task may have in addition is its.
    """

    def __init__(self, task: Task, robot: MobileManipulator) -> None:
        self.task = task
        self._model, self._pose = Buffers(robot), len(task.desired(0.0)[0]) == 7
        self._away, self._turn, self._spin = np.zeros((2, 3)), np.eye(3), np.zeros(3)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or "task" not in vars(self):
            raise AttributeError(name)
        return getattr(self.task, name)

    def look(self, q: Array, z: Array, true: Buffers, q_dot: Array) -> None:
        """Measure the tip.

        Args:
            q: The configuration that the law is given, shape (nq,).
            z: The same of the velocity, shape (nz,).
            true: The true robot at its state; ``tip_kinematics`` are called before.
            q_dot: Its true q', shape (nq,).
        """
        model = self._model
        model.q[:], model.z[:] = q, z
        model.velocity()
        model.run_jacobians()
        model.tip_kinematics()
        model.tip_orientation()
        true.tip_orientation()
        velocity, supposed = true.tip_jacobian @ q_dot, model.tip_jacobian @ model.q_dot
        self._away[0] = true.tip - model.tip
        self._away[1] = velocity[:3] - supposed[:3]
        R, R_f, omega, omega_f = true.tip_rotation, model.tip_rotation, velocity[3:], supposed[3:]
        if self._pose:
            self._turn, self._spin = R.T @ R_f, R.T @ (omega - omega_f)
        else:
            self._turn = R_f @ R.T
            self._spin = omega_f - self._turn @ omega

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """See :class:`Task`."""
        parts = [np.array(part, dtype=float) for part in self.task.desired(t)]
        self._shift(*parts[:2])
        return parts[0], parts[1], parts[2], parts[3]

    def entry(self, t: Array, p_d: Array) -> Callable[[], None]:
        """See :class:`Task`."""
        own = task_entry(self.task, t, p_d)

        def desire() -> None:
            own()
            self._shift(p_d[0], p_d[1])

        return desire

    def _shift(self, place: Array, rate: Array) -> None:
        """Change p_d and p_d' in place."""
        m = min(3, len(place))
        place[:m] -= self._away[0, :m]
        rate[:m] -= self._away[1, :m]
        if self._pose:
            w, x, y, z = place[3:7]
            R_d = pin.Quaternion(w, x, y, z).matrix()
            rate[3:6] -= R_d @ self._spin
            x, y, z, w = pin.Quaternion(R_d @ self._turn).coeffs()
            place[3:7] = w, x, y, z
        elif len(place) > 3:
            rate[3:6] = self._turn @ rate[3:6]
            place[3:6] = self._turn @ place[3:6]
            rate[3:6] += np.cross(self._spin, place[3:6])
