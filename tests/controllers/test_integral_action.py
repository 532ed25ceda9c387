"""Laws that reject a constant disturbance: by an integral, or by an observer."""

from __future__ import annotations

import numpy as np
import pytest
from support.errors import largest_after
from support.states import random_states
from support.task_errors import errors_at

import mobman as mm
from mobman.controllers.task_errors import TaskSpace
from mobman.model.criterion import Posture
from mobman.simulation.plant import Plant

PUSHED = mm.Scenario(name="pushed", disturbances=[{"type": "constant", "acceleration": 2.0}])


class Standing:
    """A point where the tip is to stay."""

    def __init__(self, point):
        self._rows = (np.array(point), *np.zeros((3, 3)))

    def desired(self, t):
        return self._rows


def test_error_obeys_the_equation_of_three_poles():
    """e'' + K_v e' + K_p e + K_i (integral of e) = 0 at the second tick."""
    robot, dt = mm.load_robot("tiago_no_hand"), 1e-2
    task = mm.make_task("circle", robot)
    space = TaskSpace(robot, task, Posture.of(robot))
    for _, z in random_states(robot, 5, 71):
        law = mm.make_controller("computed-torque-integral", K_p=20.0, K_v=8.0, K_i=30.0)
        law.reset(robot, task, dt)
        q, z = robot.q_rest + 0.05, 0.2 * z
        law.step(0.3, q, z, np.zeros(robot.nz))
        first = errors_at(space, 0.3, q, z).e
        torque = law.step(0.3, q, z, np.zeros(robot.nz))
        z_dot = Plant(robot).acceleration(0.3, q, z, torque)
        e = errors_at(space, 0.3, q, z)
        e_ddot = e.J @ z_dot + e.J_dot_z - e.p_ddot
        residual = e_ddot + 8.0 * e.e_dot + 20.0 * e.e + 30.0 * dt * first
        assert np.abs(residual).max() < 1e-8 * max(1.0, np.abs(e_ddot).max())


# The default K_F does not hold the platform, and the integral alone takes about 1 s for a factor of e,
# not the 0.2 s of its poles: 6.4e-5 m after 6 s, 2.4e-7 after 12; with the paper's K_F 3e-7 after 5.5.
# Presumably since a push that is constant in z' changes with the posture in the task's errors.
@pytest.mark.parametrize(
    ("law", "duration"),
    [
        pytest.param("computed-torque-integral", 14.0, marks=pytest.mark.slow),
        ("time-delay", 6.0),
        ("disturbance-observer", 6.0),
    ],
)
def test_constant_disturbance_is_rejected(law, duration, youbot):
    """At a point the error goes to 0; without integral or observer it stays where the push takes it."""
    task = Standing(youbot.tip_pose(youbot.q_rest).translation)
    record = mm.simulate(youbot, law, task, duration=duration, scenario=PUSHED, dt=2e-3)
    assert record.ok, record.message
    assert largest_after(record, duration - 0.5) < 1e-6
    other = mm.simulate(youbot, "extended-jacobian", task, duration=6.0, scenario=PUSHED, dt=2e-3)
    assert largest_after(other, 5.5) > 1e-2


@pytest.mark.parametrize("law", ["computed-torque-integral", "time-delay"])
def test_nothing_winds_up_at_limits_that_act(law, youbot):
    """One second a metre away, where no torque within the limits is enough; and the same without any."""
    task, none = Standing(youbot.tip_pose(youbot.q_rest).translation), np.zeros(youbot.nz)
    q = youbot.q_rest.copy()
    q[youbot.joint_names.index("base_x")] += 1.0
    integrals, torques = [], []
    for limit in (0.5, np.inf):
        controller = mm.make_controller(law)
        controller.limit_motors(np.full(youbot.nz, limit))
        controller.reset(youbot, task, 0.01)
        for tick in range(100):
            torque = controller.step(0.01 * tick, q, none, none)
        integrals.append(np.abs(controller._state).max())
        torques.append(np.abs(torque).max())
    assert integrals[0] < 0.1 < 0.9 < integrals[1]
    if law == "time-delay":
        assert torques[0] <= 0.5
        assert torques[1] > 10.0
