"""Running suites: parallel, resumable, never stopped by one run."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace

import h5py
import pytest
from support.suites import run_suite, small_suite

import mobman as mm
from mobman.benchmark.store import Store
from mobman.benchmark.suite import load_suite
from mobman.errors import MobmanError
from mobman.files import temporary_beside
from mobman.robots import catalogue
from mobman.simulation.record import load_record


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A small suite, run with two workers."""
    folder = tmp_path_factory.mktemp("suite")
    suite = load_suite(small_suite(folder))
    summary = mm.run_suite(suite, folder / "results", workers=2)
    return suite, folder / "results", summary


def test_the_report_is_written_and_named(done):
    _, folder, summary = done
    assert summary.report.html == folder / "report.html"
    assert "pseudo-inverse" in summary.report.html.read_text(encoding="utf-8")
    assert "8 done" in repr(summary)


def test_a_part_has_no_report(done, tmp_path):
    suite, folder, _ = done
    for name in ("runs", "suite.json"):
        source = folder / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    assert mm.run_suite(suite, tmp_path, part=(1, 2)).report is None
    assert not (tmp_path / "report.html").exists()


def test_every_run_is_there_and_whole(done):
    suite, folder, summary = done
    assert summary.asked == 8
    assert not summary.failed
    store = Store(folder)
    for run in suite.runs():
        record = store.record(run)
        assert record.scenario == run.scenario["name"]
        assert record.seed == run.seed
        assert record.spec["robot"]["name"] == run.robot
    assert len(list((folder / "runs").iterdir())) == 8


def test_what_is_there_is_not_run_again(done):
    suite, folder, _ = done
    before = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
    summary = run_suite(suite, folder, workers=1)
    assert summary.skipped == 8
    assert not summary.outcomes
    assert before == {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}


def test_fresh_runs_everything_and_broken_files_are_run_again(done, tmp_path):
    suite, _, _ = done
    one = replace_seeds(suite, [0])
    assert len(run_suite(one, tmp_path, workers=1).outcomes) == 4
    victim = Store(tmp_path).path(one.runs()[0])
    victim.write_bytes(victim.read_bytes()[:1000])
    assert len(run_suite(one, tmp_path, workers=1).outcomes) == 1
    assert load_record(victim).ok
    assert len(run_suite(one, tmp_path, workers=1, fresh=True).outcomes) == 4


def replace_seeds(suite, seeds):
    return suite.model_copy(update={"seeds": seeds})


def test_index_links_every_run_with_its_metrics(done):
    suite, folder, _ = done
    with h5py.File(folder / "index.h5") as index:
        table = index["table"]
        ids = [name.decode() for name in table["run_id"][()]]
        assert ids == [run.run_id for run in suite.runs()]
        for i, name in enumerate(ids):
            linked = index["runs"][name]
            assert linked["q"].shape[1] == 8
            assert linked["metrics"].attrs["task_error_rms"] == table["metrics/task_error_rms"][i]
            assert json.loads(table["spec_json"][i])["label"] == table["label"][i].decode()


def test_results_are_one_frame(done):
    suite, folder, _ = done
    frame = mm.load_results(folder)
    assert list(frame.index) == [run.run_id for run in suite.runs()]
    assert set(frame["status"]) == {"ok"}
    for run in suite.runs():
        row, record = frame.loc[run.run_id], Store(folder).record(run)
        assert (row["robot"], row["controller"], row["seed"]) == (run.robot, run.label, run.seed)
        assert row["task_error_rms"] == record.metrics["task_error_rms"]


def test_runs_without_a_result_are_in_the_frame(tmp_path):
    suite = mm.load_suite(small_suite(tmp_path))
    store = Store(tmp_path / "r")
    store.begin(suite, suite.runs())
    store.fail(suite.runs()[0], "its worker process was lost")
    frame = mm.load_results(store.folder)
    assert list(frame["status"]) == ["failed", *["pending"] * 7]
    assert frame["message"].iloc[0] == "its worker process was lost"


def test_index_is_rebuilt_from_the_files(done):
    _, folder, _ = done
    index = folder / "index.h5"
    index.unlink()
    Store(folder).rebuild_index()
    with h5py.File(index) as file:
        assert len(file["runs"]) == 8


def test_a_failing_run_is_recorded_and_the_others_go_on(tmp_path):
    path = small_suite(tmp_path)
    # refused only when the law meets the robot: K_F needs one weight for each of its 8 coordinates
    path.write_text(path.read_text().replace("mu = 0.02", "K_F = [1.0, 2.0]"))
    suite = replace_seeds(load_suite(path), [0])
    summary = run_suite(suite, tmp_path / "results", workers=2)
    assert {outcome.run.label for outcome in summary.failed} == {"damped"}
    assert len(summary.outcomes) == 4
    assert all("K_F has 2 entries" in outcome.message for outcome in summary.failed)
    assert len(Store(tmp_path / "results").failures) == 2
    # and they are tried again
    assert len(run_suite(suite, tmp_path / "results", workers=1).outcomes) == 2


def test_another_suites_folder_is_refused(done):
    suite, folder, _ = done
    with pytest.raises(MobmanError, match="holds results of the suite 'small'"):
        run_suite(suite.model_copy(update={"name": "other"}), folder, workers=1)


def test_a_file_in_the_folders_place_is_told_plainly(done, tmp_path):
    suite, _, _ = done
    (tmp_path / "results").write_text("not a folder")
    with pytest.raises(MobmanError, match="cannot write to"):
        run_suite(suite, tmp_path / "results", workers=1)


def test_run_spec_says_which_run_it_is(done):
    suite, _, _ = done
    run = suite.runs()[0]
    assert str(run) == "youbot · circle · nominal · pseudo-inverse · 0.001 s · seed 0"
    assert replace(run, label="x").run_id == run.run_id


def test_workers_use_the_robot_that_is_registered_here(tmp_path, monkeypatch):
    spec = mm.load_robot("youbot").spec
    changed = spec.model_copy(update={"name": "mine", "rest": {**spec.rest, "y_2": 0.3}})
    monkeypatch.setitem(catalogue._registered, "mine", changed)
    path = small_suite(tmp_path)
    path.write_text(path.read_text().replace('"youbot"', '"mine"'))
    suite = replace_seeds(load_suite(path), [0])
    assert not run_suite(suite, tmp_path / "results", workers=1).failed
    record = Store(tmp_path / "results").record(suite.runs()[0])
    assert record.q[0, record.joint_names.index("y_2")] == 0.3


def test_a_repeated_call_keeps_the_time_of_the_runs(done):
    suite, folder, _ = done
    before = Store(folder).manifest
    run_suite(suite, folder, workers=1)
    assert Store(folder).manifest == before
    assert before.seconds > 0.0


def test_the_time_of_runs_that_are_forgotten_goes_with_the_last_of_them(done, tmp_path):
    _, folder, _ = done
    shutil.copytree(folder, tmp_path / "copy")
    store = Store(tmp_path / "copy")
    took = store.manifest.seconds
    *most, last = store.runs
    store.forget(most)
    assert store.manifest.seconds == took > 0.0
    store.forget([last])
    assert (store.manifest.seconds, store.manifest.workers) == (None, None)
    assert store.runs == (*most, last)


@pytest.mark.parametrize("content", ["[]", "null", '{"schema_version": 1}', "{"])
def test_spoilt_suite_file_is_told_plainly(tmp_path, content):
    (tmp_path / "suite.json").write_text(content)
    with pytest.raises(MobmanError, match=r"suite\.json"):
        Store(tmp_path).runs  # noqa: B018


@pytest.mark.parametrize("name", ["runs", "figures", "."])
def test_another_machines_temporary_file_is_left_alone(done, name):
    suite, folder, _ = done
    (folder / name).mkdir(exist_ok=True)
    here = temporary_beside(folder / name / "x.h5")
    ended = here.name.replace(f".{os.getpid()}.", ".1999999999.")
    dead, elsewhere = here.with_name(ended), here.with_name(".x.h5.elsewhere.1.0.tmp")
    for file in (here, dead, elsewhere):
        file.touch()
    try:
        run_suite(suite, folder, workers=1)
        assert not dead.exists()
        assert here.exists()
        assert elsewhere.exists()
    finally:
        here.unlink()
        elsewhere.unlink()
