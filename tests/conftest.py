"""Fixtures that several folders use; they last for the session, since none of them changes."""

from __future__ import annotations

import os
import tempfile

import pytest

# robots that the user of this machine has added are none of the tests' business
os.environ["XDG_DATA_HOME"] = tempfile.mkdtemp(prefix="mobman-tests-")

import mobman as mm
from mobman.robots.catalogue import find_spec, origin_of

OWN = [name for name in mm.list_robots() if origin_of(name) == "mobman"]
PLATFORM = {name: find_spec(name).platform.type for name in OWN}


# Folders whose tests wait for browsers and other processes. They start first: a file of theirs that
# starts last would keep one worker busy long after the others have ended.
SLOW = ("viewer", "running", "packaging", "kernels", "tuning", "cli", "docs")


def pytest_collection_modifyitems(items):
    """Sorted so, in the order that they have otherwise."""
    items.sort(key=lambda item: not any(part in SLOW for part in item.path.parts))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One more than there are cores: a third of the time, tests wait for other processes."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """By file, but the viewer's tests by robot, whose page serves several files."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class ByFileOrPage(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file = super()._split_scope(nodeid)
            first = nodeid.rpartition("[")[2].removesuffix("]").split("-")[0]
            return f"page of {first}" if "/viewer/" in file and first in PLATFORM else file

    return ByFileOrPage(config, log)


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
