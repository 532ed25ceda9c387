"""Pink's differential inverse kinematics on the robots of this project.

A step is that of Pink's own examples: move the target, ``pink.solve_ik`` with a task for the tip's
frame and one for the posture, integrate (which runs the kinematics and Jacobians of the next step).
The tip's position alone is tracked, as in this project's tasks.

Pink knows no non-holonomic constraints: here the base moves sideways as freely as forward, and
the wheels' angles follow nothing. What is compared is the cost of a step, kinematics only.

The QP solver is daqp, with quadprog (which is equal within the noise) the fastest of those tried.
Medians of a step in microseconds, on one machine and along the same targets:

========  ======  =============  ==========
solver    youbot  tiago_no_hand  tiago_dual
========  ======  =============  ==========
daqp      121     134            155
quadprog  121     139            157
piqp      146     195            259
========  ======  =============  ==========

clarabel and osqp take four times as long as daqp and more; proxqp takes 1.4 times as long on the
youBot and finds no solution at some place of the circle on the others. Nine tenths of a step are
spent outside the QP solver.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator

SOLVER = "daqp"
"""The QP solver, by its name in qpsolvers."""

DT = 1e-3
"""Time of a step (s)."""

RADIUS = 0.1
"""Radius of the target's circle (m); it lies in the world's y-z plane and starts at the tip."""

PERIOD = 4.0
"""Time of one turn of the target (s): it moves at 0.16 m/s."""

_POSITION_COST = 1.0  # 1/m
_POSTURE_COST = 1e-3  # 1/rad, as in Pink's examples
_UNBOUNDED = 1e8  # m or rad: limits from here on stand for none
_PLACES = 64  # how many places of the circle make_pink_solve goes through


class PinkTracking:
    """A tip that Pink moves along a circle.

    Args:
        robot: Whose model and tip; it starts at ``q_rest``. The model is copied.
        solver: The QP solver, by its name in qpsolvers.

    Attributes:
        configuration: ``pink.Configuration`` of now.
        tasks: The tip's and the posture's.

    Raises:
        UsageError: If Pink or the solver is not installed.
    """

    def __init__(self, robot: MobileManipulator, solver: str = SOLVER) -> None:
        self._pink = _pink(solver)
        from pink.tasks import FrameTask, PostureTask

        model = _without_wide_limits(robot.model)
        self.configuration = self._pink.Configuration(model, model.createData(), robot.q_rest)
        self._tip = FrameTask(robot.tip, position_cost=_POSITION_COST, orientation_cost=0.0)
        posture = PostureTask(cost=_POSTURE_COST)
        self.tasks: list[Any] = [self._tip, posture]
        for task in self.tasks:
            task.set_target_from_configuration(self.configuration)
        self._solver = solver
        self._start = self._tip.transform_target_to_world.translation.copy()
        self._steps = 0

    @property
    def distance(self) -> float:
        """From the tip to its target (m)."""
        now = self.configuration.get_transform_frame_to_world(self._tip.frame).translation
        return float(np.linalg.norm(now - self._tip.transform_target_to_world.translation))

    def move_target(self) -> None:
        """The target goes on by DT."""
        self._steps += 1
        angle = 2.0 * math.pi / PERIOD * DT * self._steps
        target = self._tip.transform_target_to_world.translation
        target[1] = self._start[1] + RADIUS * math.sin(angle)
        target[2] = self._start[2] + RADIUS * (math.cos(angle) - 1.0)

    def solve(self) -> Any:
        """The velocity towards the target, shape (nv,): one ``solve_ik``."""
        return self._pink.solve_ik(self.configuration, self.tasks, DT, solver=self._solver)

    def snapshot(self) -> PinkTracking:
        """A tracking of its own, standing where this one stands now."""
        other = copy.copy(self)
        now = self.configuration
        other.configuration = self._pink.Configuration(now.model, now.data, now.q)
        other.tasks = copy.deepcopy(self.tasks)
        other._tip = other.tasks[0]
        return other

    def step(self) -> None:
        """One step of DT: target, ``solve_ik``, integration with the next kinematics."""
        self.move_target()
        self.configuration.integrate_inplace(self.solve(), DT)


def make_pink_step(robot: MobileManipulator, solver: str = SOLVER) -> Callable[[], None]:
    """What does one whole step of Pink each time it is called; see :class:`PinkTracking`."""
    return PinkTracking(robot, solver).step


def make_pink_solve(robot: MobileManipulator, solver: str = SOLVER) -> Callable[[], None]:
    """What does one ``pink.solve_ik`` alone, on updated configurations along the circle in turn."""
    tracking = PinkTracking(robot, solver)
    places = []
    for _ in range(_PLACES):
        for _ in range(round(PERIOD / DT / _PLACES)):
            tracking.step()
        tracking.move_target()
        places.append(tracking.snapshot().solve)
    following = itertools.cycle(places).__next__

    def solve() -> None:
        following()()

    return solve


def _without_wide_limits(model: pin.Model) -> pin.Model:
    """A copy on which limits of 1e9 (no limits in truth) are infinite.

    Pink then leaves them out of its QP, as it does for a URDF's ``continuous`` joints; as numbers,
    they make the QP longer and so badly scaled that some solvers fail.
    """
    unbounded = model.copy()
    lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    lower[lower <= -_UNBOUNDED], upper[upper >= _UNBOUNDED] = -np.inf, np.inf
    unbounded.lowerPositionLimit, unbounded.upperPositionLimit = lower, upper
    return unbounded


def _pink(solver: str) -> Any:
    """The package, if it and the solver are installed."""
    try:
        import pink
        import qpsolvers
    except ImportError as error:
        raise UsageError(
            f"the comparison with Pink needs {error.name}; install it with: "
            "pip install 'mobman[speed]'"
        ) from error
    if solver not in qpsolvers.available_solvers:
        raise UsageError(
            f"qpsolvers has no {solver!r} here, only: "
            f"{', '.join(qpsolvers.available_solvers) or 'none'}; install it with: "
            "pip install 'mobman[speed]'"
        )
    return pink
