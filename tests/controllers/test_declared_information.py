"""What laws say that they use of the measurement and of the model, against what changes their torque."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.controllers.protocol import INFORMATION, controllers

OWN = [
    name for name in mm.list_controllers() if controllers.get(name).__module__.startswith("mobman.")
]
TICKS, DT = 4, 1e-3


@pytest.mark.parametrize("law", OWN)
def test_every_law_of_mobman_says_what_it_uses(law):
    uses = controllers.get(law).uses
    assert uses
    assert set(uses) <= set(INFORMATION)
    assert len(set(uses)) == len(uses)


def _torques(law, robot, z_dot_factor=1.0, j_dot_factor=1.0, monkeypatch=None):
    """Torques of a few ticks in open loop."""
    given = {"a": 0.2, "A": 0.2} if hasattr(controllers.get(law).Gains, "A") else {}
    controller = mm.make_controller(law, **given)
    controller.reset(robot, mm.make_task("circle", robot), DT)
    random = np.random.default_rng(3)
    q, z = robot.q_rest + 0.1, 0.3 * random.standard_normal(robot.nz)
    z_dot = random.standard_normal(robot.nz)
    rows = []
    for tick in range(TICKS):
        rows.append(controller.step(tick * DT, q, z, z_dot_factor * z_dot).copy())
        q = q + DT * robot.velocity_map(q) @ z
        z = z + DT * z_dot
    return np.array(rows)


def _heavier(robot):
    model = robot.model.copy()
    for inertia in model.inertias:
        inertia.mass *= 1.5
        inertia.inertia = 1.5 * inertia.inertia
    model.gravity.linear = model.gravity.linear / 1.5  # the weight stays
    return robot.with_model(model)


def _weightless(robot):
    model = robot.model.copy()
    model.gravity.linear = 0.0 * model.gravity.linear
    return robot.with_model(model)


@pytest.mark.parametrize("law", OWN)
def test_what_is_declared_is_what_changes_the_torque(law, youbot):
    uses, torques = controllers.get(law).uses, _torques(law, youbot)
    scale = np.abs(torques).max()
    changed = {
        "z'": _torques(law, youbot, z_dot_factor=1.5),
        "bias": _torques(law, _weightless(youbot)),
    }
    if "bias" not in uses:  # else a heavier robot changes the Coriolis terms
        changed["M"] = _torques(law, _heavier(youbot))
    for name, others in changed.items():
        assert (np.abs(others - torques).max() > 1e-6 * scale) == (name in uses), name
