"""Runs that are shown while they go: what the page follows, and that the results are the same."""

from __future__ import annotations

import base64
import json
import os
import re
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from time import perf_counter
from types import SimpleNamespace

import click
import numpy as np
import pytest

import mobman as mm
from mobman.cli.run import run as run_command
from mobman.viewer import view as view_module
from mobman.viewer.scene import motion
from mobman.viewer.view import LiveRun, View
from tests.support.poses import largest_difference

ARRAYS = (
    *("t", "q", "z", "torque", "tip_position", "tip_desired", "task_error", "auxiliary_error"),
)


def assert_same_results(one, other):
    for name in ARRAYS:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    assert one.signals.keys() == other.signals.keys()
    for name, values in one.signals.items():
        assert values.tobytes() == other.signals[name].tobytes(), name
    timing = "compute_time"
    for name, value in one.metrics.items():
        if not name.startswith(timing):
            assert repr(value) == repr(other.metrics[name]), name


def _serving():
    return [thread for thread in threading.enumerate() if thread.name == "mobman view"]


@pytest.mark.parametrize("name", ["youbot", pytest.param("tiago", marks=pytest.mark.slow)])
def test_the_page_follows_the_run_which_is_not_changed(name, opened):
    robot = mm.load_robot(name)
    seen = []
    gate, ended = threading.Event(), threading.Event()
    found = {}
    live = LiveRun(robot, "circle", duration=0.5, speed=None, controller="tsm", scenario="nominal")

    def observe(t, q, z, torque):
        live.observe(t, q, z, torque)
        seen.append((t, q.copy()))
        if t > 0.2 and not gate.is_set():  # half-way, until the page has been looked at
            assert gate.wait(60)
        q[:], z[:], torque[:] = np.nan, np.nan, np.nan  # they are copies

    def simulate():
        try:
            found["record"] = mm.simulate(
                robot, "tsm", "circle", duration=0.5, observe=observe, observe_every=live.every
            )
        finally:
            ended.set()

    with View(live.scene, frames=live.frames) as view, opened(view.url) as page:
        assert page.evaluate("mobman.live()") is True
        assert page.evaluate("document.getElementById('time').disabled") is True
        assert page.evaluate("mobman.app.runs[0].motion.path.rows") > 10
        simulation = threading.Thread(target=simulate, daemon=True)
        simulation.start()
        try:
            page.wait_for_function("mobman.time() > 0.2", timeout=60_000)
            halfway = seen[-1]
            assert not ended.is_set()
            assert page.evaluate("mobman.frameTimes().pop()") == halfway[0]
            shown = "document.getElementById('rate').innerText"
            page.wait_for_function(f"/^[0-9.]+× real time$/.test({shown}.trim())")
            page.wait_for_function("end => Math.abs(mobman.time() - end) < 1e-12", arg=halfway[0])
        finally:
            gate.set()
        assert ended.wait(60)
        simulation.join()
        record = found["record"]
        live.finish(record)
        page.wait_for_function("!mobman.live()")
        assert page.evaluate("mobman.playing()") is False
        assert page.evaluate("mobman.time()") == record.t[-1]
        assert largest_difference(page, robot, record.q[-1]) <= 1e-6
        assert page.evaluate("document.getElementById('rate').hidden") is True
        # then all of it can be looked at
        assert page.evaluate("document.getElementById('time').disabled") is False
        times = np.array(page.evaluate("mobman.frameTimes()"))
        moment = float(times[len(times) // 2])
        page.evaluate("time => mobman.setTime(time)", moment)
        row = int(np.flatnonzero(record.t == moment)[0])
        assert largest_difference(page, robot, record.q[row]) <= 1e-6
    assert _serving() == []
    assert_same_results(record, mm.simulate(robot, "tsm", "circle", duration=0.5))


@pytest.mark.parametrize(("name", "task"), [("youbot", "paper"), ("tiago", "pose-circle")])
def test_frames_are_the_states_as_they_were(name, task):
    robot = mm.load_robot(name)
    live = LiveRun(robot, task, duration=0.3, speed=None)
    seen = []

    def observe(t, q, z, torque):
        seen.append((t, q.copy()))
        live.observe(t, q, z, torque)

    record = mm.simulate(
        robot, "extended-jacobian", task, duration=0.3, observe=observe, observe_every=live.every
    )
    assert len(seen) >= 17
    for t, q in seen:
        assert q.tobytes() == record.q[np.flatnonzero(record.t == t)[0]].tobytes()
    news = json.loads(live.frames(-1.0))["motion"]
    assert news["t"]["shape"] == [len(seen)]
    there = np.isin(record.t, unpacked(news["t"]))
    tracks = {n: getattr(record, n) for n in (*ARRAYS[:7], "tip_desired_orientation")}
    same = {n: None if track is None else track[there] for n, track in tracks.items()}
    whole = motion(SimpleNamespace(**same, joint_names=record.joint_names), robot).described()
    for name, track in whole.items():  # what is desired and how far it is, as of the record
        if track is not None:
            assert unpacked(news[name]) == pytest.approx(unpacked(track), rel=1e-5, abs=1e-6), name
    assert (whole["turn"] is None) == (task == "paper")
    assert json.loads(live.frames(seen[-1][0])) == {}
    assert json.loads(live.frames(seen[-3][0]))["motion"]["t"]["shape"] == [2]
    live.finish(record)
    assert json.loads(live.frames(seen[-1][0]))["ended"] is True


def unpacked(track):
    array = np.frombuffer(base64.b64decode(track["data"]), dtype="<" + track["kind"])
    return array.reshape(track["shape"])


def test_the_rate_is_that_of_the_last_second(monkeypatch):
    clock = iter(np.arange(0.0, 1e3, 0.05))
    monkeypatch.setattr(view_module, "perf_counter", lambda: float(next(clock)))
    robot = mm.load_robot("youbot")
    live, still = LiveRun(robot, "circle", duration=3.0, speed=None), np.zeros(5)
    times = [*np.arange(0.0, 0.5, 0.05), *np.arange(0.5, 1.5, 0.02)]  # first in time, then at 0.4
    rates = []
    for t in times:
        live.observe(float(t), robot.q_rest, still, still)
        rates.append(json.loads(live.frames(float(t) - 1e-9))["rate"])
    assert rates[0] is None
    assert rates[1:10] == pytest.approx([1.0] * 9)
    assert rates[-1] == pytest.approx(0.4)
    assert 0.4 < rates[15] < 1.0


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_it_keeps_to_the_clock(speed):
    live = LiveRun(mm.load_robot("youbot"), "circle", duration=0.6, speed=speed)
    nothing = np.zeros(0)
    began = perf_counter()
    for t in np.arange(0.0, 0.61, 0.02):
        live.observe(float(t), nothing, nothing, nothing)
    assert perf_counter() - began >= 0.6 / speed - 1e-3


def test_a_diverging_run_is_followed_to_its_end(opened):
    options = {"duration": 1.0, "controller": "tsm"}
    robot = mm.load_robot("youbot")
    live = LiveRun(robot, "circle", speed=None, **options)
    record = mm.simulate(robot, _Runaway(), "circle", duration=1.0, observe=live.observe)
    assert record.status == "diverged"
    live.finish(record)
    with View(live.scene, frames=live.frames) as view, opened(view.url) as page:
        page.wait_for_function("!mobman.live()")
        assert page.evaluate("mobman.duration()") == record.t[-1]
        assert "diverged" in page.inner_text("#info")
        assert largest_difference(page, robot, record.q[-1]) <= 1e-6


class _Runaway:
    name = "runaway"

    def reset(self, robot, task, dt):
        self._n = robot.nz

    def step(self, t, q, z, z_dot):
        return np.full(self._n, 20.0 + 1e4 * t)


@pytest.mark.parametrize("query", ["", "?after=soon"])
def test_wrong_questions_are_refused(query):
    live = LiveRun(mm.load_robot("youbot"), "circle", duration=0.1)
    with View(live.scene, frames=live.frames) as view:
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(f"{view.url}frames{query}", timeout=10)
        foreign = urllib.request.Request(
            f"{view.url}frames?after=0", headers={"Host": "elsewhere.example"}
        )
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(foreign, timeout=10)


def _started(*arguments):
    process = subprocess.Popen(
        [sys.executable, "-m", "mobman", "run", "youbot", "--no-browser", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    line = process.stderr.readline()
    assert line.startswith("live: http://127.0.0.1:"), line
    return process, line.split()[1]


@pytest.mark.usefixtures("interruptible")
def test_the_command_shows_the_run_and_stays_until_interrupted(opened, tmp_path):
    file = tmp_path / "run.h5"
    process, url = _started("--live-speed", "max", "--duration", 0.4, "-o", file, "--json")
    try:
        with opened(url) as page:
            page.wait_for_function("!mobman.live()", timeout=60_000)
            record = mm.load_record(file)
            assert largest_difference(page, mm.load_robot("youbot"), record.q[-1]) <= 1e-6
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=20)
        assert process.returncode == 0
        assert json.loads(out)["status"] == "ok"
        assert_same_results(record, mm.simulate("youbot", "tsm", "circle", duration=0.4))
        with pytest.raises(urllib.error.URLError):
            urllib.request.urlopen(url, timeout=5)
    finally:
        process.kill()
        process.wait()


@pytest.mark.usefixtures("interruptible")
def test_the_command_is_interrupted_while_it_runs(opened):
    process, url = _started("--live", "--duration", 60)
    try:
        with opened(url, left=True) as page:
            page.wait_for_function("mobman.time() > 0.1", timeout=60_000)
            process.send_signal(signal.SIGINT)
            _, error = process.communicate(timeout=20)
            assert process.returncode == 130
            assert error.strip() == "mobman: interrupted"
            # what had come is still there
            page.wait_for_function("!mobman.live()")
            assert "interrupted" in page.inner_text("#info")
            assert page.evaluate("document.getElementById('time').disabled") is False
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("speed", ["fast", "0", "-1", "nan", "inf"])
def test_wrong_speeds(speed):
    with pytest.raises(click.UsageError, match=re.escape(f"'{speed}' is neither")):
        run_command.main(["youbot", "--live-speed", speed], standalone_mode=False)
