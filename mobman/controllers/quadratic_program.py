"""Laws that solve quadratic programs with hard and soft bounds, by DAQP, which extras bring."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing

from mobman.arrays import Array
from mobman.controllers.baselines import ResolvedAcceleration
from mobman.controllers.limits import LimitedMotors, plain_limits
from mobman.errors import MobmanError, SingularityError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_SOFT, _HARD = 8, 0  # DAQP's kinds of constraints
_SOLVED = (1, 2)  # its exit flags: optimal; optimal with soft bounds that do not hold
_LIMIT = 1000  # iterations
_TOLERANCE = 1e-9  # of the bounds
Flags = np.typing.NDArray[np.bool_]
Solve = Callable[[Array, Array, Array, Array, Array, Flags], Array]


class LimitedProgram(LimitedMotors, ResolvedAcceleration):
    """Base of laws whose acceleration is a program's solution, with torques within ``torque_limits``.

    Raises:
        MobmanError: If the solver, of the extra named ``extra``, is not installed.
    """

    extra: str

    def __init__(self, gains: Any) -> None:
        super().__init__(gains)
        self._solve = solver(self.name, self.extra)

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again, with the limits that act."""
        self._limits = self.torque_limits(robot, self.gains.torque_limits)
        super().reset(robot, task, dt)
        self._settings |= {"torque_limits": plain_limits(self._limits)}

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque for the tick, within the limits, shape (nz,)."""
        v = super().step(t, q, z, z_dot)
        return np.clip(v, -self._limits, self._limits)  # the solver's tolerance


def solver(law: str, extra: str) -> Solve:
    """A function of (H, f, A, lower, upper, soft) that gives the x with the least x^T H x/2 + f^T x.

    lower <= A x <= upper holds where ``soft`` is False, shape (rows,); elsewhere as far as it can, a
    violation costing half a million times its square. H is positive definite, and bounds may be inf.
    The function raises SingularityError where no solution is found: the hard bounds have none, or
    numbers are not finite.

    Args:
        law: Name of the law that needs it, for the message.
        extra: What to install for it.

    Raises:
        MobmanError: If DAQP is not installed.
    """
    try:
        import daqp
    except ImportError as error:
        raise MobmanError(
            f"controller {law!r} needs daqp, which is not installed; install it with: "
            f"pip install 'mobman[{extra}]'"
        ) from error

    def solve(H: Array, f: Array, A: Array, lower: Array, upper: Array, soft: Flags) -> Array:
        kind = np.where(soft, _SOFT, _HARD).astype(np.int32)
        given: tuple[Any, ...] = (H, f, A, upper, lower, kind)
        x, _, flag, _ = daqp.solve(*given, iter_limit=_LIMIT, primal_tol=_TOLERANCE)
        if flag not in _SOLVED or not np.isfinite(x).all():
            raise SingularityError(
                f"the quadratic program of {law!r} has no finite solution (DAQP's exit flag: {flag})"
            )
        return np.array(x)

    return solve
