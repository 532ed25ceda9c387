"""Fixtures that several folders use; they last for the session, since none of them changes."""

from __future__ import annotations

import pytest

import mobman as mm


@pytest.fixture(scope="session", params=mm.list_robots())
def robot(request):
    """Every registered robot in turn."""
    return mm.load_robot(request.param)


@pytest.fixture(scope="session")
def youbot():
    return mm.load_robot("youbot")


@pytest.fixture(scope="session")
def tiago():
    return mm.load_robot("tiago_no_hand")
