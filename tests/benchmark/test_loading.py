"""The measurement of how long robots take to load."""

from __future__ import annotations

import subprocess
import sys

from mobman.files import resource_folder


def test_it_measures_the_robots_that_are_asked_for():
    script = resource_folder("benchmarks") / "loading.py"
    done = subprocess.run(
        [sys.executable, str(script), "youbot", "fixed_panda", "--repeats", "1"],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    rows = [line.split() for line in done.stdout.splitlines()[1:]]
    assert [row[0] for row in rows] == ["youbot", "fixed_panda"]
    assert all(float(number) > 0.0 for row in rows for number in row[1:])


def test_loading_compiles_nothing():
    """What makes loading slow is machine code; the equations are compiled when they first run."""
    alone = (
        "import gc; import mobman as mm; mm.load_robot('youbot'); "
        "kernels = [one for one in gc.get_objects() if type(one).__name__ == 'CPUDispatcher']; "
        "assert len(kernels) > 10 and not any(one.signatures for one in kernels)"
    )
    subprocess.run([sys.executable, "-c", alone], check=True, timeout=60)
