"""Files that commands write, how much they print, and tables in 80 columns."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys

import click
import pytest
from rich.console import Console
from support.command_line import mobman

import mobman as mm
from mobman.cli.main import mobman as group
from mobman.cli.output import SuiteDisplay, progress_bar, shortened, table

RUN = ("run", "youbot", "--controller", "pseudo-inverse", "--duration", "0.02")


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "run.h5"
    assert mobman(*RUN, "-o", path).returncode == 0
    return path


@pytest.mark.parametrize("command", ["run", "rerun"])
def test_a_file_that_is_there_is_replaced_only_by_force(saved, command):
    before = saved.read_bytes()
    arguments = RUN if command == "run" else ("rerun", saved)
    done = mobman(*arguments, "-o", saved)
    assert done.returncode == 2
    assert "is there already" in done.stderr
    assert "--force" in done.stderr
    assert saved.read_bytes() == before
    done = mobman(*arguments, "-o", saved, "--force")
    assert done.returncode == 0, done.stderr
    assert mm.load_record(saved).ok


@pytest.mark.parametrize("name", ["run.txt", "run", "run.toml"])
def test_a_foreign_suffix_is_refused(tmp_path, name):
    done = mobman(*RUN, "-o", tmp_path / name)
    assert done.returncode == 2
    assert "does not end in .h5 or .hdf5" in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_run_prints_a_line_a_section_and_what_comes_next(tmp_path):
    path = tmp_path / "run.h5"
    lines = mobman(*RUN, "-o", path).stdout.splitlines()
    heads = [line.split()[0] for line in lines if line.startswith("  ") and line[2] != " "]
    assert heads == ["tracking", "redundancy", "effort", "limits", "timing"]
    assert lines[-1] == f"next: mobman view {path}"
    assert max(len(line) for line in lines[:-2]) <= 80
    assert "|e^e| at the end: " in "\n".join(lines)
    everything = mobman(*RUN, "--all").stdout
    assert all(name in everything for name in mm.load_record(path).metrics)


def test_quiet_prints_errors_alone(tmp_path):
    done = mobman(*RUN, "-q")
    assert (done.returncode, done.stdout) == (0, "")
    assert "warning" not in done.stderr
    assert json.loads(mobman(*RUN, "-q", "--json").stdout)["status"] == "ok"
    done = mobman("run", "yuobot", "-q")
    assert done.returncode == 2
    assert "youbot" in done.stderr


def test_verbose_prints_gains_and_every_metric():
    shown = mobman(*RUN, "-v").stdout
    assert "K_p = 25" in shown
    assert "torque_rate_variation" in shown


def commands(command, *above):
    if isinstance(command, click.Group):
        for name, one in command.commands.items():
            yield from commands(one, *above, name)
    if not isinstance(command, click.Group) or command.invoke_without_command:
        yield " ".join(above), command


@pytest.mark.parametrize("name", [*dict(commands(group))])
def test_every_command_has_json_and_says_as_much_as_is_asked_for(name):
    options = {option for p in dict(commands(group))[name].params for option in p.opts}
    assert {"--json", "-q", "--quiet", "-v", "--verbose"} <= options


def test_lists_have_no_markup_and_may_be_quiet():
    shown = mobman("controllers").stdout
    assert not set("\\`") & set(shown)
    assert "sigma = e' + Lambda e" in " ".join(shown.split())
    assert mobman("controllers", "-q").stdout == ""
    assert json.loads(mobman("controllers", "-q", "--json").stdout)


def test_an_internal_error_has_its_traceback_with_v(monkeypatch):
    def fault():
        raise ZeroDivisionError("as bugs do")

    monkeypatch.setattr("mobman.robots.catalogue.list_robots", fault)
    monkeypatch.delenv("MOBMAN_DEBUG", raising=False)
    done = mobman("robots")
    assert (done.returncode, len(done.stderr.splitlines())) == (1, 1)
    assert "ZeroDivisionError: as bugs do (-v prints the traceback)" in done.stderr
    assert "Traceback" in mobman("robots", "-v").stderr


@pytest.mark.parametrize(
    "command",
    [
        "robots",
        "robots check --no-simulation turtlebot3_omx",
        "bench list",
        "bench show paper",
        # its runs begin where 16 searches along a path lead
        pytest.param("bench show robustness", marks=pytest.mark.slow),
        "controllers tsm",
        "tasks lissajous",
        "scenarios realistic",
        "metrics",
    ],
)
def test_tables_hold_at_80_columns(command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = mobman(*command.split()).stdout.splitlines()
    assert len(lines) > 5
    assert max(map(len, lines)) <= 80


def test_lines_of_metrics_break_between_items(monkeypatch):
    found = []
    for columns in ("80", "1000"):
        monkeypatch.setenv("COLUMNS", columns)
        text = mobman("run", "youbot", "--duration", "0.02").stdout.partition("timing")[0]
        found.append([item.strip() for item in re.split(r"[;\n]", text) if item.strip()])
    narrow, wide = found
    assert narrow == wide
    assert "lambda_min(J J^T) at least: " in "\n".join(narrow)


def test_long_names_lose_their_middle():
    assert shortened("short", 10) == "short"
    assert shortened("a_very_long_name_of_a_robot", 11) == "a_ver…robot"
    name = "a_platform_of_a_long_name_with_an_arm_of_a_long_name"
    out = Console(width=80, record=True, file=io.StringIO())
    out.print(table("robot", "what it is", rows=[(name, "word " * 30)], names={"robot"}))
    lines = out.export_text().splitlines()
    assert max(map(len, lines)) <= 80
    assert "a_platform_of…" in lines[1]
    assert "_long_name" in lines[1]


def test_bars_say_which_time_is_which(monkeypatch):
    for name in ("FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.setenv(name, "1")
    with progress_bar("title") as progress:
        progress(0.5)
    display = SuiteDisplay()
    texts = [getattr(column, "text_format", "") for column in display._progress.columns]
    kinds = [type(column).__name__ for column in display._progress.columns]
    assert kinds[texts.index("elapsed") + 1] == "TimeElapsedColumn"
    assert kinds[texts.index("left") + 1] == "TimeRemainingColumn"


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_while_it_is_loaded_is_one_line():
    """However early: here at the import of the first of its modules."""
    code = (
        "import os, runpy, signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, *rest):\n"
        "        if name == 'mobman.cli.main':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "            signal.pause()\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "runpy.run_module('mobman', run_name='__main__')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "mobman: interrupted\n")
