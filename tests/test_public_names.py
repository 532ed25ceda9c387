"""What ``import mobman as mm`` offers."""

from __future__ import annotations

import subprocess
import sys

import pytest

import mobman as mm

CONTRACT = [
    "list_robots", "load_robot", "register_robot", "list_controllers", "make_controller", "simulate",
    "load_record", "list_tasks", "list_scenarios", "make_task", "load_scenario", "view", "MobmanError",
    "Controller", "Task", "Record", "Scenario", "MobileManipulator", "__version__",
    "load_suite", "run_suite", "load_results", "list_suites", "Suite", "compare", "Comparison",
]  # fmt: skip


@pytest.mark.parametrize("name", CONTRACT)
def test_name_of_the_contract_is_there(name):
    assert getattr(mm, name) is not None
    assert name in mm.__all__
    assert name in dir(mm)


def test_everything_that_is_offered_is_there():
    for name in mm.__all__:
        assert getattr(mm, name) is not None


def test_other_names_are_not():
    with pytest.raises(AttributeError, match="module 'mobman' has no attribute 'simulat'"):
        mm.simulat  # noqa: B018


def test_version_is_that_of_the_package():
    assert mm.__version__.count(".") == 2


def test_importing_does_not_load_what_may_not_be_needed():
    code = "import sys, mobman; sys.exit('pinocchio' in sys.modules or 'h5py' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_package_is_typed():
    from importlib.resources import files

    assert (files("mobman") / "py.typed").is_file()


def test_controllers_and_tasks_are_known_by_their_methods():
    class Both:
        def reset(self, robot, task, dt): ...

        def step(self, t, q, z, z_dot): ...

        def desired(self, t): ...

    assert isinstance(Both(), mm.Controller)
    assert isinstance(Both(), mm.Task)
    assert not isinstance(object(), mm.Controller)
    assert not isinstance(object(), mm.Task)
