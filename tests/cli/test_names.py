"""The commands that list what is registered, and what shells complete with."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import subprocess
import sys

import pytest
from support.command_line import mobman

import mobman as mm
from mobman.cli import names
from mobman.controllers.protocol import controllers
from mobman.simulation.metrics import list_metrics, metrics
from mobman.tasks.task import parameters_of

LISTS = {
    "controllers": mm.list_controllers,
    "tasks": mm.list_tasks,
    "scenarios": mm.list_scenarios,
    "metrics": metrics.names,
}


def own_controllers():
    """Those of mobman; other tests of the process may have registered theirs."""
    names = mm.list_controllers()
    return [name for name in names if controllers.get(name).__module__.startswith("mobman.")]


@pytest.mark.parametrize("kind", LISTS)
def test_every_name_is_listed_with_what_it_is(kind):
    found = json.loads(mobman(kind, "--json").stdout)
    own = own_controllers() if kind == "controllers" else LISTS[kind]()
    assert [item["name"] for item in found if item["name"] in own] == own
    assert len(own) > 3
    assert all(item["description"] for item in found if item["name"] in own)
    text = mobman(kind).stdout
    assert all(name in text for name in own)
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize("kind", LISTS)
def test_an_unknown_name_is_an_error_with_the_nearest(kind):
    name = LISTS[kind]()[0]
    done = mobman(kind, f"{name[:-1]}")
    assert (done.returncode, done.stdout) == (2, "")
    assert repr(name) in done.stderr


def test_gains_have_defaults_units_and_meanings():
    for name in own_controllers():
        found = json.loads(mobman("controllers", name, "--json").stdout)
        fields = dataclasses.fields(controllers.get(name).Gains)
        assert [gain["name"] for gain in found["gains"]] == [field.name for field in fields]
        assert all(gain["meaning"] for gain in found["gains"])
    gains = {
        gain["name"]: gain
        for gain in json.loads(mobman("controllers", "tsm", "--json").stdout)["gains"]
    }
    assert gains["a"]["default"] == "auto"
    assert gains["c_0"] == {
        "name": "c_0",
        "default": 1.0,
        "unit": "m/s^3",
        "meaning": "c_0 of (34)",
    }
    shown = mobman("controllers", "tsm").stdout
    assert all(name in shown for name in gains)


def test_tasks_have_their_parameters():
    for name in mm.list_tasks():
        found = json.loads(mobman("tasks", name, "--json").stdout)
        assert [p["name"] for p in found["parameters"]] == [p.name for p in parameters_of(name)]
    assert "by the robot  m" in mobman("tasks", "circle").stdout


def test_a_scenario_says_what_it_changes(tmp_path):
    found = json.loads(mobman("scenarios", "heavier", "--json").stdout)
    assert found["changes"] == {"mass_factor": 1.3, "payload": 1.0}
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\nextends = ["heavier"]\npayload = 2.0\n')
    assert "2" in mobman("scenarios", path).stdout.split("payload")[1]


def test_metrics_have_units():
    found = json.loads(mobman("metrics", "--json").stdout)
    assert {item["name"]: item["unit"] for item in found} == {
        m.name: m.unit for m in list_metrics()
    }


def test_a_law_without_gains_or_with_gains_without_defaults_is_shown(monkeypatch):
    gains = dataclasses.make_dataclass("Gains", [("k", float)])
    monkeypatch.setitem(controllers._items, "plain", type("Plain", (), {"__doc__": "Mine."}))
    monkeypatch.setitem(controllers._items, "given", type("Given", (), {"Gains": gains}))
    facts = names._controller
    assert facts("plain") == {"name": "plain", "description": "Mine.", "uses": [], "gains": []}
    assert facts("given")["gains"] == [{"name": "k", "default": None, "unit": "", "meaning": ""}]


# Completion


def completed(*words, shell="bash"):
    environment = {
        "_MOBMAN_COMPLETE": f"{shell}_complete",
        "COMP_WORDS": " ".join(["mobman", *words]),
        "COMP_CWORD": words[-1] if shell == "fish" else str(len(words)),
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        done = mobman()
    assert done.returncode == 0, done.stderr
    return [line.partition(",")[2] for line in done.stdout.splitlines() if line]


def test_commands_names_and_options_are_completed():
    assert "controllers" in completed("con")
    assert completed("run", "youbot_") == ["youbot_mecanum"]
    assert completed("run", "youbot", "--controller", "tsm-s") == ["tsm-simplified"]
    assert completed("run", "youbot", "--task", "figu") == ["figure-eight"]
    assert completed("run", "youbot", "--scenario", "heav") == ["heavier"]
    assert completed("bench", "run", "qui") == ["quick"]
    assert completed("robots", "show", "tiago_p") == ["tiago_pro"]
    assert completed("tasks", "circ") == ["circle"]
    assert "--json" in completed("bench", "list", "--j")


def test_files_are_completed_where_no_name_begins_so():
    assert completed("run", "my/rob") == ["my/rob"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_gets_its_script(shell, monkeypatch):
    monkeypatch.setenv("_MOBMAN_COMPLETE", f"{shell}_source")
    done = mobman()
    assert (done.returncode, done.stderr) == (0, "")
    assert f"_MOBMAN_COMPLETE={shell}_complete" in done.stdout
    assert "Usage" not in done.stdout


SHELLS = {
    "bash": 'eval "$(_MOBMAN_COMPLETE=bash_source mobman)"; COMP_WORDS=(mobman run youbot_); '
    'COMP_CWORD=2; _mobman_completion mobman youbot_ run; echo "${COMPREPLY[@]}"',
    # outside of its line editor there are no places for the names: they are printed
    "zsh": "compdef() { :; }; compadd() { print -r -- ${(P)@[-1]} }; "
    'eval "$(_MOBMAN_COMPLETE=zsh_source mobman)"; words=(mobman run youbot_) CURRENT=3; '
    "_mobman_completion",
    "fish": '_MOBMAN_COMPLETE=fish_source mobman | source; complete -C "mobman run youbot_"',
}


@pytest.mark.parametrize("shell", SHELLS)
def test_shells_complete_with_their_script(shell, tmp_path):
    """Each itself, with a command of that name on the path."""
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell}")
    command = tmp_path / "mobman"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m mobman "$@"\n')
    command.chmod(0o755)
    done = subprocess.run(
        [shell, "-c", SHELLS[shell]],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        check=False,
    )
    assert (done.stdout, done.stderr) == ("youbot_mecanum\n", "")


def test_another_shell_is_said(monkeypatch):
    monkeypatch.setenv("_MOBMAN_COMPLETE", "csh_source")
    done = mobman()
    assert done.returncode == 2
    assert "bash_source, zsh_source, fish_source" in done.stderr
