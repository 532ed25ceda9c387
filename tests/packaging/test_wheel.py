"""The wheel works away from the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

TRIAL = """
import mobman, mobman as mm, pathlib, sys
from mobman.compiled import kernel_files
assert len(kernel_files()) > 10
assert pathlib.Path(mobman.__file__).is_relative_to(sys.prefix), mobman.__file__
assert {"youbot", "tiago"} <= set(mm.list_robots())
record = mm.simulate("youbot", "tsm", "paper", duration=0.05)
assert record.ok, record.message
print(mobman.__version__)
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """An empty environment with the wheel in it; nothing of the checkout is on its path."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT],
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "env", with_pip=False)
    python = folder / "env" / "bin" / "python"
    install = ("install", "--no-deps", "--no-index", "--no-compile", wheel)
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", python, *install],
        check=True,
        capture_output=True,
    )
    # The libraries are those of this environment, so that nothing is downloaded. Plain paths in a .pth
    # file do not run the .pth files there, so the editable checkout stays out of reach.
    libraries = Path(sysconfig.get_paths()["purelib"])
    import pinocchio

    paths = {libraries, Path(pinocchio.__file__).parents[1]}
    site = next((folder / "env" / "lib").glob("python*/site-packages"))
    (site / "libraries.pth").write_text("\n".join(map(str, sorted(paths))) + "\n")
    return folder / "env" / "bin"


def test_wheel_simulates_away_from_the_checkout(environment, tmp_path):
    done = subprocess.run(
        [environment / "python", "-I", "-c", TRIAL],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )
    assert done.returncode == 0, done.stderr


# One kernel that calls others, from another file.
COMPILED = """
import numpy as np
from mobman.compiled import bind
from mobman.controllers.task_errors import tip_rates
J_f, rate, C = np.array([[1.0, 2.0]]), np.zeros((1, 2)), np.eye(2)
J, J_dot_z = np.zeros((1, 2)), np.zeros(1)
bind(tip_rates, J_f, rate, C, np.ones(2), np.array([1.0, 2.0]), J, J_dot_z)()
print(J_dot_z.tolist())
"""


def test_kernels_of_the_wheel_are_compiled(environment, tmp_path):
    """All that a run needs are compiled in the slow variant of the next test."""
    done = subprocess.run(
        [environment / "python", "-I", "-c", COMPILED], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, "[5.0]\n"), done.stderr


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_wheel_has_command_line_suites_and_report(environment, tmp_path, compiled):
    listing = subprocess.run(
        [environment / "mobman", "bench", "list"], cwd=tmp_path, capture_output=True, text=True
    )
    assert listing.returncode == 0, listing.stderr
    assert "paper" in listing.stdout
    suite = tmp_path / "one.toml"
    suite.write_text(
        'schema = 1\nname = "one"\nduration = 0.02\n[controllers.p]\nlaw = "pseudo-inverse"\n'
        '[[groups]]\nrobots = ["youbot"]\ntasks = ["circle"]\n'
    )
    done = subprocess.run(
        [environment / "mobman", "bench", "run", suite],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": str(int(not compiled))},
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results" / "one" / "report.html").is_file()
