"""Folders of results and URDFs of unknown origin: links out of them, pipes, wrong types, sizes."""

from __future__ import annotations

import json
import os
import shutil

import pytest

from mobman.benchmark.store import Store

ROBOT = '<robot name="r">{}</robot>'


@pytest.fixture
def folder(results, good):
    """A folder of results with one run that was done and one that was not."""
    made, places = results(2)
    shutil.copy(good, places[0])
    return made


def _texts(folder):
    kinds = (".html", ".md", ".csv", ".json", ".svg")
    files = [path for path in folder.rglob("*") if path.suffix in kinds and path.is_file()]
    return [path.read_text(encoding="utf-8", errors="replace") for path in files]


def test_failure_that_is_a_link_to_another_file(folder, trap, mobman, harmless):
    trap.secret.write_bytes(trap.secret.read_bytes() + b"\xff")  # not UTF-8
    (folder / "failures" / "x.json").symlink_to(trap.secret)
    done = mobman("bench", "report", folder)
    assert done.status == 0
    (folder / "failures" / "x.json").unlink()
    harmless(*_texts(folder), done.out, done.err)


def test_record_that_is_a_link_to_another_file(folder, trap, mobman, harmless):
    (record,) = (path for path in (folder / "runs").glob("*.h5"))
    record.unlink()
    record.symlink_to(trap.secret)
    done = mobman("bench", "report", folder)
    assert done.status == 0
    record.unlink()
    texts = _texts(folder)
    harmless(*texts)
    assert any("is a link out of" in text for text in texts)
    assert not any("CANARY-5" in text for text in texts)


def test_other_file_that_is_a_link_to_another(folder, trap, mobman, harmless):
    (folder / "runs" / "other.h5").symlink_to(trap.secret)
    assert mobman("bench", "report", folder).status == 0
    (folder / "runs" / "other.h5").unlink()
    texts = _texts(folder)
    harmless(*texts)
    assert any("is a link out of" in text for text in texts)
    assert not any("CANARY-5" in text for text in texts)


def test_runs_on_another_disk(folder, tmp_path, mobman):
    """The folder of the records may be a link, as on clusters."""
    (folder / "runs").rename(tmp_path / "scratch")
    (folder / "runs").symlink_to(tmp_path / "scratch")
    assert mobman("bench", "report", folder).status == 0
    assert "is a link out of" not in (folder / "report.html").read_text(encoding="utf-8")


def test_pipe_for_the_manifest(folder, mobman):
    (folder / "suite.json").unlink()
    os.mkfifo(folder / "suite.json")
    done = mobman("bench", "report", folder)
    assert done.status == 1
    assert "suite.json: it is a pipe" in done.err


def test_pipe_for_a_failure(folder, mobman):
    done = {run.stem for run in (folder / "runs").glob("*.h5")}
    (missing,) = {run.run_id for run in Store(folder).runs} - done
    os.mkfifo(folder / "failures" / f"{missing}.json")
    assert mobman("bench", "report", folder).status == 0
    assert "it is a pipe" in (folder / "report.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["figures", "replays"])
def test_folder_that_is_a_link_to_another(folder, tmp_path, name, mobman):
    victim = tmp_path / "victim"
    victim.mkdir()
    (folder / name).symlink_to(victim)
    done = mobman("bench", "report", folder, "--replays")
    assert done.status == 2
    assert "is a link out of" in done.err
    assert list(victim.iterdir()) == []


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("robot", ["youbot"]),
        ("label", {"a": 1}),
        ("duration", "x"),
        ("duration", 10**400),
        ("family", None),
        ("seed", 1.5),
        ("scenario", 0.5),
    ],
)
def test_run_of_wrong_type(folder, field, value, mobman, harmless):
    path = folder / "suite.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    content["runs"][0][field] = value
    path.write_text(json.dumps(content), encoding="utf-8")
    done = mobman("bench", "report", folder)
    assert done.status == 1
    assert "is not whole" in done.err
    harmless(done.err)


@pytest.mark.parametrize("value", ["x", float("inf"), [1]])
def test_seconds_of_wrong_type(folder, value, mobman, harmless):
    path = folder / "suite.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**content, "seconds": value}), encoding="utf-8")
    for done in (
        mobman("bench", "report", folder),
        mobman("bench", "merge", folder, "-o", folder / "all"),
    ):
        assert done.status == 1
        assert "seconds is" in done.err
        harmless(done.err)


def _chain(count, kind):
    links = "".join(f'<link name="l{i}"/>' for i in range(count + 1))
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for i in range(count)
    )
    return ROBOT.format(links + joints)


@pytest.mark.parametrize(
    ("count", "kind", "reason"),
    [
        (20_000, "fixed", "it has 20001 links; allowed: 500"),
        (400, "continuous", "it has 400 movable joints; allowed: 150"),
    ],
)
def test_urdf_that_is_too_large(trap, count, kind, reason, mobman):
    path = trap.folder / "large.urdf"
    path.write_text(_chain(count, kind), encoding="utf-8")
    done = mobman("robots", "add", path, "-o", trap.folder / "large.toml")
    assert done.status == 2
    assert reason in done.err
