"""A payload may have a principal moment of 0, as a thin rod has."""

from __future__ import annotations

import pytest

from mobman.errors import SpecError
from mobman.simulation.scenario import Scenario


def _with(inertia):
    load = {"type": "payload", "mass": 1.0, "inertia": inertia}
    return Scenario.model_validate({"name": "rod", "inertias": [load]})


def test_thin_rod_is_a_body():
    assert _with([0.0, 0.02, 0.02]).inertias


@pytest.mark.parametrize("inertia", [[-1e-3, 0.02, 0.02], [0.0, 0.02, 0.03]])
def test_no_body_has_such_moments(inertia):
    with pytest.raises(SpecError, match="that of no body"):
        _with(inertia)
