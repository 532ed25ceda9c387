"""Compiling every kernel of the project at once, for all later processes."""

from __future__ import annotations

import os
import subprocess
import sys

from mobman.kernels.ahead import compile_ahead, compiled_ahead
from mobman.kernels.calling import _annotations, _compiled
from mobman.kernels.kernel import KERNELS, kernel


@kernel
def of_somebody_else(x: list) -> None:
    """Called by other kernels only, so that its annotation may be any."""


def test_every_kernel_of_the_project_is_compiled():
    """And none of others: what theirs are called with is not known."""
    compile_ahead()
    assert compiled_ahead()
    own = [function for function in KERNELS if function.__module__.startswith("mobman.")]
    assert len(own) > 40
    assert set(own) <= set(_compiled)
    assert all(_annotations(function.py_func) for function in own)
    assert of_somebody_else in KERNELS
    assert of_somebody_else not in _compiled


def test_nothing_is_claimed_where_numba_is_switched_off(tmp_path):
    code = (
        "from mobman.kernels.ahead import compile_ahead, compiled_ahead\n"
        "from mobman.kernels.cache import kernel_folder\n"
        "kernel_folder().mkdir(parents=True)\n"
        "compile_ahead()\n"
        "assert not compiled_ahead()\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, timeout=60)


RUNS = """
import mobman as mm
from mobman.robots.catalogue import find_spec
from mobman.simulation.scenario import list_scenarios

one_of = {find_spec(name).platform.type: name for name in mm.list_robots()}
runs = [("youbot", law, "circle", "nominal") for law in mm.list_controllers()]
runs += [(name, "tsm", "circle", "nominal") for name in one_of.values()]
runs += [("youbot", "tsm", "circle", scenario) for scenario in list_scenarios()]
runs += [("youbot", "tsm", task, "nominal") for task in mm.list_tasks() if "singular" not in task]
for name, law, task, scenario in dict.fromkeys(runs):
    record = mm.simulate(name, law, task, scenario=scenario, duration=0.004)
    record.save("run.h5")
print(len(runs))
"""


def test_a_run_has_nothing_left_to_compile(tmp_path):
    """Whatever its law, platform, task or scenario."""
    compile_ahead()
    done = subprocess.run(
        [sys.executable, "-c", RUNS], capture_output=True, text=True, cwd=tmp_path, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) > 30
