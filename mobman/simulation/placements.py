"""Placements: starts other than a robot's rest, and tasks placed there, the same for all laws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from mobman.arrays import Array
from mobman.errors import MobmanError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.sensors import pose_index
from mobman.simulation.singularity import Prediction, predict_singularity
from mobman.tasks.paths import GAP, SHARE_OF_RADIUS, place_of
from mobman.tasks.task import Task, make_task, parameters_of, require_freedom, time_of

_DRAWS = 50
_SPREAD = 0.3  # rad or m, of the arm's start about its rest
_ROOM = 1.0  # m, of the platform's start about its rest
_STEP = 0.1  # s, of following a task
_LAPS = 2.0  # that are foreseen of a path that closes
_HORIZON = 20.0  # s, of one that does not
_LEAST = 0.25  # of sigma_min(J_e) at rest: what is left of it on the way


class Placement(NamedTuple):
    """A start, and a task that is placed there."""

    q0: Array
    """Configuration (m, rad), shape (nq,)."""
    parameters: dict[str, Any]
    """Parameters of the task, drawn ones among them."""
    task: Task


def placements(
    robot: MobileManipulator,
    numbers: Iterable[int],
    task: str = "circle",
    given: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
) -> dict[int, Placement]:
    """Starts and tasks by number; a number has the same ones whichever others are asked for.

    Number 0 is the robot's rest with the task as it is given. At the others the platform starts within
    1 m of its rest, at any heading, and the arm within 0.3 rad (or m) of its rest and within its limits.
    Of the task's parameters, those that are not given are drawn: ``radius``, 0.5 to 1.5 times that of
    ``circle``; ``gap``, 0.5 to 2 times that; ``rate``, 0.6 to 1.2 times the default, either way round.

    Draws are repeated until the solution of the extended task
    (:func:`~mobman.simulation.singularity.predict_singularity`) can be followed for two laps, with
    N (H + D) N^T definite and a quarter of sigma_min(J_e) at rest, so that a car gets no circle beside
    it. Of a task that leads from rest near a singularity only half of what is left there is asked, and
    nothing of one that leads to it: some are made for that.

    Args:
        robot: The robot.
        numbers: Of the placements, 0 or more.
        task: Name of the task.
        given: Parameters that are not drawn.
        seed: Of all of them, 0 or more.

    Raises:
        UsageError: If 50 draws give none, or the task cannot be made at rest or asks for too much.
    """
    if not isinstance(given, Mapping | None):
        raise UsageError(f"task options = {given!r}: expected a dictionary")
    given = dict(given or {})
    rest = Placement(robot.q_rest.copy(), given, make_task(task, robot, **given))
    require_freedom(robot, rest.task)
    found: dict[int, Placement] = {}
    ahead: Prediction | None = None
    for number in numbers:
        if number == 0:
            found[0] = rest
            continue
        ahead = ahead or _ahead(robot, rest)
        random = np.random.default_rng([seed, number])
        for _ in range(_DRAWS):
            try:
                drawn = _drawn(robot, task, given, random)
                if _as_good(_ahead(robot, drawn), ahead):
                    found[number] = drawn
                    break
            except MobmanError:  # no such task from there
                continue
        else:
            raise UsageError(
                f"robot {robot.name!r}: none of {_DRAWS} random starts of the task {task!r} can be "
                f"followed; try 'mobman robots check {robot.name}'"
            )
    return found


def _ahead(robot: MobileManipulator, placed: Placement) -> Prediction:
    task, q0 = placed.task, placed.q0
    period = time_of(task, "period")
    duration = _LAPS * period if period else time_of(task, "duration") or _HORIZON
    return predict_singularity(robot, task, duration=duration, q0=q0, step=_STEP)


def _as_good(drawn: Prediction, rest: Prediction) -> bool:
    """True if what lies ahead is no worse than asked, which is no more than what rest has."""
    if rest.ended:
        return True
    least = min(_LEAST * float(rest.sigma_tip[0]), 0.5 * float(rest.sigma_tip.min()))
    definite = drawn.stiffness.min() > 0.0 or rest.stiffness.min() <= 0.0
    return not drawn.ended and bool(definite and drawn.sigma_tip.min() >= least)


def _drawn(
    robot: MobileManipulator, task: str, given: Mapping[str, Any], random: np.random.Generator
) -> Placement:
    q0, arm, model = robot.q_rest.copy(), robot.arm_index, robot.model
    lower = np.maximum(model.lowerPositionLimit, robot.q_rest - _SPREAD)
    upper = np.minimum(model.upperPositionLimit, robot.q_rest + _SPREAD)
    q0[arm] = random.uniform(lower, upper)[arm]
    if base := pose_index(robot):
        q0[base[:-1]] += random.uniform(-_ROOM, _ROOM, len(base) - 1)
        q0[base[-1]] += random.uniform(-math.pi, math.pi)
    q0 = robot.consistent(q0)
    place, defaults = place_of(robot, q0), {p.name: p.default for p in parameters_of(task)}
    radius = place.size * random.uniform(0.5, 1.5)
    gap = GAP if place.drives else SHARE_OF_RADIUS * given.get("radius", radius)
    turn = random.uniform(0.6, 1.2) * random.choice([-1.0, 1.0])
    drawn = {"radius": radius, "gap": gap * random.uniform(0.5, 2.0)}
    drawn["rate"] = defaults.get("rate", 0.0) * turn
    parameters = {**{name: float(drawn[name]) for name in drawn if name in defaults}, **given}
    return Placement(q0, parameters, make_task(task, robot, q0, **parameters))
