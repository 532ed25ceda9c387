"""What is imported when: nothing heavy before it is needed."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("numba", "llvmlite", "scipy", "h5py", "altair", "pandas", "pinocchio", "numpy", "jinja2")

REPORT = f"""
print("\\nloaded:", *[name for name in {HEAVY!r} if name in sys.modules])
"""


def _loaded(code: str) -> set[str]:
    """Which of the heavy packages a process has loaded after that code."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\n{REPORT}"],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return set(done.stdout.rpartition("\nloaded:")[2].split())


def test_import_of_the_package():
    assert _loaded("import mobman") == set()


@pytest.mark.parametrize(
    "arguments", [["--version"], ["--help"], ["run", "--help"], ["bench", "-h"]]
)
def test_command_line_that_computes_nothing(arguments):
    code = (
        "from mobman.cli.main import main\n"
        f"sys.argv = ['mobman', *{arguments!r}]\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code"
    )
    assert _loaded(code) <= {"numpy"}


def test_a_robot_needs_no_files_or_figures():
    assert not {"h5py", "altair", "pandas"} & _loaded(
        "import mobman as mm; mm.load_robot('youbot')"
    )


def test_a_closed_loop_needs_no_statistics():
    code = "import mobman as mm; mm.load_robot, mm.make_controller, mm.simulate"
    absent = "assert not {'scipy.stats', 'scipy.optimize'} & {*sys.modules}"
    assert "scipy" in _loaded(f"{code}; mm.make_controller('tsm'); {absent}")


def test_the_check_sees_what_is_loaded():
    """So that a test of this kind cannot pass by looking at nothing."""
    assert {"numpy", "numba"} <= _loaded("import mobman.compiled")
