"""Fixtures that several folders use; they last for the session, since none of them changes."""

from __future__ import annotations

import importlib
import os
import signal
import tempfile
from contextlib import ExitStack
from functools import cache

import numba
import pytest

# robots that the user of this machine has added are none of the tests' business
os.environ["XDG_DATA_HOME"] = tempfile.mkdtemp(prefix="mobman-tests-")

from support.kernels import compile_kernels
from support.swept import PLATFORM, swept

import mobman as mm
from mobman.viewer.page import BrowserError, BrowserMissingError
from mobman.viewer.page import browser as running_browser

# Folders and files whose tests wait for browsers and other processes. They start first: a file of
# theirs that starts last would keep one worker busy long after the others have ended.
SLOW = (
    *("viewer", "running", "packaging", "compiled", "tuning", "cli", "docs"),
    *("test_make_targets.py", "test_optional_browser.py"),
)


def pytest_collection_modifyitems(items):
    """Sorted so, in the order that they have otherwise."""
    items.sort(key=lambda item: not any(part in SLOW for part in item.path.parts))


def pytest_configure(config):
    """Let long runs not compile their kernels together, which takes some ten seconds for each
    combination of law, robot, task and scenario and changes no bit
    (tests/compiled/test_joined_kernels.py); those of ``make test-slow`` do, as a user's."""
    if "slow" not in config.option.markexpr.replace("not slow", ""):
        importlib.import_module("mobman.simulation.simulate")._MANY_TICKS = 10**6


def pytest_sessionstart(session):
    """Compile what most tests need once, before several processes would at the same time; no test then
    meets the line which says that it takes a while."""
    if not hasattr(session.config, "workerinput") and not numba.config.DISABLE_JIT:
        compile_kernels()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One more than there are cores: a third of the time, tests wait for other processes."""
    return (os.cpu_count() or 1) + 1


# Tests that need a browser are skipped where none is installed, unless this variable is set.
REQUIRED = "MOBMAN_REQUIRE_BROWSER"
NO_BROWSER = "no browser is installed; it is optional, and make browser installs one"


@pytest.fixture(scope="session")
def browser():
    """A browser without a window, one for all tests; without one, the test is skipped.

    A browser that does not start, or that ``MOBMAN_BROWSER`` names and is not there, is a failure.
    """
    with ExitStack() as stack:
        try:
            running = stack.enter_context(running_browser())
        except BrowserMissingError as error:
            if os.environ.get(REQUIRED):
                pytest.fail(f"{REQUIRED} is set, but {error}", pytrace=False)
            pytest.skip(NO_BROWSER)
        except BrowserError as error:
            pytest.fail(str(error), pytrace=False)
        yield running


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_terminal_summary(terminalreporter):
    """Count the tests of all processes that were skipped without a browser, in the last lines."""
    result = yield
    skipped = terminalreporter.stats.get("skipped", [])
    if count := sum(NO_BROWSER in str(report.longrepr) for report in skipped):
        tests = "test" if count == 1 else "tests"
        terminalreporter.write_line(
            f"browser: none found, {count} {tests} skipped (make browser installs one)", yellow=True
        )
    return result


@pytest.fixture
def interruptible():
    """Let SIGINT interrupt this process, and those that it starts, as from a terminal.

    A shell without job control ignores it in what it starts in the background, and a process passes
    on what it ignores.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@cache
def loaded(name):
    """A robot of mobman's, loaded once for all files of tests."""
    return mm.load_robot(name)


def of_type(*platforms):
    """The robots on these platforms; those that are swept only in ``make test-slow`` are marked."""
    return swept(name for name, platform in PLATFORM.items() if platform in platforms)


@pytest.fixture(scope="session", params=swept())
def robot(request):
    """Every robot that comes with mobman in turn."""
    return loaded(request.param)


@pytest.fixture(scope="session", params=of_type(*{*PLATFORM.values()} - {"fixed"}))
def driving_robot(request):
    """Every one of them whose platform moves."""
    return loaded(request.param)


@pytest.fixture(scope="session", params=of_type("differential"))
def differential_robot(request):
    """Every one of them on a differential platform."""
    return loaded(request.param)


@pytest.fixture(scope="session", params=of_type("fixed"))
def fixed_robot(request):
    """Every one of them that does not drive."""
    return loaded(request.param)


@pytest.fixture(scope="session")
def youbot():
    return loaded("youbot")


@pytest.fixture(scope="session")
def tiago():
    return loaded("tiago_no_hand")
