"""What laws say that they use of the measurement and of the model, against what changes their torque."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.controllers.protocol import INFORMATION, controllers, information_of
from mobman.controllers.task_errors import TaskSpace

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


def _torques(law, robot, z_dot_factor=1.0, limited=False, task=None, **gains):
    """Torques of a few ticks in open loop."""
    given = {"a": 0.2, "A": 0.2} if hasattr(controllers.get(law).Gains, "A") else {}
    controller = mm.make_controller(law, **given, **gains)
    if limited and hasattr(controller, "limit_motors"):
        controller.limit_motors(np.full(robot.nz, 1.0))
    controller.reset(robot, task or mm.make_task("circle", robot), DT)
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


def _with_narrow_limits(robot, law):
    """Joints that are near their limits, and motors that can do next to nothing."""
    model = robot.model.copy()
    arm = robot.arm_index
    # adaptive finds its Gamma at postures within the limits, and then knows none
    sides = {} if law == "adaptive" else {"lowerPositionLimit": -0.11, "upperPositionLimit": 0.11}
    for name, side in sides.items():
        limit = getattr(model, name).copy()
        limit[arm] = robot.q_rest[arm] + side
        setattr(model, name, limit)
    model.effortLimit = np.full(model.nv, 1.0)
    model.velocityLimit = np.full(model.nv, 0.05)
    return robot.with_model(model)


class _Later:
    """A task that leaves its path after the ticks that are looked at."""

    def __init__(self, task):
        self.task = task

    def desired(self, t):
        p, *rates = self.task.desired(t)
        beyond = max(0.0, t - TICKS * DT)
        return (p + 0.5 * beyond**4, *rates)


def _without_j_dot(monkeypatch):
    at = TaskSpace.at

    def plain(self, t, q, z):
        at(self, t, q, z)
        self.J_dot_z[:] = 0.0

    monkeypatch.setattr(TaskSpace, "at", plain)


@pytest.mark.parametrize(
    ("law", "gains"), [*((law, {}) for law in OWN), ("tsm", {"saturation": "hedge"})]
)
def test_what_is_declared_is_what_changes_the_torque(law, gains, youbot, monkeypatch):
    uses, torques = information_of(law, gains), _torques(law, youbot, **gains)
    scale = np.abs(torques).max()
    changed = {
        "z'": _torques(law, youbot, z_dot_factor=1.5, **gains),
        "bias": _torques(law, _weightless(youbot), **gains),
        "limits": _torques(law, _with_narrow_limits(youbot, law), limited=True, **gains),
        "preview": _torques(law, youbot, task=_Later(mm.make_task("circle", youbot)), **gains),
    }
    if "bias" not in uses:  # else a heavier robot changes the Coriolis terms
        changed["M"] = _torques(law, _heavier(youbot), **gains)
    _without_j_dot(monkeypatch)
    changed["J'"] = _torques(law, youbot, **gains)
    for name, others in changed.items():
        assert (np.abs(others - torques).max() > 1e-6 * scale) == (name in uses), name
