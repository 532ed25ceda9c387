"""States of another robot in a law's step: refused, with the shapes that were given and expected."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.errors import UsageError


@pytest.fixture(scope="module", params=["pseudo-inverse", "tsm"])
def law(request, youbot):
    gains = {"a": 0.2, "A": 0.004} if request.param == "tsm" else {}
    made = mm.make_controller(request.param, **gains)
    made.reset(youbot, mm.make_task("paper", youbot), 1e-3)
    return made


@pytest.mark.parametrize(("q", "z"), [(3, 5), (1, 5), (8, 1), (8, 8), (9, 5)])
def test_states_of_other_sizes_are_refused(law, youbot, q, z):
    with pytest.raises(UsageError) as caught:
        law.step(0.0, np.zeros(q), np.zeros(z), np.zeros(5))
    assert f"q has shape ({q},) and z ({z},); expected (8,) and (5,)" in str(caught.value)
    assert law.step(0.0, youbot.q_rest, np.zeros(5), np.zeros(5)).shape == (5,)
