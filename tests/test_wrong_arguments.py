"""What is given wrongly to a public function or method: one error that names it and what is expected."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import mobman as mm

VECTORS = ("q", "z", "q_dot", "multiplier")
NO_NUMBERS = [np.full(8, np.nan), np.full(8, 1j), "hello", None, ["a"] * 8]


@pytest.fixture(scope="module")
def record():
    return mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.02)


def refused(function, *expected):
    with pytest.raises(mm.MobmanError) as caught:
        function()
    assert "\n" not in str(caught.value)
    for text in expected:
        assert text in str(caught.value)


def methods_of_vectors():
    for name, method in inspect.getmembers(mm.MobileManipulator, inspect.isfunction):
        taken = list(inspect.signature(method).parameters)[1:]
        if not name.startswith("_") and taken and set(taken) <= set(VECTORS):
            yield name, taken


@pytest.mark.parametrize(("name", "taken"), [*methods_of_vectors()])
def test_methods_of_robots_take_vectors_of_their_length(youbot, name, taken):
    right = dict(zip(VECTORS, map(np.zeros, (8, 5, 8, 3)), strict=True)) | {"q": youbot.q_rest}
    method = getattr(youbot, name)
    method(**{key: right[key] for key in taken})
    for key in taken:
        size = len(right[key])
        for wrong in (np.zeros(size - 1), np.zeros((1, size)), np.zeros(())):
            given = {k: wrong if k == key else right[k] for k in taken}
            shapes = f"has shape {wrong.shape}; needed: ({size},)"
            refused(lambda g=given: method(**g), shapes, key[0])
        for wrong in NO_NUMBERS:
            given = {k: wrong if k == key else right[k] for k in taken}
            refused(lambda g=given: method(**g), "needed: ")


def test_more_than_a_few_methods_were_tried():
    assert len(list(methods_of_vectors())) > 12


@pytest.mark.parametrize("name", ["circle", "line", "lissajous", "pose", "pointing-circle"])
@pytest.mark.parametrize("t", [None, "x", np.nan, np.inf, np.zeros(3), 1j, [1.0]], ids=repr)
def test_desired_takes_a_time(name, t):
    task = mm.make_task(name, "tiago")
    refused(lambda: task.desired(t), "t = ", "expected a finite number (s)")
    assert np.array_equal(task.desired(np.float64(1.0))[0], task.desired(1)[0])


@pytest.mark.parametrize("name", mm.list_controllers())
def test_laws_say_that_reset_comes_first_and_what_it_takes(name, youbot):
    law, task = mm.make_controller(name), mm.make_task("paper", youbot)
    refused(
        lambda: law.step(0.0, youbot.q_rest, np.zeros(5), np.zeros(5)), "reset(robot, task, dt)"
    )
    for robot in ("youbot", None, 3):
        refused(lambda r=robot: law.reset(r, task, 1e-3), f"robot = {robot!r}: expected")
    for dt in (0.0, -1.0, np.nan, np.inf, "x", None, 1j):
        refused(lambda d=dt: law.reset(youbot, task, d), f"dt = {dt!r}: expected a number above 0")
    refused(lambda: law.reset(youbot, None, 1e-3), "None is not a task")


WRONG = {
    "make_task": (lambda: mm.make_task("circle", None), "None is not a robot"),
    "register_robot": (lambda: mm.register_robot(3), "3 is not a robot: expected a description or"),
    "load_robot": (lambda: mm.load_robot(3), "3 is not a robot"),
    "with_model": (lambda: mm.load_robot("youbot").with_model("m"), "model = 'm': expected"),
    "load_scenario": (lambda: mm.load_scenario(3), "3 is not a scenario: expected a name or"),
    "load_suite": (lambda: mm.load_suite(None), "None is not a suite: expected a name or"),
    "run_suite": (lambda: mm.run_suite(3, "x"), "3 is not a suite"),
    "its folder": (lambda: mm.run_suite("quick", None), "folder = None: expected a path"),
    "its workers": (lambda: mm.run_suite("quick", "x", workers="2"), "workers = '2': must be"),
    "its limit": (lambda: mm.run_suite("quick", "x", time_limit="x"), "time_limit = 'x': must be"),
    "its part": (lambda: mm.run_suite("quick", "x", part="1/2"), "part = '1/2': must be whole"),
    "its parts": (lambda: mm.run_suite("quick", "x", part=(3, 2)), "(3, 2): must be whole numbers"),
    "its events": (lambda: mm.run_suite("quick", "x", on_event=3), "on_event = 3: expected a"),
    "its cluster": (lambda: mm.run_suite("quick", "x", dask=3), "dask = 3: expected the address"),
    "its executor": (lambda: mm.run_suite("quick", "x", executor=3), "executor = 3: expected an"),
    "seed": (lambda: mm.simulate("youbot", "tsm", "paper", seed=True), "seed = True: must be a"),
    "one of several": (lambda: mm.view(["youbot", 3]), "3 cannot be shown: give a robot"),
    "Suite": (lambda: mm.Suite.model_validate({"name": "x"}), "field 'controllers' is missing"),
    "Scenario": (lambda: mm.Scenario.model_validate(3), "is 3: "),
    "load_record": (lambda: mm.load_record(3), "path = 3: expected a path"),
    "load_results": (lambda: mm.load_results(None), "folder = None: expected a path"),
    "compare": (lambda: mm.compare([3]), "3 is not a run: expected"),
    "observe": (lambda: mm.simulate("youbot", "tsm", "paper", observe=3), "observe = 3: expected"),
    "view": (lambda: mm.view(3), "3 cannot be shown"),
    "port": (lambda: mm.view("youbot", port="x", open_browser=False), "port = 'x': allowed: 0 to"),
    "host": (
        lambda: mm.view("youbot", host=3, open_browser=False),
        "host = 3: expected an address",
    ),
    "layout": (
        lambda: mm.view("youbot", layout="x"),
        "layout = 'x': allowed: overlay, side-by-side",
    ),
    "time": (lambda: mm.view("youbot", time="a"), "time = 'a': must be a number"),
}


@pytest.mark.parametrize("name", WRONG)
def test_functions_say_what_they_expect(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(*WRONG[name])
    assert list(tmp_path.iterdir()) == []


def test_methods_of_records_and_views_say_what_they_expect(record):
    for name in ("save", "plot"):
        refused(lambda n=name: getattr(record, n)(3), "path = 3: expected a path")
    refused(lambda: mm.compare([record]).plot(3), "path = 3: expected a path")
    refused(lambda: mm.view(record, html=3), "path = 3: expected a path")
    with mm.view("youbot", open_browser=False) as view:
        for size in ("big", (3,), (3, 4), (640, 480.5), (640, 9000), 640):
            refused(lambda s=size: view.save("x.png", size=s), "size = ", "16x16 to 8192x8192")
        refused(lambda: view.save("x.png", scale="2"), "scale = '2': must be a number above 0")
        for kind, what in (("html", "page"), ("png", "picture"), ("gif", "film")):
            told = f"x.{kind}: a {what} has no option colour"
            refused(lambda k=kind: view.save(f"x.{k}", colour=1), told)


@pytest.mark.parametrize("monitor", ["yes", 1, None], ids=repr)
def test_monitor_is_a_truth_value(monitor):
    given = {"duration": 0.01, "monitor": monitor}
    refused(lambda: mm.simulate("youbot", "tsm", "paper", **given), "monitor = ", "True or False")


def test_gains_that_are_arrays_are_shown():
    law = mm.make_controller("tsm", K_F=np.ones(2))
    assert repr(law) == "TerminalSlidingMode('tsm', K_F=array([1., 1.]))"


def test_limit_of_all_motors_may_be_an_array_of_one_number(youbot):
    law = mm.make_controller("tsm", saturation="hedge", torque_limits=np.array(3.0))
    law.reset(youbot, mm.make_task("paper", youbot), 1e-3)
    assert law.settings()["torque_limits"] == [3.0] * youbot.nz
