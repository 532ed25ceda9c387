"""Kernels that are compiled together, as for long runs, and one by one."""

from __future__ import annotations

import importlib

import numpy as np
import pytest

import mobman as mm
from mobman.compiled import bind, sequence, worth_joining
from mobman.linalg import apply, cholesky, copy

simulation = importlib.import_module("mobman.simulation.simulate")


@pytest.mark.parametrize(
    ("robot", "law", "scenario"),
    [
        ("youbot", "tsm", "nominal"),
        pytest.param("hunter_ur10", "extended-jacobian", "realistic", marks=pytest.mark.slow),
        ("ridgeback_panda", "tsm-inverse-actuation", "disturbed"),
    ],
)
def test_joined_kernels_give_the_same_bits(monkeypatch, robot, law, scenario):
    found = []
    for many in (10**9, 1):
        monkeypatch.setattr(simulation, "_MANY_TICKS", many)
        record = mm.simulate(robot, law, "circle", duration=0.03, scenario=scenario)
        assert record.status == "ok"
        found.append((record.state_sha256, record.auxiliary_error.tobytes()))
    assert found[0] == found[1]


def test_a_joined_sequence_ends_at_the_first_status():
    random = np.random.default_rng(1)
    a, x, y = random.standard_normal((3, 3)), random.standard_normal(3), np.zeros(3)
    lower, kept = np.zeros((3, 3)), np.zeros((3, 3))
    entries = bind(apply, a, x, y), bind(cholesky, -np.eye(3), lower), bind(copy, a, kept)
    with worth_joining(True):
        joined = sequence(*entries)
    for run in (joined, sequence(*entries)):
        y[:] = 0.0
        assert run() == 1
        assert np.allclose(y, a @ x, rtol=1e-14)
        assert not kept.any()
