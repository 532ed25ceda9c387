"""mobman: control of non-holonomic mobile manipulators, on Pinocchio.

>>> import mobman as mm
>>> record = mm.simulate("youbot", "tsm", "paper", duration=0.05)
>>> record.status, record.torque.shape
('ok', (51, 5))
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mobman.version import __version__

if TYPE_CHECKING:
    from mobman.benchmark.results import load_results
    from mobman.benchmark.runner import run_suite
    from mobman.benchmark.suite import Suite, list_suites, load_suite
    from mobman.controllers.protocol import Controller, list_controllers, make_controller
    from mobman.errors import MobmanError
    from mobman.model.build import load_robot
    from mobman.model.mobile_manipulator import MobileManipulator
    from mobman.robots.catalogue import list_robots, register_robot
    from mobman.simulation.compare import Comparison, compare
    from mobman.simulation.record import Record, load_record
    from mobman.simulation.scenario import Scenario, list_scenarios, load_scenario
    from mobman.simulation.simulate import simulate
    from mobman.tasks.task import Task, list_tasks, make_task
    from mobman.viewer.view import view

# What `import mobman` offers, each loaded when it is first used: the command line and notebooks
# should not wait for what they do not need.
_PUBLIC = {
    "Comparison": "mobman.simulation.compare",
    "Controller": "mobman.controllers.protocol",
    "MobileManipulator": "mobman.model.mobile_manipulator",
    "MobmanError": "mobman.errors",
    "Record": "mobman.simulation.record",
    "Scenario": "mobman.simulation.scenario",
    "Suite": "mobman.benchmark.suite",
    "Task": "mobman.tasks.task",
    "compare": "mobman.simulation.compare",
    "list_controllers": "mobman.controllers.protocol",
    "list_robots": "mobman.robots.catalogue",
    "list_scenarios": "mobman.simulation.scenario",
    "list_suites": "mobman.benchmark.suite",
    "list_tasks": "mobman.tasks.task",
    "load_record": "mobman.simulation.record",
    "load_results": "mobman.benchmark.results",
    "load_robot": "mobman.model.build",
    "load_scenario": "mobman.simulation.scenario",
    "load_suite": "mobman.benchmark.suite",
    "make_controller": "mobman.controllers.protocol",
    "make_task": "mobman.tasks.task",
    "register_robot": "mobman.robots.catalogue",
    "run_suite": "mobman.benchmark.runner",
    "simulate": "mobman.simulation.simulate",
    "view": "mobman.viewer.view",
}

__all__ = [
    "Comparison",
    "Controller",
    "MobileManipulator",
    "MobmanError",
    "Record",
    "Scenario",
    "Suite",
    "Task",
    "__version__",
    "compare",
    "list_controllers",
    "list_robots",
    "list_scenarios",
    "list_suites",
    "list_tasks",
    "load_record",
    "load_results",
    "load_robot",
    "load_scenario",
    "load_suite",
    "make_controller",
    "make_task",
    "register_robot",
    "run_suite",
    "simulate",
    "view",
]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'mobman' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
