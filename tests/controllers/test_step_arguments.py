"""States of another robot in a law's step: refused, with the shapes that were given and expected."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

import mobman as mm
from mobman.errors import SingularityError, UsageError


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


@pytest.mark.parametrize("z_dot", [None, 5, np.zeros(3), np.zeros((5, 1)), ["a"] * 5], ids=repr)
def test_accelerations_of_other_sizes_are_refused(law, youbot, z_dot):
    with pytest.raises(UsageError, match=r"z_dot has shape .*; expected \(5,\), of numbers"):
        law.step(0.0, youbot.q_rest, np.zeros(5), z_dot)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", mm.list_controllers())
def test_states_that_are_not_finite_end_in_a_torque_that_is_not_or_a_singularity(name, youbot):
    """As a run that diverges; linear algebra's own errors are none of a law's."""
    law = mm.make_controller(name)
    law.reset(youbot, mm.make_task("paper", youbot), 1e-3)
    q, z = youbot.q_rest, np.zeros(5)
    for state in ((q, z * np.nan), (q, z + 1e200), (q * np.nan, z), (q * np.nan, z * np.nan)):
        with contextlib.suppress(SingularityError):
            assert not np.isfinite(law.step(0.0, *state, z)).all()


def test_a_gain_by_two_of_its_names_is_refused():
    with pytest.raises(UsageError, match="gain 'lambda_0' of 'tsm' is given twice"):
        mm.make_controller("tsm", lambda_0=1.0, lambda0=2.0)
