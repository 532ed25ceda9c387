"""The Pinocchio calls, from Python, that a closed-loop tick cannot do without: the floor of its cost.

States are prepared beforehand and change from call to call, so that what is measured is the calls
themselves, each on a state that Pinocchio has not just seen.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import pinocchio as pin

_STATES = 64
_SPREAD = 0.3  # rad or m: how far from rest
_SPEED = 0.5  # rad/s or m/s
_SEED = 20_240_607
_PLANT_STAGES = 4  # of RK4


def make_bare_controller(robot: Any) -> Callable[[], None]:
    """What a controller step needs: one Jacobian set with rates, crba and nonLinearEffects.

    Args:
        robot: A loaded robot, for its model, tip and rest posture.

    Returns:
        A function without arguments that does the calls of one step.
    """
    model, data = robot.model, robot.model.createData()
    tip, axes = robot.tip_frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    states = cycle(changing_states(robot))

    def controller() -> None:
        q, v = next(states)
        pin.computeJointJacobiansTimeVariation(model, data, q, v)
        pin.updateFramePlacement(model, data, tip)
        pin.getFrameJacobian(model, data, tip, axes)
        pin.getFrameJacobianTimeVariation(model, data, tip, axes)
        pin.crba(model, data, q)
        pin.nonLinearEffects(model, data, q, v)

    return controller


def make_bare_plant(robot: Any) -> Callable[[], None]:
    """What a step of RK4 needs: crba and nonLinearEffects at each of its four stages.

    Arguments and result as for :func:`make_bare_controller`.
    """
    model, data = robot.model, robot.model.createData()
    states = cycle(changing_states(robot))

    def plant() -> None:
        for _ in range(_PLANT_STAGES):
            q, v = next(states)
            pin.crba(model, data, q)
            pin.nonLinearEffects(model, data, q, v)

    return plant


def make_bare_tick(robot: Any) -> Callable[[], None]:
    """What a closed-loop tick needs: the controller's calls and the plant's.

    Arguments and result as for :func:`make_bare_controller`.
    """
    controller, plant = make_bare_controller(robot), make_bare_plant(robot)

    def tick() -> None:
        controller()
        plant()

    return tick


def changing_states(robot: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """(q, q') near the rest posture, each an array of its own, of shape (nq,)."""
    random = np.random.default_rng(_SEED)
    return [
        (
            robot.q_rest + random.uniform(-_SPREAD, _SPREAD, robot.nq),
            random.uniform(-_SPEED, _SPEED, robot.nq),
        )
        for _ in range(_STATES)
    ]
