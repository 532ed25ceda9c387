"""A policy, observation to action, as a controller: what a learned one sees and what it commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from mobman.arrays import Array
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.actuation import TorqueLevel
from mobman.simulation.integrator import FARTHEST, FASTEST
from mobman.simulation.pieces import Setting
from mobman.simulation.record_file import error_components
from mobman.tasks.task import Task

Actions = Literal["acceleration", "torque"]
_RISE, _SPEED, _PUSH = 0.5, 1.0, 10.0  # s; m/s, rad/s; m/s^2, rad/s^2: see the class


class PolicyController:
    """A controller that asks a policy.

    The observation has, in this order (:attr:`names`): the task error e and its rate e', shape (m,)
    each; q, shape (nq,); z, shape (nz,); for each coordinate with a limit how far it is inside (m, rad;
    negative: beyond); for each entry of z with a limit how far |z| is below it. All are computed from
    what the sensors show, with the nominal model.

    An action has nz entries from -1 to 1; others are clipped. With ``"acceleration"`` they are shares of
    the largest z', which reaches the velocity limit in 0.5 s (1 m/s or rad/s where there is none); the
    torque is that of the nominal model, B v = M z' + Pz + G. With ``"torque"`` they are shares of the
    motors' limits (without one: what holds the robot at rest, and gives the axis 10 rad/s^2 or m/s^2
    more).

    >>> import mobman as mm
    >>> import numpy as np
    >>> from mobman.bridges.policy import PolicyController
    >>> law = PolicyController(lambda observation: np.zeros(8))
    >>> mm.simulate("jackal_ur3", law, "circle", duration=0.05, dt=0.01).status
    'ok'

    Args:
        policy: Called with the observation, gives the action, or a pair of it and anything, as
            stable-baselines3's ``predict``.
        actions: What the actions are.

    Attributes:
        names: Names of the entries of an observation, once it is reset; ``low`` and ``high`` are their
            bounds, infinite where there is none.
        scale: What an action of 1 stands for, shape (nz,).
        uses: Information of the observation and, with ``"acceleration"``, of the torque
            (:data:`mobman.controllers.protocol.INFORMATION`); a subclass that uses more sets its own.

    Raises:
        UsageError: If there are no such actions.
    """

    name = "policy"
    uses: tuple[str, ...] = ("M", "bias", "limits")

    def __init__(self, policy: Callable[[Array], Any], actions: Actions = "acceleration") -> None:
        if actions not in ("acceleration", "torque"):
            raise UsageError(f"actions = {actions!r}: allowed: acceleration, torque")
        if not callable(policy):
            raise UsageError(f"policy = {policy!r}: expected a function")
        self.policy, self.actions = policy, actions
        if actions == "torque" and type(self).uses is PolicyController.uses:
            self.uses = ("limits",)

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """See :class:`mobman.Controller`."""
        self._robot, self._limits, self._space = robot, robot.limits, TaskSpace(robot, task)
        lower, upper, velocity = self._limits[:3]
        self._bounded = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        self._limited, m = np.flatnonzero(np.isfinite(velocity)), self._space.p
        joints, motors = robot.joint_names, robot.velocity_names
        named = {"e": error_components(m), "e'": error_components(m), "q": joints, "z": motors}
        named["margin/q"] = [joints[i] for i in self._bounded]
        named["margin/z"] = [motors[i] for i in self._limited]
        self.names = [f"{what}/{name}" for what, own in named.items() for name in own]
        within = 0.5 * (upper - lower)[self._bounded], velocity[self._limited]
        # |e_o| is 2 at half a turn; a run ends where others are beyond these
        error, free = np.where(np.arange(m) < 3, FARTHEST, 2.0), np.full(m + robot.nq, np.inf)
        self.high = np.concatenate([error, free, np.full(robot.nz, FASTEST), *within])
        self.low = -self.high
        self.low[2 * m + robot.nq + robot.nz :] = -np.inf
        self.scale = np.where(np.isfinite(velocity), velocity, _SPEED) / _RISE
        if self.actions == "torque":
            rule = TorqueLevel(torque=None, factor=1.0, acceleration=_PUSH)
            self.scale = rule.level(Setting(robot, dt, np.random.default_rng(0)))

    def observe(self, t: float, q: Array, z: Array) -> Array:
        """The observation at time t (s) and the measured state, shape (len(names),); SingularityError if
        the tip is half a turn away from the desired orientation."""
        space, limits = self._space, self._limits
        space.at(t, q, z)
        inside = np.minimum(q - limits.lower, limits.upper - q)[self._bounded]
        slower = (limits.velocity - np.abs(z))[self._limited]
        e, rate = space.f - space.p_d[0, : space.p], space.J @ z - space.p_d[1, : space.p]
        seen = np.concatenate([e, rate, q, z, inside, slower])
        return np.asarray(np.clip(seen, self.low, self.high))

    def checked(self, action: Any) -> Array:
        """The action as an array, shape (nz,); UsageError if it is not nz finite real numbers."""
        nz = self._robot.nz
        try:
            values = np.asarray(action)
        except (TypeError, ValueError):
            values = np.zeros(0)
        real = values.dtype.kind in "iuf" and not np.ma.is_masked(action)
        if values.shape != (nz,) or not real or not np.isfinite(values).all():
            raise UsageError(f"action = {action!r}: needed: {nz} finite numbers, from -1 to 1")
        return values.astype(float)

    def torque(self, action: Any, q: Array, z: Array) -> Array:
        """The torque (N m, N) of an action at the measured state, shape (nz,)."""
        values = self.checked(action)
        command = np.asarray(self.scale * np.clip(values, -1.0, 1.0))
        if self.actions == "torque":
            return command
        M, bias, B = self._robot.dynamics(q, z)
        return np.asarray(np.linalg.solve(B, M @ command + bias))

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """See :class:`mobman.Controller`."""
        action = self.policy(self.observe(t, q, z))
        pair = isinstance(action, tuple) and len(action) == 2
        if pair and np.shape(action[0]) == (self._robot.nz,):
            action = action[0]
        return self.torque(action, q, z)
