"""Singularity-robust task priority with avoidance of the joints' limits, ``task-priority``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mobman.arrays import Array
from mobman.controllers.baselines import (
    ResolvedAcceleration,
    SecondaryGains,
    computed_torque,
    tracking_acceleration,
)
from mobman.controllers.gains import NotNegative, Positive, condition, gain
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import Entry, Stop
from mobman.model.joint_limits import LimitZones
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.task_map import TaskMap
from mobman.tasks.task import Task

_POSTURES, _NEAR = 20, 0.5  # how many, within how much of the rest posture (rad, m)


_APART = condition("be at most 0.5, where both zones meet", lambda zone: zone <= 0.5)


@dataclass(frozen=True, kw_only=True)
class PriorityGains(SecondaryGains):
    """Gains of the tip's task, of the secondary one, and of the inverse near singularities."""

    k_l: NotNegative = gain(
        5.0, "s^-1", "speed away from a joint's limit in z_0, per depth in its zone"
    )
    zone: Annotated[NotNegative, _APART] = gain(
        0.1, "1", "share of a joint's range, at each end, that is avoided"
    )
    epsilon: Positive = gain(
        0.3, "1", "the inverse is damped below so many times sigma_min(J) near the rest posture"
    )


@controllers.register("task-priority")
class TaskPriority(ResolvedAcceleration):
    r"""Resolved acceleration of the tip, and below it a secondary task in its null space:

    .. math:: \dot z = J^\#(\ddot p_d - K_v \dot e - K_p e - \dot J z) + k_d (I - J^+ J) z_0
        - k_d (I - J^\# J) z, \quad
        z_0 = k_l d - \frac{k_0}{\lambda_{max}}\Omega C^T\frac{\partial F}{\partial q},
        \quad B v = M \dot z + Pz + G.

    d is how deep each joint of the arm is in the zone before its limit. All inverses are in the metric
    :math:`\Omega` of the base. With the singular values :math:`\sigma_i` of
    :math:`J\Omega^{1/2}`, those of :math:`J^\#` are :math:`\sigma_i/\max(\sigma_i, \epsilon)^2`: the
    damping :math:`\lambda_i^2 = \epsilon^2 - \sigma_i^2` below :math:`\epsilon`, 0 above. The
    projector of the secondary task is that of the exact :math:`J^+`, so that it never moves the tip, nor
    is it inverted: there are no algorithmic singularities.

    Chiaverini 1997; the damping: Maciejewski and Klein 1988; the limits: Liegeois 1977.
    """

    name = "task-priority"
    Gains = PriorityGains
    uses = ("M", "bias", "J'", "limits")

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        space, k, root = self._space, self.values, np.sqrt(base_metric(robot))
        now, wanted, z_dot, k_d, k_l = space.now, k["wanted"], k["z_dot"], k["k_d"], k["k_l"]
        k_0 = k["k_0"] * unit_stiffness(robot, self.criterion)
        epsilon = k["epsilon"] * usual_singular_value(robot, space.task_map, root)
        zones, back = LimitZones(robot, k["zone"]), np.zeros(robot.nz)

        def prioritise() -> int:
            # J Omega^1/2 = U S V^T, in the coordinates zeta = Omega^-1/2 z
            try:
                U, sigma, Vt = np.linalg.svd(space.J * root, full_matrices=False)
            except np.linalg.LinAlgError:  # J is not finite
                return Stop.NO_ACCELERATION
            damped = np.maximum(sigma, epsilon) ** 2
            back[robot.n_alpha :] = -k_l * zones.depth(now.q)
            secondary = back - k_0 * root**2 * (now.C.T @ self.criterion.gradient(now.q))
            zeta_0, zeta = secondary / root, now.z / root
            # k_d (I - V V^T) zeta_0 - k_d (I - V S^2/damped V^T) zeta
            along = sigma * (U.T @ wanted) / damped
            along += k_d * (sigma**2 / damped * (Vt @ zeta) - Vt @ zeta_0)
            z_dot[:] = root * (k_d * (zeta_0 - zeta) + along @ Vt)
            return 0

        return [self.entry(tracking_acceleration), prioritise, self.entry(computed_torque)]


def usual_singular_value(robot: MobileManipulator, task_map: TaskMap, root: Array) -> float:
    """The median of sigma_min(J Omega^1/2) over postures near the rest posture, which may be singular
    itself; ``root`` is the diagonal of Omega^1/2."""
    random, found = np.random.default_rng(0), []
    for _ in range(_POSTURES):
        q = robot.q_rest.copy()
        q[robot.arm_index] += random.uniform(-_NEAR, _NEAR, robot.n)
        q = robot.consistent(q)
        J = task_map.jacobian(robot.tip_kinematics(q, np.zeros(robot.nz))) @ robot.velocity_map(q)
        found.append(np.linalg.svd(J * root, compute_uv=False)[-1])
    return float(np.median(found))
