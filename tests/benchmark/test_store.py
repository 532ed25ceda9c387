"""Folders of results: what is kept, what is told of files that cannot be used, and joining them."""

from __future__ import annotations

import errno
import json
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import pytest
from click.testing import CliRunner
from support.suites import bits, run_suite, small_suite, suite_of

import mobman as mm
from mobman.benchmark import store as store_module
from mobman.benchmark.report.data import read_results
from mobman.benchmark.results import merge
from mobman.benchmark.store import Manifest, Store
from mobman.benchmark.suite import load_suite
from mobman.cli.main import mobman as command
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.provenance import versions
from mobman.simulation.scenario import Scenario


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    return load_suite(small_suite(tmp_path_factory.mktemp("suite")))


@pytest.fixture(scope="module")
def runs(suite):
    return suite.runs()


@pytest.fixture(scope="module")
def contents(runs):
    """The file of every run."""
    return {run.run_id: record_of(run).to_bytes() for run in runs}


def record_of(run):
    return mm.simulate(
        run.robot,
        mm.make_controller(run.law, **run.gains),
        run.task_name,
        duration=run.duration,
        dt=run.dt,
        scenario=Scenario.model_validate(run.scenario),
        seed=run.seed,
    )


def filled(folder, suite, runs, contents, which=slice(None)):
    store = Store(folder)
    store.begin(suite, runs)
    for run in runs[which]:
        store.keep(run, contents[run.run_id])
    return store


def test_what_was_asked_for_is_read_back(tmp_path, suite, runs):
    Store(tmp_path).begin(suite, runs)
    manifest = Manifest.read(tmp_path)
    assert manifest.suite == suite
    assert manifest.runs == tuple(runs)
    assert [run.run_id for run in manifest.runs] == [run.run_id for run in runs]


def test_tables_that_runs_share_are_kept_once(tmp_path, suite, runs):
    Store(tmp_path).begin(suite, runs)
    text = (tmp_path / "suite.json").read_text()
    assert text.count('"disturbances": [{') == 1
    first, second = Manifest.read(tmp_path).runs[:2]
    assert first.scenario is second.scenario


def test_a_result_removes_the_failure_of_the_run(tmp_path, suite, runs, contents):
    store = filled(tmp_path, suite, runs, contents, slice(0))
    store.fail(runs[0], "its process was killed")
    assert store.failures == {runs[0].run_id: "its process was killed"}
    assert not store.done(runs[0])
    store.keep(runs[0], contents[runs[0].run_id])
    assert store.done(runs[0])
    assert not store.failures


def reason(store, run):
    """Why a run's record cannot be used."""
    with pytest.raises(RecordError) as error:
        store.summary(run)
    return str(error.value)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:2000]), "not a readable HDF5 file"),
        (lambda path: path.write_bytes(b""), "not a readable HDF5 file"),
        (lambda path: path.write_text("foreign"), "not a readable HDF5 file"),
        (lambda path: _foreign(path), "not a mobman record"),
        (lambda path: _older(path), "schema version 1"),
    ],
)
def test_files_that_cannot_be_used_are_told_and_the_others_are_used(
    tmp_path, suite, runs, contents, spoil, message
):
    store = filled(tmp_path, suite, runs, contents)
    victim = store.path(runs[2])
    spoil(victim)
    assert [run for run in runs if not store.done(run)] == [runs[2]]
    told = reason(store, runs[2])
    assert message in told
    assert str(victim) in told
    with h5py.File(store.rebuild_index()) as index:
        assert len(index["runs"]) == len(runs) - 1


def _foreign(path: Path) -> None:
    path.unlink()
    with h5py.File(path, "w") as file:
        file["x"] = [1.0]


def _older(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file.attrs["schema_version"] = 1


def test_another_runs_record_is_told_and_its_run_done_again(tmp_path, suite, runs, contents):
    store = filled(tmp_path / "one", suite, runs, contents)
    store.path(runs[0]).write_bytes(contents[runs[1].run_id])
    assert [run for run in runs if not store.done(run)] == [runs[0]]
    assert "is another run's record" in reason(store, runs[0])
    merged = merge([store.folder], tmp_path / "all")
    assert (merged.there, len(merged.unusable)) == (7, 1)


def test_files_that_were_not_asked_for_are_left_alone_and_listed(tmp_path, suite, runs, contents):
    store = filled(tmp_path, suite, runs, contents)
    stranger = tmp_path / "runs" / "notes.txt"
    stranger.write_text("mine")
    store.begin(suite, runs)
    assert list(read_results(store).unused) == ["runs/notes.txt"]
    assert stranger.read_text() == "mine"


def test_another_suites_folder_is_refused(tmp_path, suite, runs):
    Store(tmp_path).begin(suite, runs)
    other = suite.model_copy(update={"name": "other"})
    with pytest.raises(MobmanError, match="holds results of the suite 'small', not of 'other'"):
        Store(tmp_path).begin(other, runs)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "cannot read"),
        ("[]", "schema version None"),
        ('{"schema_version": 1}', "schema version 1; this mobman reads version 3"),
        ('{"schema_version": 2}', "is not whole"),
        ('{"schema_version": 2, "suite": {}, "runs": [{}], "shared": []}', "is not whole"),
    ],
)
def test_a_spoilt_manifest_is_told_plainly(tmp_path, content, message):
    (tmp_path / "suite.json").write_text(content)
    with pytest.raises(MobmanError, match=message) as error:
        Manifest.read(tmp_path)
    assert "suite.json" in str(error.value)


def test_a_full_disk_leaves_nothing_half_written(tmp_path, suite, runs, contents, monkeypatch):
    store = filled(tmp_path, suite, runs, contents, slice(1))

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MobmanError, match="No space left on device"):
        store.keep(runs[1], contents[runs[1].run_id])
    monkeypatch.undo()
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [store.path(runs[0]).name]


def test_a_folder_that_cannot_be_made_is_told(tmp_path, suite, runs):
    (tmp_path / "file").write_text("")
    with pytest.raises(MobmanError, match=r"cannot write to .*file"):
        Store(tmp_path / "file" / "results").begin(suite, runs)


def test_a_read_only_folder_is_told(tmp_path, suite, runs, monkeypatch):
    def refused(path, *arguments, **options):  # as it is for all but root, who may write everywhere
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "mkdir", refused)
    with pytest.raises(MobmanError, match=r"cannot write to .*Permission denied"):
        Store(tmp_path).begin(suite, runs)


def test_folders_of_several_machines_are_joined(tmp_path, suite, runs, contents):
    one = filled(tmp_path / "one", suite, runs, contents, slice(0, 5))
    two = filled(tmp_path / "two", suite, runs, contents, slice(3, 8))
    two.finish(3.0, 2)
    one.finish(4.0, 1)
    result = CliRunner().invoke(
        command, ["bench", "merge", str(one.folder), str(two.folder), "-o", str(tmp_path / "all")]
    )
    assert result.exit_code == 0, result.output
    assert "8 of 8 runs, 8 copied" in result.output
    joined = Store(tmp_path / "all")
    for run in runs:
        assert joined.path(run).read_bytes() == contents[run.run_id]
    assert (joined.manifest.seconds, joined.manifest.workers) == (7.0, 3)
    with h5py.File(tmp_path / "all" / "index.h5") as index:
        assert [name.decode() for name in index["table/run_id"][()]] == [r.run_id for r in runs]


def test_what_is_joined_again_changes_nothing(tmp_path, suite, runs, contents):
    one = filled(tmp_path / "one", suite, runs, contents)
    assert merge([one.folder], tmp_path / "all").copied == 8
    again = merge([one.folder], tmp_path / "all")
    assert (again.copied, again.there, again.conflicts) == (0, 8, [])


def test_different_results_of_one_run_are_told_and_the_first_is_kept(
    tmp_path, suite, runs, contents
):
    one = filled(tmp_path / "one", suite, runs, contents)
    two = filled(tmp_path / "two", suite, runs, contents)
    disturbed = next(run for run in runs if run.scenario["name"] == "disturbed")
    other = record_of(disturbed)
    other.q[-1] += 1e-9
    other.state_sha256 = ""
    other.__post_init__()
    two.keep(disturbed, other.to_bytes())
    result = CliRunner().invoke(
        command, ["bench", "merge", str(one.folder), str(two.folder), "-o", str(tmp_path / "all")]
    )
    assert result.exit_code == 1
    assert "conflict, the first is kept" in result.output
    joined = Store(tmp_path / "all")
    assert joined.path(disturbed).read_bytes() == contents[disturbed.run_id]


def test_unusable_records_are_left_out_and_told(tmp_path, suite, runs, contents):
    one = filled(tmp_path / "one", suite, runs, contents)
    one.path(runs[0]).write_bytes(b"spoilt")
    merged = merge([one.folder], tmp_path / "all")
    assert merged.there == 7
    assert len(merged.unusable) == 1
    assert str(one.path(runs[0])) in merged.unusable[0]


def test_failures_are_joined_where_no_folder_has_the_result(tmp_path, suite, runs, contents):
    one = filled(tmp_path / "one", suite, runs, contents, slice(0, 6))
    two = filled(tmp_path / "two", suite, runs, contents, slice(0, 0))
    two.fail(runs[0], "killed")
    two.fail(runs[7], "killed, too")
    merge([one.folder, two.folder], tmp_path / "all")
    assert Store(tmp_path / "all").failures == {runs[7].run_id: "killed, too"}


@pytest.mark.parametrize("folders", [[], "results"])
def test_nothing_to_join_is_told(tmp_path, folders):
    with pytest.raises(UsageError, match="a list of one folder or more"):
        merge(folders, tmp_path)


def test_a_file_is_no_folder_of_results(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(MobmanError, match="it is a file"):
        Manifest.read(tmp_path / "file")


def test_other_suites_are_not_joined(tmp_path, suite, runs, contents):
    one = filled(tmp_path / "one", suite, runs, contents)
    other = suite.model_copy(update={"name": "other"})
    two = filled(tmp_path / "two", other, runs, contents)
    with pytest.raises(MobmanError, match="results of different suites: 'small' in"):
        merge([one.folder, two.folder], tmp_path / "all")
    assert not (tmp_path / "all").exists()


def test_an_unreadable_failure_is_still_a_failure(tmp_path, suite, runs, contents):
    store = filled(tmp_path, suite, runs, contents, slice(0, 0))
    (tmp_path / "failures" / f"{runs[0].run_id}.json").write_text("{")
    (reason,) = store.failures.values()
    assert "not readable" in reason


def test_what_the_suite_asked_for_survives_other_seeds(tmp_path, suite, runs, contents):
    """A folder of fewer seeds, asked for more: what is there still counts."""
    filled(tmp_path, suite, runs, contents)
    more = suite.model_copy(update={"seeds": [0, 1, 2]})
    store = Store(tmp_path)
    store.begin(more, more.runs())
    assert sum(store.done(run) for run in more.runs()) == 8
    assert len(json.loads((tmp_path / "suite.json").read_text())["runs"]) == 12


def test_a_record_whose_samples_are_damaged_is_told_and_its_run_done_again(
    tmp_path, suite, runs, contents
):
    """Whether the manifest has its hash, or the machine lost its power before."""
    store = filled(tmp_path, suite, runs, contents)
    for finished in (False, True):
        if finished:
            store.finish()
        victim = store.path(runs[1])
        with h5py.File(victim, "r") as file:
            chunk = file["q"].id.get_chunk_info(0)
        with victim.open("r+b") as file:
            file.seek(chunk.byte_offset)
            file.write(bytes(chunk.size))
        again = Store(tmp_path)
        assert [run for run in runs if not again.done(run)] == [runs[1]]
        assert "damaged" in reason(again, runs[1])
        store.keep(runs[1], contents[runs[1].run_id])


def test_results_of_other_sources_are_listed_and_redone_on_request(tmp_path, monkeypatch):
    suite = suite_of(["pseudo-inverse"], seeds=2)
    with ThreadPoolExecutor(1) as pool:
        run_suite(suite, tmp_path, executor=pool)
        assert not run_suite(suite, tmp_path, executor=pool).changed
        now = versions()
        monkeypatch.setattr(store_module, "versions", lambda: now | {"numba": "9.9"})
        kept = run_suite(suite, tmp_path, executor=pool)
        assert (kept.skipped, len(kept.outcomes)) == (2, 0)
        reasons = {difference for _, difference in kept.changed}
        assert reasons == {f"numba {now['numba']} then, 9.9 now"}
        again = run_suite(suite, tmp_path, executor=pool, redo_changed=True)
    assert (again.skipped, len(again.outcomes), again.changed) == (0, 2, [])


def test_a_power_cut_at_any_write_leaves_a_folder_that_resumes(tmp_path, monkeypatch):
    """What is not yet on disk when the power goes is lost, or, of a name, may be either."""
    suite = suite_of(["pseudo-inverse"], seeds=2)
    folder, cuts = tmp_path / "r", []
    synced: dict[Path, bytes] = {}
    fsync, replace_file = os.fsync, os.replace

    def cut():
        copy = tmp_path / f"cut-{len(cuts)}"
        for path in folder.rglob("*"):
            if path.is_file():
                kept = copy / path.relative_to(folder)
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_bytes(synced.get(path, b"")[: path.stat().st_size])
        cuts.append(copy)

    def noting_fsync(descriptor):
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        cut()
        fsync(descriptor)
        if path.is_file():
            synced[path] = path.read_bytes()
        cut()

    def noting_replace(source, target):
        replace_file(source, target)
        synced[Path(target)] = synced.pop(Path(source), b"")
        cut()

    monkeypatch.setattr(os, "fsync", noting_fsync)
    monkeypatch.setattr(os, "replace", noting_replace)
    with ThreadPoolExecutor(1) as pool:
        run_suite(suite, folder, executor=pool)
        monkeypatch.undo()
        expected = bits(folder, suite)
        assert len(cuts) > 20
        for copy in cuts:
            assert not run_suite(suite, copy, executor=pool).failed
            assert bits(copy, suite) == expected


def test_a_folder_of_an_earlier_mobman_is_reported_and_viewed_and_not_added_to(tmp_path):
    folder = tmp_path / "earlier"
    shutil.copytree(Path(__file__).parent / "earlier", folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    store = Store(folder)
    assert store.manifest.schema_version == 2
    records = [store.record(run) for run in store.runs]
    assert [record.status for record in records] == ["ok", "ok"]
    with pytest.raises(MobmanError, match=r"made by an earlier mobman .* new runs are not added"):
        run_suite(store.manifest.suite, folder, workers=1)
    with pytest.raises(MobmanError, match="made by an earlier mobman"):
        merge([folder], tmp_path / "joined")
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    page = CliRunner().invoke(command, ["bench", "report", str(folder)])
    assert page.exit_code == 0, page.output
    shown = CliRunner().invoke(
        command,
        [
            "view",
            str(store.path(store.runs[0])),
            "--html",
            str(tmp_path / "x.html"),
            "--no-browser",
        ],
    )
    assert shown.exit_code == 0, shown.output
    assert (tmp_path / "x.html").stat().st_size > 100_000
