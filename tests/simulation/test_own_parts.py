"""Controllers and tasks of the user's own: any object with the contract's methods."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from support.runs import Still, Torque

import mobman as mm
from mobman.errors import UsageError


class Upright:
    """Gravity compensation and damping, with everything that a controller may offer."""

    name = "upright"

    def __init__(self):
        self.calls = []

    def reset(self, robot, task, dt):
        self.robot, self.task, self.dt = robot, task, dt
        self.size = 0.0

    def step(self, t, q, z, z_dot):
        self.calls.append((t, q.shape, z.shape, z_dot.shape))
        dynamics = self.robot.dynamics(q, 0 * z)
        self.size = np.linalg.norm(z)
        return np.linalg.solve(dynamics.B, dynamics.bias - 2.0 * z)

    def settings(self):
        return {"damping": 2.0}

    def signals(self):
        return {"own/size": self.size, "own/twice": np.full(2, self.size)}


class Line:
    """A straight line in the plane, quintic in time: two components."""

    def __init__(self, start, end, duration):
        self.start, self.way, self.duration = np.array(start), np.subtract(end, start), duration

    def desired(self, t):
        s, d = min(t / self.duration, 1.0), self.duration
        shape = (
            10 * s**3 - 15 * s**4 + 6 * s**5,
            (30 * s**2 - 60 * s**3 + 30 * s**4) / d,
            (60 * s - 180 * s**2 + 120 * s**3) / d**2,
            (60 - 360 * s + 360 * s**2) / d**3 if s < 1.0 else 0.0,
        )
        return (self.start + self.way * shape[0], *(self.way * value for value in shape[1:]))


def test_own_controller_is_driven_as_the_contract_says(youbot):
    controller, task = Upright(), Still([1.0, 0.0, 0.3])
    record = mm.simulate(youbot, controller, task, duration=0.05, dt=5e-3)
    assert (controller.robot.spec, controller.robot.urdf) == (youbot.spec, youbot.urdf)
    assert controller.task is task
    assert controller.dt == 5e-3
    assert [call[0] for call in controller.calls] == pytest.approx(record.t.tolist())
    assert {call[1:] for call in controller.calls} == {((8,), (5,), (5,))}
    assert record.status == "ok"


def test_own_controller_is_recorded_by_its_name_settings_and_signals(youbot, tmp_path):
    record = mm.simulate(youbot, Upright(), Still([1.0, 0.0, 0.3]), duration=0.05)
    assert record.controller == "upright"
    assert record.task == "Still"
    assert record.settings == {"damping": 2.0}
    assert record.signals["own/size"].shape == (51,)
    assert np.allclose(record.signals["own/size"], np.linalg.norm(record.z, axis=1))
    back = mm.load_record(record.save(tmp_path / "run.h5"))
    for name in ("own/size", "own/twice"):
        assert np.array_equal(back.signals[name], record.signals[name])


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        ({"q": 1.0}, "the signal 'q' has the name of a record's own part"),
        ({"metrics/x": 1.0}, "the signal 'metrics/x' has the name of a record's own part"),
        *(
            ({name: 1.0}, "a signal has the name .*; allowed: text")
            for name in (5, "", "a//b", "a\0")
        ),
        ({"a": 1.0, "a/b": 1.0}, "a signal has the name 'a/b'; .*no part of another signal's"),
        ({"a/b": 1.0, "a": 1.0}, "a signal has the name 'a'; .*no part of another signal's"),
        ({"a": "x"}, "the signal 'a' is 'x': must be numbers"),
        ({"a": [[1.0], [1.0, 2.0]]}, "the signal 'a' is .*: must be numbers, of one shape"),
        (5, "the controller's signals are 5: expected a dictionary"),
    ],
    ids=str,
)
def test_signals_that_no_file_can_hold_are_refused(youbot, signals, words):
    """At the first tick, not when the record is saved."""
    controller = Upright()
    controller.signals = lambda: signals
    with pytest.raises(UsageError, match=words):
        mm.simulate(youbot, controller, "circle", duration=0.01)


@pytest.mark.parametrize(
    ("torque", "words"),
    [
        ("abc", "is 'abc': it must be numbers"),
        ([1j] * 5, "it must be numbers"),
        ([1.0], "5 m"),
    ],
)
def test_torques_that_are_none_are_refused(youbot, torque, words):
    with pytest.raises(UsageError, match=f"the controller's torque .*{words}"):
        mm.simulate(youbot, Torque(lambda t: torque), "circle", duration=0.01)


def test_settings_that_are_no_dictionary_are_refused(youbot):
    controller = Upright()
    controller.settings = lambda: 5
    with pytest.raises(UsageError, match="the controller's settings are 5: expected a dictionary"):
        mm.simulate(youbot, controller, "circle", duration=0.01)


def test_settings_that_json_cannot_hold_are_recorded_as_text(youbot, tmp_path):
    class Odd(Upright):
        def settings(self):
            return {"odd": {(1, 2): np.longdouble(1), 3: {4}, "a": np.eye(1)}, 5: 1j}

    record = mm.simulate(youbot, Odd(), Still([1.0, 0.0, 0.3]), duration=0.01)
    back = mm.load_record(record.save(tmp_path / "run.h5"))
    assert back.settings == {"odd": {"(1, 2)": "1.0", "3": "{4}", "a": [[1.0]]}, "5": "1j"}


def test_two_methods_are_enough(youbot):
    record = mm.simulate(youbot, Torque(lambda t: np.zeros(5)), "circle", duration=0.02)
    assert record.controller == "Torque"
    assert record.settings == {}
    assert record.signals == {}
    assert "success" in record.metrics


def test_torque_may_be_a_list(youbot):
    record = mm.simulate(youbot, Torque(lambda t: [0, 0, 0, 0, 1]), "circle", duration=0.01)
    assert record.torque.tolist() == [[0.0, 0.0, 0.0, 0.0, 1.0]] * 11


def test_torque_that_the_controller_reuses_is_recorded_as_it_was(youbot):
    buffer = np.zeros(5)

    def grow(t):
        buffer[4] = t
        return buffer

    record = mm.simulate(youbot, Torque(grow), "circle", duration=0.01)
    assert np.allclose(record.torque[:, 4], record.t)


def test_controller_cannot_change_the_plants_state(youbot):
    class Meddling(Torque):
        def step(self, t, q, z, z_dot):
            q[:] = 7.0
            z[:] = 7.0
            return np.zeros(5)

    meddled = mm.simulate(youbot, Meddling(None), "circle", duration=0.02)
    plain = mm.simulate(youbot, Torque(lambda t: np.zeros(5)), "circle", duration=0.02)
    assert np.array_equal(meddled.q, plain.q)


def test_gravity_compensation_holds_the_arm(youbot):
    """The torque's meaning and sign: arm up, wheels still, nothing moves."""
    record = mm.simulate(youbot, Upright(), Still([0.0, 0.0, 0.0]), duration=0.2)
    assert np.abs(record.q - youbot.q_rest).max() < 1e-9


@pytest.mark.parametrize("law", ["tsm", "pseudo-inverse", "extended-jacobian"])
def test_planar_task_is_followed(youbot, law):
    """Two components: x and y of the tip; the height is left to the criterion."""
    start = youbot.tip_pose(youbot.q_rest).translation[:2]
    task = Line(start, start + np.array([0.3, 0.2]), 2.0)
    record = mm.simulate(youbot, law, task, duration=4.0, dt=1e-2)
    assert record.task_error.shape[1] == record.tip_position.shape[1] == 2
    assert record.auxiliary_error.shape[1] == youbot.nz - 2
    assert np.allclose(
        record.tip_position[-1], youbot.tip_pose(record.q[-1]).translation[:2], atol=1e-12
    )
    moved = np.linalg.norm(record.tip_position[-1] - record.tip_position[0])
    assert np.isclose(moved, np.hypot(0.3, 0.2), atol=1e-3)
    assert np.linalg.norm(record.task_error[-1]) < 1e-4


def test_own_task_in_space(youbot):
    """The tip is held where it is, against gravity."""
    here = youbot.tip_pose(youbot.q_rest).translation
    record = mm.simulate(youbot, "tsm", Still(here), duration=1.0, dt=1e-2)
    assert np.abs(record.task_error).max() < 1e-2
    assert np.allclose(record.tip_desired, here)


@pytest.mark.parametrize("thing", [object(), "tsm".upper, np.zeros(5)])
def test_what_is_no_controller_is_refused(youbot, thing):
    with pytest.raises(UsageError, match="is not a controller: expected methods reset"):
        mm.simulate(youbot, thing, "circle", duration=0.1)


def test_what_is_no_task_is_refused(youbot):
    with pytest.raises(UsageError, match=r"is not a task: expected a method desired"):
        mm.simulate(youbot, "tsm", object(), duration=0.1)


def test_task_of_a_wrong_dimension_is_refused(youbot):
    with pytest.raises(UsageError, match="5 components"):
        mm.simulate(youbot, "tsm", Still(np.zeros(5)), duration=0.1)


class Meddler:
    """Changes all that it can reach of its robot, and the rounding of the processor's arithmetic."""

    def __init__(self):
        self._inner = mm.make_controller("pseudo-inverse")

    def reset(self, robot, task, dt):
        self._inner.reset(robot, task, dt)
        for inertia in robot.model.inertias:
            inertia.mass *= 2.0
        robot.model.gravity.linear = np.zeros(3)
        for values in (robot.q_rest, robot.criterion_weights, robot.criterion_couplings):
            values += 0.1

    def step(self, t, q, z, z_dot):
        torque = self._inner.step(t, q, z, z_dot)
        ctypes.CDLL(None).fesetround(0x800)  # upward on x86
        return torque


def test_a_law_that_changes_its_robot_or_the_rounding_alters_no_later_run(youbot):
    def state():
        return mm.simulate(youbot, "pseudo-inverse", "circle", duration=0.02).state_sha256

    before = state()
    mm.simulate(youbot, Meddler(), "circle", duration=0.02)
    assert state() == before
    assert np.all(youbot.q_rest == mm.load_robot("youbot").q_rest)
    one, little = map(float, ("1", "5e-17"))  # not constants, which Python adds beforehand
    assert one + little == one  # rounded upward it would be the next number
