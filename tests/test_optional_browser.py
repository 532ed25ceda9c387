"""Without a browser its tests are skipped and the summary says so; where it is required, they fail."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PICTURES = "tests/viewer/test_pictures.py"


def run(tmp_path, *options, **variables):
    """Run two tests that need a browser, where none is found unless the variables say otherwise."""
    inherited = {
        name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")
    }
    inherited.pop("MOBMAN_REQUIRE_BROWSER", None)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *options),
            *(f"{PICTURES}::test_transparent_picture_at_twice_the_size", f"{PICTURES}::test_mp4"),
        ],
        cwd=ROOT,
        env={
            **inherited,
            "PATH": str(tmp_path),
            "PLAYWRIGHT_BROWSERS_PATH": str(tmp_path),
            "MOBMAN_BROWSER": "",
            "NUMBA_DISABLE_JIT": "1",  # nothing is simulated
            **variables,
        },
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout.strip().splitlines()


def test_skipped_tests_are_counted_in_the_last_lines(tmp_path):
    status, lines = run(tmp_path, "-n", "1")
    assert status == 0
    assert lines[-2] == "browser: none found, 2 tests skipped (make browser installs one)"
    assert "2 skipped" in lines[-1]


@pytest.mark.slow
def test_where_a_browser_is_required_its_absence_fails(tmp_path):
    status, lines = run(tmp_path, MOBMAN_REQUIRE_BROWSER="1")
    assert status == 1
    assert "2 errors" in lines[-1]
    assert any("MOBMAN_REQUIRE_BROWSER is set, but" in line for line in lines)
    assert not any(line.startswith("browser: none found") for line in lines)


def test_a_browser_that_does_not_start_fails(tmp_path):
    program = tmp_path / "chromium"
    program.write_text("#!/bin/sh\nexit 1\n")
    program.chmod(0o755)
    status, lines = run(tmp_path)
    assert status == 1
    assert "2 errors" in lines[-1]
    assert any(f"the browser {program} does not start" in line for line in lines)


@pytest.fixture
def ignored():
    """SIGINT is ignored, as a shell leaves it for what it starts in the background."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ignored", "interruptible")
def test_children_of_interruptible_tests_heed_sigint():
    code = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    assert said.strip() == "True"


def test_all_tests_that_send_sigint_are_interruptible():
    sending = [
        path
        for path in ROOT.glob("tests/*/**/test_*.py")
        if "SIGINT" in path.read_text(encoding="utf-8")
    ]
    assert len(sending) >= 4
    for path in sending:
        assert "interruptible" in path.read_text(encoding="utf-8"), path
