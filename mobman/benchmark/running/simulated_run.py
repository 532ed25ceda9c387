"""From a suite's run to its simulation, wherever and whatever for it is done."""

from __future__ import annotations

from mobman.controllers.protocol import Controller
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.record import Record
from mobman.simulation.run_spec import RunSpec
from mobman.simulation.scenario import Scenario
from mobman.simulation.simulate import simulate
from mobman.tasks.task import make_task


def simulated_run(run: RunSpec, robot: MobileManipulator, controller: Controller) -> Record:
    """The record of a run.

    Args:
        run: The run; its task is registered.
        robot: The run's robot.
        controller: Its law with its gains.

    Raises:
        MobmanError: If the task cannot be made, or the simulation cannot begin.
    """
    given = run.task_given
    return simulate(
        robot,
        controller,
        # by name alone if that is all: the record says so then
        make_task(run.task_name, robot, **given) if given else run.task_name,
        duration=run.duration,
        dt=run.dt,
        scenario=Scenario.model_validate(run.scenario),
        seed=run.seed,
    )
