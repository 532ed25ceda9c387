"""Views that this process serves, and the command line."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request

import click
import numpy as np
import pytest

import mobman as mm
from mobman.cli.view import view as view_command
from mobman.viewer.view import View, make_scene
from tests.support.poses import largest_difference


def _serving():
    return [thread for thread in threading.enumerate() if thread.name == "mobman view"]


def _get(url, **headers):
    with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=10) as answer:
        return answer.read().decode()


def test_live_view_plays_the_run(runs, opened):
    robot, record = mm.load_robot("youbot"), runs("youbot")
    with mm.view(record, open_browser=False) as view:
        assert view.url.startswith("http://127.0.0.1:")
        with opened(view.url, draws=True) as page:
            page.click("#play")
            page.wait_for_function("mobman.time() > 0.2", timeout=30_000)
            page.evaluate("mobman.pause()")
            moment = page.evaluate("mobman.frameTimes().filter(t => t <= mobman.time()).pop()")
            page.evaluate("time => mobman.setTime(time)", moment)
            q = record.q[int(np.argmin(np.abs(record.t - moment)))]
            assert largest_difference(page, robot, q) <= 1e-6
            # as a user would: with the slider
            page.evaluate(
                """() => {
                    const slider = document.getElementById("time");
                    slider.value = 0.4;
                    slider.dispatchEvent(new Event("input"));
                }"""
            )
            assert page.evaluate("mobman.time()") == pytest.approx(0.4)


def test_nothing_is_left_after_close():
    view = mm.view("youbot", open_browser=False)
    url = view.url
    assert "mobman" in _get(url)
    view.close()
    view.close()
    assert _serving() == []
    with pytest.raises(urllib.error.URLError):
        _get(url)
    with pytest.raises(mm.MobmanError, match="closed"):
        _ = view.url


def test_it_listens_on_loopback_only_and_answers_to_its_own_name():
    with mm.view("youbot", open_browser=False) as view:
        port = int(view.url.rstrip("/").rpartition(":")[2])
        with pytest.raises(urllib.error.HTTPError, match="403"):
            _get(view.url, Host="elsewhere.example")
        assert _get(f"http://localhost:{port}/") == view.html()
        # another address of this machine, which a server on all addresses would answer on
        with pytest.raises(OSError), socket.create_connection(("127.0.0.2", port), timeout=2):  # noqa: PT011
            pass


def test_busy_port_is_a_clear_message():
    with mm.view("youbot", open_browser=False) as view:
        port = int(view.url.rstrip("/").rpartition(":")[2])
        with pytest.raises(mm.MobmanError, match=f"port {port} of 127.0.0.1 is taken") as caught:
            mm.view("youbot", open_browser=False, port=port)
        assert caught.value.exit_status == 2
    with mm.view("youbot", open_browser=False, port=port) as view:
        assert view.url == f"http://127.0.0.1:{port}/"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"port": 70_000}, "allowed: 0 to 65535"),
        ({"host": "192.0.2.1"}, "not an address of this machine"),
        ({"host": "no such host"}, "host = 'no such host'"),
    ],
)
def test_wrong_addresses(options, message):
    with pytest.raises(mm.MobmanError, match=message):
        _ = View(make_scene("youbot"), **options).url


def test_notebooks_show_the_page_itself(opened, tmp_path):
    view = View(make_scene("youbot"))
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!DOCTYPE html><body>{view._repr_html_()}</body>", encoding="utf-8")
    robot = mm.load_robot("youbot")
    with opened(notebook.as_uri(), framed=True) as page:
        assert largest_difference(page, robot, robot.q_rest) <= 1e-6
    assert _serving() == []


def test_several_forms_of_runs_and_robots(runs, tmp_path):
    file = runs("youbot").save(tmp_path / "run.data")
    for what in (file, str(file), [file, runs("youbot")], runs("youbot"), (runs("youbot"),)):
        assert make_scene(what).duration == pytest.approx(0.6)
    robot = mm.load_robot("youbot")
    for what in ("youbot", robot, robot.spec, ["youbot"]):
        assert make_scene(what).title == "youbot"


def test_what_cannot_be_shown(runs):
    for what, message in (
        ([], "nothing to show"),
        (3, "cannot be shown"),
        (["youbot", runs("youbot")], "is a robot, the others are runs"),
        (["youbot", "tiago"], "one robot at a time"),
        ("no_such.h5", "there is no record"),
        ("youbott", "did you mean 'youbot'"),
    ):
        with pytest.raises(mm.MobmanError, match=message):
            make_scene(what)
    with pytest.raises(mm.MobmanError, match="time"):
        make_scene(runs("youbot"), time=float("nan"))


def _command(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "mobman", "view", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        **options,
    )


@pytest.mark.usefixtures("interruptible")
def test_command_serves_until_interrupted():
    process = subprocess.Popen(
        [sys.executable, "-m", "mobman", "view", "youbot", "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        line = process.stdout.readline()
        url = line.split()[1]
        assert "mobman" in _get(url)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert process.stderr.read().strip() == ""
        with pytest.raises(urllib.error.URLError):
            _get(url)
    finally:
        process.kill()
        process.wait()


def test_command_writes_a_page(tmp_path):
    file = tmp_path / "robot.html"
    done = _command("youbot", "--html", file)
    assert done.returncode == 0, done.stderr
    assert str(file) in done.stdout
    assert file.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert list(tmp_path.iterdir()) == [file]
    file.write_text("mine", encoding="utf-8")
    done = _command("youbot", "--html", file)
    assert done.returncode == 2
    assert f"{file} is there already" in done.stderr
    assert file.read_text(encoding="utf-8") == "mine"
    assert _command("youbot", "--html", file, "--force").returncode == 0
    assert file.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["youbott"], "did you mean 'youbot'"),
        (["youbot", "{run}"], "is a robot, the others are runs"),
        (["youbot", "--no-browser", "--port", "{port}"], "port {port} of 127.0.0.1 is taken"),
        (["youbot", "--gif", "film.gif"], "a robot alone does not move"),
    ],
)
def test_what_the_command_cannot_do(runs, tmp_path, arguments, message):
    run = runs("youbot").save(tmp_path / "run.h5")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        known = {"run": run, "port": taken.getsockname()[1]}
        with pytest.raises(mm.MobmanError, match=message.format(**known)) as caught:
            view_command.main([word.format(**known) for word in arguments], standalone_mode=False)
    assert caught.value.exit_status == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--size", "big"], "'big' is not WIDTHxHEIGHT"),
        (["--png", "picture.jpg"], "does not end in .png"),
        (["--html", "page"], "does not end in .html"),
        (["--time", "-1"], "not in the range"),
        (["--speed", "0"], "not in the range"),
    ],
)
def test_wrong_options_of_the_command(arguments, message):
    with pytest.raises(click.UsageError, match=re.escape(message)):
        view_command.main(["youbot", *arguments], standalone_mode=False)


def test_errors_are_one_line():
    done = _command("youbott")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
