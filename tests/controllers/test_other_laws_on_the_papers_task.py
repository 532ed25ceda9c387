"""The paper's other laws and the baselines on the paper's task, where the model is exact."""

from __future__ import annotations

import numpy as np
import pytest
from support.errors import largest_after, size_at

import mobman as mm


def _run(law, **options):
    gains = {"a": 0.2} if law.startswith("tsm") else {}
    return mm.simulate(
        "youbot", mm.make_controller(law, **gains), "paper", duration=10.0, **options
    )


@pytest.fixture(scope="module")
def baselines():
    laws = ("pseudo-inverse", "extended-jacobian", "damped-least-squares")
    return {law: _run(law, dt=5e-3) for law in laws}


def test_simplified_law_brings_the_tip_there_the_same_way():
    """Without a criterion: the same e^e, and auxiliary errors of any size."""
    record = _run("tsm-simplified", dt=5e-3)
    assert np.isclose(size_at(record, 2.0), 0.64, rtol=0.03)
    assert record.metrics["settling_time_1e-4"] <= 5.5
    assert largest_after(record, 7.0) < 1e-6
    assert record.signals["sliding/s"].shape[1] == 3
    assert largest_after(record, 7.0, record.auxiliary_error) > 0.1


def test_inverse_actuation_law():
    record = _run("tsm-inverse-actuation", dt=5e-3)
    assert record.metrics["settling_time_1e-4"] <= 5.5
    assert largest_after(record, 7.0) < 1e-6
    assert largest_after(record, 6.0, record.auxiliary_error) < 1e-4


@pytest.mark.parametrize("law", ["pseudo-inverse", "extended-jacobian", "damped-least-squares"])
def test_baselines_converge_where_the_model_is_exact(baselines, law):
    record = baselines[law]
    assert record.status == "ok"
    assert record.metrics["settling_time_1e-4"] <= 3.5
    assert largest_after(record, 7.0) < 1e-5


def test_baselines_converge_exponentially(baselines):
    """K_p = 25, K_v = 10: both poles at -5, so |e| falls as (1 + 5 t) exp(-5 t)."""
    for law in ("pseudo-inverse", "extended-jacobian"):
        record = baselines[law]
        for time in (0.5, 1.0, 1.5):
            # the target moves away at 1 m/s, the tip starts at rest: e(0), e'(0) = -p_d'(0)
            e0, e1 = record.task_error[0], np.array([0.0, -1.0, 0.0])
            expected = np.linalg.norm((e0 + (e1 + 5.0 * e0) * time) * np.exp(-5.0 * time))
            assert np.isclose(size_at(record, time), expected, rtol=0.05)


def test_extended_jacobian_drives_the_auxiliary_errors_to_zero(baselines):
    exact, descent = (
        largest_after(baselines[law], 7.0, baselines[law].auxiliary_error)
        for law in ("extended-jacobian", "pseudo-inverse")
    )
    assert exact < 1e-3
    assert exact < descent


def test_null_space_descent_leads_to_the_transversality_conditions():
    """The same tip motion; without the descent the auxiliary errors stay where damping leaves them."""
    left = []
    for k_0 in (0.0, 20.0):
        controller = mm.make_controller("pseudo-inverse", k_0=k_0)
        record = mm.simulate("youbot", controller, "paper", duration=5.0, dt=1e-2)
        assert record.metrics["task_error_final"] < 1e-3
        left.append(np.linalg.norm(record.auxiliary_error[-1]))
    assert left[1] < 0.05 * left[0]
