"""Laws to tune, for the tests of this folder alone."""

from __future__ import annotations

import pytest
from support.tuning import register

from mobman.benchmark.tuning.objective import objectives
from mobman.controllers.protocol import controllers


@pytest.fixture(autouse=True)
def _known_laws(monkeypatch):
    for registry in (controllers, objectives):
        registry.names()  # all that mobman has is there before the copy is made
        monkeypatch.setattr(registry, "_items", dict(registry._items))
    register()
