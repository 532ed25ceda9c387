"""The benchmark report's replays: the command of each run, and pages where they are asked for."""

from __future__ import annotations

import dataclasses
import re
import shlex

import numpy as np
import pytest
from support.suites import run_suite, small_suite

import mobman as mm
from mobman.benchmark.report.report import report_on
from mobman.benchmark.store import Store
from mobman.benchmark.suite import load_suite
from mobman.cli.bench import report_command
from mobman.cli.view import view as view_command
from tests.support.poses import largest_difference


@pytest.fixture
def results(tmp_path):
    """A folder of 4 runs, one of which ended early, after its last sample that was kept."""
    folder = tmp_path / "some results"
    suite = load_suite(small_suite(tmp_path)).model_copy(
        update={"record_period": 1e-3, "seeds": [0]}
    )
    run_suite(suite, folder, workers=1)
    failed = sorted((folder / "runs").glob("*.h5"))[0]
    whole = mm.load_record(failed)
    rows = slice(0, 12)
    names = ("t", "q", "z", "torque", "tip_position", "tip_desired", "task_error")
    names += ("auxiliary_error", "compute_time")
    ended = dataclasses.replace(
        whole,
        status="diverged",
        message="at t = 0.0125 s: |z| is above 1e6",
        signals={name: values[rows] for name, values in whole.signals.items()},
        **{name: getattr(whole, name)[rows] for name in names},
    )
    keep(folder, failed, ended)
    return folder, failed


def keep(folder, path, record):
    """Put a record in place of another of the same run."""
    store = Store(folder)
    (run,) = (run for run in store.runs if store.path(run) == path)
    store.keep(run, record.to_bytes())
    store.finish()


def _commands(markdown):
    return [
        shlex.split(found.replace("\\", ""))
        for found in re.findall(r"\| (mobman view [^|]*?) \|", markdown)
    ]


def test_every_run_has_its_command_and_no_page_is_written(results, tmp_path):
    folder, failed = results
    files = report_on(folder)
    runs = sorted((folder / "runs").glob("*.h5"))
    commands = _commands(files.markdown.read_text(encoding="utf-8"))
    assert sorted(words[2] for words in commands) == [str(path) for path in runs]
    assert [words for words in commands if "--time" in words] == [
        ["mobman", "view", str(failed), "--time", "0.0125"]
    ]
    html = files.html.read_text(encoding="utf-8")
    assert html.count("mobman view") == len(runs) == 4
    assert not (folder / "replays").exists()
    assert "replays/" not in html
    # the command is one
    words = next(words for words in commands if "--time" in words)
    view_command.main([*words[2:], "--html", str(tmp_path / "page.html")], standalone_mode=False)
    assert (tmp_path / "page.html").is_file()


def test_pages_open_at_the_instant_of_failure_and_are_linked(results, opened):
    folder, failed = results
    report_command.main([str(folder), "--replays"], standalone_mode=False)
    runs = sorted((folder / "runs").glob("*.h5"))
    pages = [f"replays/{path.stem}.html" for path in runs]
    for report in ("report.html", "report.md"):
        text = (folder / report).read_text(encoding="utf-8")
        links = re.findall(r"(?:href=\"|\]\()(replays/[^\")]+)", text)
        assert sorted(set(links)) == pages
        assert all((folder / link).is_file() for link in links)
    robot = mm.load_robot("youbot")
    for path, row in ((failed, -1), (runs[1], 0)):
        record = mm.load_record(path)
        with opened((folder / "replays" / f"{path.stem}.html").as_uri()) as page:
            assert page.evaluate("mobman.time()") == record.t[row]
            assert largest_difference(page, robot, record.q[row]) <= 1e-6
    # a report that writes none links those that are there, but not one of an earlier run
    record = mm.load_record(runs[1])
    keep(folder, runs[1], dataclasses.replace(record, q=record.q + np.float64(0.1)))
    text = report_on(folder).html.read_text(encoding="utf-8")
    assert pages[0] in text
    assert pages[1] not in text
