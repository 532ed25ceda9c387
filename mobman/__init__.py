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
_MODULES = {
    "mobman.benchmark.results": "load_results",
    "mobman.benchmark.runner": "run_suite",
    "mobman.benchmark.suite": "Suite list_suites load_suite",
    "mobman.controllers.protocol": "Controller list_controllers make_controller",
    "mobman.errors": "MobmanError",
    "mobman.model.build": "load_robot",
    "mobman.model.mobile_manipulator": "MobileManipulator",
    "mobman.robots.catalogue": "list_robots register_robot",
    "mobman.simulation.compare": "Comparison compare",
    "mobman.simulation.record": "Record load_record",
    "mobman.simulation.scenario": "Scenario list_scenarios load_scenario",
    "mobman.simulation.simulate": "simulate",
    "mobman.tasks.task": "Task list_tasks make_task",
    "mobman.viewer.view": "view",
}
_PUBLIC = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = [
    "Comparison", "Controller", "MobileManipulator", "MobmanError", "Record", "Scenario", "Suite",
    "Task", "__version__", "compare", "list_controllers", "list_robots", "list_scenarios",
    "list_suites", "list_tasks", "load_record", "load_results", "load_robot", "load_scenario",
    "load_suite", "make_controller", "make_task", "register_robot", "run_suite", "simulate", "view",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'mobman' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
