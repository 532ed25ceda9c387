"""Kinematic model predictive control with preview and limits, ``mpc``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.controllers.baselines import computed_torque
from mobman.controllers.gains import CriterionGains, NotNegative, Positive, gain, whole
from mobman.controllers.motors import TorqueLimits
from mobman.controllers.protocol import controllers
from mobman.controllers.redundancy import LimitedProgram
from mobman.controllers.task_errors import Entry, TaskSpace
from mobman.errors import GainError
from mobman.linalg import apply, gram
from mobman.model.dynamics import Buffers
from mobman.model.metric import base_metric, unit_stiffness
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task, time_of


@dataclass(frozen=True, kw_only=True)
class PredictiveGains(CriterionGains):
    """Horizon and weights."""

    period: Positive = gain(0.02, "s", "time from one solution to the next, a multiple of dt")
    horizon: Positive = gain(0.8, "s", "time that is looked ahead")
    intervals: Annotated[int, whole(2, 50)] = gain(
        8, "1", "of the horizon, each with its acceleration; the later, the longer"
    )
    tau: Positive = gain(0.2, "s", "weight of e' against e: without limits e decays within it")
    rho: Positive = gain(1e-4, "s^4", "weight of the acceleration")
    mu: Positive = gain(1e-4, "s^2", "weight of z - z_0, what the tip leaves free")
    k_0: NotNegative = gain(
        2.0, "s^-1", "descent of the criterion in z_0, that of the stiffest motion"
    )
    k_z: NotNegative = gain(40.0, "s^-1", "rate at which z follows what is planned, at every tick")
    torque_limits: TorqueLimits = gain(None, "N m, N", "limits of |v|, by default those that act")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.period < self.horizon:
            raise GainError(f"horizon = {self.horizon!r}: must be above period = {self.period!r}")


class Node(NamedTuple):
    """The predicted state at the end of an interval, and how it depends on the accelerations U."""

    q: Array
    z: Array
    q_by_U: Array
    """Shape (nq, intervals nz)."""
    z_by_U: Array
    """Shape (nz, intervals nz)."""


@controllers.register("mpc")
class PredictiveControl(LimitedProgram):
    r"""A receding horizon: the motion ahead that costs least within all limits, and computed torque.

    Of the motions :math:`\dot q = Cz`, :math:`\dot z = u`, u piecewise constant, that with the least

    .. math:: \int |e|^2 + \tau^2|\dot e|^2 + \rho\,u^T\Omega^{-1}u
        + \mu\,(z - z_0)^T\Omega^{-1}(z - z_0)\,dt, \quad
        z_0 = -\frac{k_0}{\lambda_{max}}\Omega C^T\frac{\partial F}{\partial q},

    within the limits of torques, joint velocities and joint positions; then computed torque and a
    velocity loop, :math:`B v = M(u + k_z(z_r - z)) + Pz + G` with :math:`\dot z_r = u`, until the next
    solution. That starts from q and :math:`z_r`, so that the loop holds against what the model does not
    explain.

    The platform's constraints are in the prediction, so that the base turns and steers ahead of the tip.
    The quadratic program of one iteration of Gauss-Newton is solved every ``period``, along the last
    solution, a period later (real-time iteration). The torques' limits are those at the present M and
    bias; the first interval's are hard, all others soft. A solution takes no simulated time.

    Diehl, Bock and Schloder 2005; Pankert and Hutter 2020.
    """

    name = "mpc"
    extra = "mpc"
    Gains = PredictiveGains
    uses = ("M", "bias", "limits", "preview")
    signals_in_place = True

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again at rest, with the limits that act."""
        self._ahead, self._ticks = TaskSpace(robot, task), 0
        self._every = max(1, round(float(self.gains.period) / dt))
        self._defined = time_of(task, "duration") or np.inf  # a task has no later times
        self.cost = np.zeros(1)
        super().reset(robot, task, dt)

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits, shape (nz,)."""
        self._t = t
        v = super().step(t, q, z, z_dot)
        self._ticks += 1
        return v

    def signals(self) -> dict[str, Array]:
        """The cost of the last solution, before the iteration that improved it, shape (1,)."""
        return {"mpc/cost": self.cost}

    def entries(self, robot: MobileManipulator, task: Task) -> list[Entry]:
        gains, nz, space, z_dot = self.gains, robot.nz, self._space, self.values["z_dot"]
        self._robot, self._now, self._middle = robot, space, Buffers(robot)
        self._root = np.sqrt(base_metric(robot))
        first = self._every * self._dt
        self._ends = np.geomspace(first, max(float(gains.horizon), 2.0 * first), gains.intervals)
        h = self._h = np.diff(self._ends, prepend=0.0)
        self._U = np.zeros((len(h), nz))  # accelerations, in zeta = Omega^-1/2 z
        self._L = np.tril(np.tile(h, (len(h), 1)))  # zeta at the ends: zeta(0) + L U
        self._pull = float(gains.mu) * self._L.T * h
        weights = float(gains.rho) * np.diag(h) + self._pull @ self._L
        self._free_hessian = np.kron(weights, np.eye(nz))
        self._k_0 = float(gains.k_0) * unit_stiffness(robot, self.criterion)
        limits = robot.limits
        self._slow = np.flatnonzero(np.isfinite(limits.joint_velocity))
        self._bounded = np.flatnonzero(np.isfinite(limits.lower) | np.isfinite(limits.upper))
        self._motors = np.flatnonzero(np.isfinite(self._limits))
        k_z = float(gains.k_z) / (1.0 + float(gains.k_z) * self._dt)  # stable at every dt

        def act() -> int:
            if self._ticks == 0:
                self._z_r = space.now.z.copy()
            self._loop = k_z * (self._z_r - space.now.z)
            if self._ticks % self._every == 0:
                if self._ticks:  # the last solution, a period later
                    middles = self._ends - 0.5 * h + h[0]
                    self._U = self._U[np.minimum(np.searchsorted(self._ends, middles), len(h) - 1)]
                self._U += self._improvement()
            u = self._root * self._U[0]
            z_dot[:] = u + self._loop
            self._z_r = self._z_r + self._dt * u
            return 0

        return [act, self.entry(computed_torque)]

    def _improvement(self) -> Array:
        """The step of one iteration of Gauss-Newton from U, shape (intervals, nz)."""
        now, ahead, U, h, root = self._now, self._ahead, self._U, self._h, self._root
        tau, rho, mu = float(self.gains.tau), float(self.gains.rho), float(self.gains.mu)
        m, size, limits = now.p, U.size, self._robot.limits
        # e and e' at the ends of the intervals, linear in U
        rows, values, zeta_0 = np.zeros((size, 2 * m * len(h))), [], []
        A, lower, upper = self._torque_bounds()
        e_last, by_last, last = now.f - now.p_d[0], np.zeros((m, size)), max(self._defined, self._t)
        for k, node in enumerate(self._predicted()):
            ahead.at(min(self._t + float(self._ends[k]), last), node.q, node.z)
            e, by = ahead.f - ahead.p_d[0], ahead.gradient() @ node.q_by_U
            weight, rate = np.sqrt(h[k]), tau / h[k]
            part = np.concatenate([by, rate * (by - by_last)])
            rows[:, 2 * m * k : 2 * m * (k + 1)] = weight * part.T
            values += [weight * e, weight * rate * (e - e_last)]
            e_last, by_last = e, by
            C, q_dot, largest = ahead.now.C, ahead.now.q_dot, limits.joint_velocity
            zeta_0.append(-self._k_0 * root * (C.T @ self.criterion.gradient(node.q)))
            A += [C[self._slow] @ node.z_by_U, node.q_by_U[self._bounded]]
            lower += [(-largest - q_dot)[self._slow], (limits.lower - node.q)[self._bounded]]
            upper += [(largest - q_dot)[self._slow], (limits.upper - node.q)[self._bounded]]
        away = self._z_r / root + self._L @ U - np.array(zeta_0)
        # kernels in the place of BLAS, whose threads might add in another order
        H, f, r = np.zeros((size, size)), np.zeros(size), np.concatenate(values)
        gram(rows, H)
        apply(rows, r, f)
        self.cost[0] = r @ r + h @ (rho * U**2 + mu * away**2).sum(axis=1)
        H += self._free_hessian
        f += (rho * h[:, None] * U + self._pull @ away).ravel()
        every, least, largest = map(np.concatenate, (A, lower, upper))
        soft = np.arange(len(least)) >= len(self._motors)
        return self.solve(H, f, every, least, largest, soft).reshape(U.shape)

    def _torque_bounds(self) -> tuple[list[Array], list[Array], list[Array]]:
        """Rows and bounds of the torques of all intervals, the loop's present share included."""
        now, U, motors = self._now.now, self._U, self._motors
        force = np.column_stack([now.M * self._root, now.M @ self._loop + now.bias])
        torques = np.linalg.solve(now.B, force)[motors]
        v = (U @ torques[:, :-1].T + torques[:, -1]).ravel()
        limit = np.tile(self._limits[motors], len(U))
        every, blocks = np.arange(len(U)), np.zeros((len(U), len(motors), *U.shape))
        blocks[every, :, every] = torques[:, :-1]
        return [blocks.reshape(len(limit), U.size)], [-limit - v], [limit - v]

    def _predicted(self) -> list[Node]:
        """State to which U takes the robot, by the midpoint rule, and its derivatives by U."""
        now, at, root, U = self._now.now, self._middle, self._root, self._U
        own, place = self._robot.platform.equations, self._robot.platform_index
        rate, unit, alphas = np.zeros_like(at.N), np.eye(len(place)), self._robot.n_alpha
        nz, nodes = len(now.z), []
        node = Node(now.q.copy(), self._z_r, np.zeros((len(now.q), U.size)), np.zeros((nz, U.size)))
        for k, h in enumerate(self._h):
            at.q[:], at.z[:] = node.q, node.z
            at.velocity()
            by = np.zeros((nz, U.size))
            by[:, k * nz : (k + 1) * nz] = h * np.diag(root)
            q_by = node.q_by_U + 0.5 * h * (at.C @ node.z_by_U)
            at.q += 0.5 * h * at.q_dot
            at.z += 0.5 * h * root * U[k]
            at.velocity()
            q_dot_by = at.C @ (node.z_by_U + 0.5 * by)
            for i, direction in zip(place, unit, strict=True):  # d(C z)/dq
                own.velocity_map_rate(own.parameters, at.x, direction, rate)
                if rate.any():
                    q_dot_by[place] += np.outer(rate @ at.z[:alphas], q_by[i])
            z_next, z_by_next = node.z + h * root * U[k], node.z_by_U + by
            node = Node(node.q + h * at.q_dot, z_next, node.q_by_U + h * q_dot_by, z_by_next)
            nodes.append(node)
        return nodes
