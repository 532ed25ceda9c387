"""``mobman rerun``: what it prints, and its exit status."""

from __future__ import annotations

import json
import shutil

import h5py
import pytest
from support.command_line import mobman, mobman_process

import mobman as mm


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    record = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.02, scenario="disturbed")
    return record.save(tmp_path_factory.mktemp("runs") / "run.h5", every=4)


@pytest.fixture
def changed(good, tmp_path):
    path = shutil.copy(good, tmp_path / "changed.h5")
    with h5py.File(path, "a") as file:
        file["q"][2, 1] += 1e-3
    return path


def test_verified_run(good):
    """In another process: nothing that this one has set or computed makes it the same."""
    done = mobman_process("rerun", good, "--verify")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{good}: identical, bit for bit (")
    assert done.stdout.count("\n") == 1


def test_run_that_differs(changed):
    done = mobman("rerun", changed, "--verify")
    assert done.returncode == 1
    assert f"{changed}: differs in 1 (" in done.stdout
    assert "bit for bit)" in done.stdout
    assert "q differs by 0.001: at t = 0.008 s, base_y: " in done.stdout


def test_tolerance(changed):
    done = mobman("rerun", changed, "--verify", "--tolerance", "0.01")
    assert done.returncode == 0
    assert f"{changed}: equal within a tolerance of 0.01 (" in done.stdout


def test_every_file_is_looked_at(good, changed, tmp_path):
    done = mobman("rerun", tmp_path / "none.h5", changed, good, "--verify")
    assert done.returncode == 1
    assert "there is no record" in done.stderr
    assert f"{changed}: differs" in done.stdout
    assert f"{good}: identical" in done.stdout


def test_as_json(good, changed):
    done = mobman("rerun", good, changed, "--verify", "--json")
    assert done.returncode == 1
    first, second = json.loads(done.stdout)
    assert (first["equal"], second["equal"]) == (True, False)
    assert first["machine"] == first["versions"] == {}
    assert [item["name"] for item in second["compared"] if not item["equal"]] == ["q"]


def test_repeated_run_is_printed_and_saved(good, tmp_path):
    done = mobman("rerun", good, "-o", tmp_path / "new.h5")
    assert done.returncode == 0
    assert "|e^e| at the end" in done.stdout
    new = mm.load_record(tmp_path / "new.h5")
    assert new.state_sha256 == mm.load_record(good).state_sha256
    assert len(new.t) == 21


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["a.h5", "b.h5", "-o", "c.h5"], "-o is for one record; 2 files are given"),
        (["a.h5", "--tolerance", "1"], "--tolerance goes with --verify"),
        (["a.h5", "--verify", "--tolerance", "-1"], "-1.0 is not a number from 0 on"),
        (["a.h5", "--verify", "--tolerance", "nan"], "nan is not a number from 0 on"),
        (["a.h5", "--controller", "law"], "--controller: 'law' is not FILE.py:NAME"),
        ([], "Missing argument"),
    ],
)
def test_wrong_usage(arguments, reason):
    done = mobman("rerun", *arguments)
    assert done.returncode == 2
    assert reason in done.stderr


def test_what_is_no_record_is_told_in_one_line(tmp_path):
    (tmp_path / "run.h5").write_text("no", encoding="utf-8")
    done = mobman("rerun", str(tmp_path / "run.h5"), "--verify")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "is not a readable HDF5 file" in done.stderr
