"""Fixtures that several folders use; they last for the session, since none of them changes."""

from __future__ import annotations

import os
import signal
import tempfile
from contextlib import ExitStack

import pytest

# robots that the user of this machine has added are none of the tests' business
os.environ["XDG_DATA_HOME"] = tempfile.mkdtemp(prefix="mobman-tests-")

import mobman as mm
from mobman.robots.catalogue import find_spec, origin_of
from mobman.viewer.pictures import BrowserError, BrowserMissingError
from mobman.viewer.pictures import browser as running_browser

OWN = [name for name in mm.list_robots() if origin_of(name) == "mobman"]
PLATFORM = {name: find_spec(name).platform.type for name in OWN}


# Folders and files whose tests wait for browsers and other processes. They start first: a file of
# theirs that starts last would keep one worker busy long after the others have ended.
SLOW = (
    *("viewer", "running", "packaging", "compiled", "tuning", "cli", "docs"),
    *("test_make_targets.py", "test_optional_browser.py"),
)


def pytest_collection_modifyitems(items):
    """Sorted so, in the order that they have otherwise."""
    items.sort(key=lambda item: not any(part in SLOW for part in item.path.parts))


def pytest_sessionstart(session):
    """Compile what most tests need once, before several processes would at the same time; no test then
    meets the line which says that it takes a while."""
    if not hasattr(session.config, "workerinput"):
        for platform in dict.fromkeys(PLATFORM.values()):
            robot = next(name for name in OWN if PLATFORM[name] == platform)
            for law in mm.list_controllers() if platform == "differential" else ["tsm"]:
                mm.simulate(robot, law, "circle", duration=1e-3, scenario="realistic")


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


@pytest.fixture(scope="session", params=PLATFORM)
def robot(request):
    """Every registered robot in turn."""
    return mm.load_robot(request.param)


@pytest.fixture(scope="session", params=[n for n, kind in PLATFORM.items() if kind != "fixed"])
def driving_robot(request):
    """Every registered robot whose platform moves."""
    return mm.load_robot(request.param)


@pytest.fixture(scope="session", params=[n for n, k in PLATFORM.items() if k == "differential"])
def differential_robot(request):
    """Every registered robot on a differential platform."""
    return mm.load_robot(request.param)


@pytest.fixture(scope="session", params=[n for n, kind in PLATFORM.items() if kind == "fixed"])
def fixed_robot(request):
    """Every registered robot that does not drive."""
    return mm.load_robot(request.param)


@pytest.fixture(scope="session")
def youbot():
    return mm.load_robot("youbot")


@pytest.fixture(scope="session")
def tiago():
    return mm.load_robot("tiago_no_hand")
