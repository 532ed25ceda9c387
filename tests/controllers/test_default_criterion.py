"""All laws with a criterion weigh it alike by default, so that comparisons are of the laws."""

from __future__ import annotations

import pytest

import mobman as mm

WITH_CRITERION = [
    name for name in mm.list_controllers() if hasattr(mm.make_controller(name).gains, "c_F")
]


@pytest.mark.parametrize("name", WITH_CRITERION)
def test_factor_and_weights(name):
    gains = mm.make_controller(name).gains
    assert gains.c_F == 1.0
    assert gains.K_F is None  # the robot's


def test_there_are_some():
    assert {"tsm", "extended-jacobian", "pseudo-inverse"} <= set(WITH_CRITERION)
