"""What a tick of the closed loop costs, beside what it cannot do without and what others cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from peers.bare_pinocchio import make_bare_controller, make_bare_tick
from peers.plain_loop import plain_loop

from measure.cases import DT, case_of, replay, tape
from measure.rounds import Measure, Spread, batch, interleaved, once, ratio
from mobman.errors import MobmanError
from mobman.model.mobile_manipulator import MobileManipulator

RATIOS = {
    "tick_over_bare": ("tick", "bare_tick"),
    "step_over_bare": ("step", "bare_controller"),
    "step_over_pink": ("step", "pink_solve"),
    "plain_over_tick": ("plain_tick", "tick"),
    "tick_over_mujoco": ("tick", "mujoco_step"),
}
"""What is divided by what."""


def measure_robot(
    robot: MobileManipulator, rounds: int, batch_seconds: float, ticks: int
) -> dict[str, Any]:
    """All measurements of one robot, interleaved.

    Args:
        robot: The robot.
        rounds: How often each is repeated.
        batch_seconds: About how long a batch of short calls takes (s).
        ticks: Length of the runs, 1 ms each; ratios of runs of different lengths do not compare,
            since a run has a fixed cost too.

    Returns:
        ``seconds``: medians and quartiles of one call by name, ``ratios`` the same of
        :data:`RATIOS`, ``notes``: why one is missing, by name, and ``joints``, ``nz``, ``ticks``.
    """
    case = case_of(robot)
    notes: dict[str, str] = {}
    controller = case.controller()
    measures: dict[str, Measure] = {
        "bare_controller": batch(make_bare_controller(robot), batch_seconds),
        "bare_tick": batch(make_bare_tick(robot), batch_seconds),
        "step": replay(case, tape(case, ticks)),
        "tick": once(lambda: case.run(ticks, controller=controller), ticks),
        "one_tick_run": once(lambda: case.run(1, controller=controller)),
    }
    for name, make in _peers().items():
        try:
            measures[name] = batch(make(robot), batch_seconds)
        except ImportError as error:
            notes[name] = f"not installed: {error}"
        except MobmanError as error:  # not installed either, or not for this robot: it says which
            notes[name] = f"not measured: {error}"
    if robot.spec.platform.type == "differential":
        measures["plain_tick"] = once(
            lambda: plain_loop(robot, case.task, case.gains, ticks * DT), ticks
        )
    else:
        notes["plain_tick"] = "not measured: written for a differential platform only"
    taken = interleaved(measures, rounds)
    # without what a run costs once: checks, provenance, arrays
    taken["tick_alone"] = (ticks * taken["tick"] - taken["one_tick_run"]) / (ticks - 1)
    return {
        "joints": robot.nq,
        "nz": robot.nz,
        "ticks": ticks,
        "seconds": {name: asdict(Spread.of(values)) for name, values in taken.items()},
        "ratios": ratios(taken),
        "notes": notes,
    }


def ratios(taken: dict[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Medians and quartiles of :data:`RATIOS`, those of which both sides were measured."""
    return {
        name: asdict(ratio(taken[above], taken[below]))
        for name, (above, below) in RATIOS.items()
        if above in taken and below in taken
    }


def _peers() -> dict[str, Callable[[MobileManipulator], Callable[[], None]]]:
    """Makers of other projects' steps; each fails, and says so, if its project is not installed."""

    def pink_solve(robot: MobileManipulator) -> Callable[[], None]:
        from peers.pink_ik import make_pink_solve

        return make_pink_solve(robot)

    def pink_step(robot: MobileManipulator) -> Callable[[], None]:
        from peers.pink_ik import make_pink_step

        return make_pink_step(robot)

    def mujoco_step(robot: MobileManipulator) -> Callable[[], None]:
        from peers.mujoco_step import make_mujoco_step

        return make_mujoco_step(robot)

    return {"pink_solve": pink_solve, "pink_step": pink_step, "mujoco_step": mujoco_step}


def real_time(robot: MobileManipulator, rounds: int, simulated: float) -> dict[str, Any]:
    """How much faster than real time a robot runs at 1 kHz on one core, all included.

    Args:
        robot: The robot.
        rounds: Runs.
        simulated: Duration of each (s).
    """
    case = case_of(robot)
    taken = interleaved(
        {"run": once(lambda: case.run(round(simulated / DT)))}, rounds, warm_up=False
    )
    return {"simulated": simulated, "factor": asdict(Spread.of(simulated / taken["run"]))}
