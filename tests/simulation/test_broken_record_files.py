"""Files that cannot be written leave nothing behind; files that are no records are refused."""

from __future__ import annotations

import dataclasses
import errno
import os
import resource
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

import mobman as mm
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.simulation.record import read_summary


@pytest.fixture(scope="module")
def record():
    return mm.simulate("youbot", "tsm", "paper", duration=0.02)


@pytest.fixture(scope="module")
def good(record, tmp_path_factory):
    return record.save(tmp_path_factory.mktemp("runs") / "good.h5")


@pytest.fixture
def file(good, tmp_path):
    """A copy that a test may spoil."""
    return shutil.copy(good, tmp_path / "run.h5")


def _refused(path) -> str:
    with pytest.raises(RecordError) as caught:
        mm.load_record(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    assert isinstance(caught.value, MobmanError)
    assert caught.value.exit_status == 1
    return message


@pytest.fixture
def fail_late(monkeypatch):
    """Makes writing fail with an error after half of a file."""

    def install(error):
        original = Path.write_bytes

        def write_bytes(path, content):
            original(path, content[: len(content) // 2])
            raise error

        monkeypatch.setattr(Path, "write_bytes", write_bytes)

    return install


FULL = OSError(errno.ENOSPC, "No space left on device")


def test_full_disk_leaves_nothing_half_written(record, tmp_path, fail_late):
    fail_late(FULL)
    with pytest.raises(RecordError, match=r"cannot write the record .*run\.h5: .*No space left"):
        record.save(tmp_path / "run.h5")
    assert list(tmp_path.iterdir()) == []


def test_disk_that_takes_less_than_the_file(record, tmp_path):
    """The system's own error, by a limit on the size of files."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        with pytest.raises(
            RecordError, match=r"cannot write the record .*run\.h5: File too large \("
        ):
            record.save(tmp_path / "run.h5")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("a bug")])
def test_interruption_leaves_nothing_half_written(record, tmp_path, fail_late, error):
    fail_late(error)
    with pytest.raises(type(error)):
        record.save(tmp_path / "run.h5")
    assert list(tmp_path.iterdir()) == []


def test_failure_keeps_the_file_that_was_there(record, file, fail_late):
    fail_late(FULL)
    before = file.read_bytes()
    with pytest.raises(RecordError):
        record.save(file)
    assert file.read_bytes() == before
    assert [entry.name for entry in file.parent.iterdir()] == ["run.h5"]


def test_file_appears_whole(record, tmp_path, monkeypatch):
    """While it is written, there is no file of the final name."""
    seen = []
    original = Path.write_bytes

    def look(path, content):
        written = original(path, content)
        seen.append((tmp_path / "run.h5").exists())
        return written

    monkeypatch.setattr(Path, "write_bytes", look)
    record.save(tmp_path / "run.h5")
    assert seen == [False]
    assert (tmp_path / "run.h5").exists()


def test_place_that_cannot_be_written(record, tmp_path):
    (tmp_path / "taken").write_text("a file", encoding="utf-8")
    with pytest.raises(RecordError, match="cannot write the record"):
        record.save(tmp_path / "taken" / "run.h5")


def test_missing_file(tmp_path):
    assert "there is no record" in _refused(tmp_path / "none.h5")


def test_folder(tmp_path):
    assert "there is no record" in _refused(tmp_path)
    assert "it is a folder" in _refused(tmp_path)


@pytest.mark.parametrize("content", [b"", b"t,q\n0,1\n", b"\x89HDF\r\n\x1a\n" + b"\x00" * 50])
def test_file_that_is_not_hdf5(tmp_path, content):
    path = tmp_path / "run.h5"
    path.write_bytes(content)
    message = _refused(path)
    assert "is not a readable HDF5 file" in message
    assert {b"": "it is empty", b"t": "it starts with b't,q"}.get(content[:1], "damaged") in message


def test_file_that_may_not_be_read(file, monkeypatch):
    """Even for a user who may read everything."""
    original = Path.open

    def refuse(path, *args, **kwargs):
        if path == file:
            raise PermissionError(errno.EACCES, "Permission denied")
        return original(path, *args, **kwargs)

    monkeypatch.setattr(Path, "open", refuse)
    assert "cannot read the record" in _refused(file)
    assert "Permission denied" in _refused(file)


def test_pipe(tmp_path):
    os.mkfifo(tmp_path / "run.h5")
    assert "it is no file" in _refused(tmp_path / "run.h5")


@pytest.mark.parametrize("part", [0.1, 0.5, 0.99])
def test_truncated_file(file, part):
    content = file.read_bytes()
    file.write_bytes(content[: int(part * len(content))])
    assert "is not a readable HDF5 file" in _refused(file)


def test_damaged_samples(file):
    """Compressed samples that have been overwritten."""
    with h5py.File(file) as content:
        chunk = content["q"].id.get_chunk_info(0)
    damaged = bytearray(file.read_bytes())
    damaged[chunk.byte_offset : chunk.byte_offset + chunk.size] = b"\xff" * chunk.size
    file.write_bytes(damaged)
    assert "run.h5" in _refused(file)


def test_hdf5_file_of_something_else(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as content:
        content["data"] = np.zeros(3)
    assert "not a mobman record" in _refused(path)


def test_record_of_a_later_schema(file):
    with h5py.File(file, "a") as content:
        content.attrs["schema_version"] = 99
    message = _refused(file)
    assert "99" in message
    assert "reads version 3" in message
    assert "a later mobman" in message


@pytest.mark.parametrize(
    ("version", "advice"),
    [(1, "run it again"), (0, "did not"), ("2", "did not"), ([2, 2], "did not")],
)
def test_record_of_an_older_schema_or_of_none(file, version, advice):
    with h5py.File(file, "a") as content:
        content.attrs["schema_version"] = version
    message = _refused(file)
    assert "has schema version" in message
    assert advice in message


@pytest.mark.parametrize("place", ["t", "q", "error/task", "sliding/s", "metrics", "joint"])
def test_record_with_a_part_missing(file, place):
    with h5py.File(file, "a") as content:
        del content[place]
    assert "is not a whole record" in _refused(file)


@pytest.mark.parametrize("name", ["status", "seed", "spec_json", "machine_json", "signals"])
def test_record_with_an_attribute_missing(file, name):
    with h5py.File(file, "a") as content:
        del content.attrs[name]
    assert "is not a whole record" in _refused(file)


@pytest.mark.parametrize(
    ("name", "value"),
    [("spec_json", "{"), ("seed", "first"), ("decimation", "x"), ("signals", 3), ("status", 3)],
)
def test_record_with_a_spoilt_attribute(file, name, value):
    with h5py.File(file, "a") as content:
        content.attrs[name] = value
    assert "is not a whole record" in _refused(file)


def test_record_with_a_group_for_a_dataset(file):
    with h5py.File(file, "a") as content:
        del content["q"]
        content.create_group("q")
    assert "is not a whole record" in _refused(file)


def test_record_with_fewer_samples_of_one_kind(file):
    with h5py.File(file, "a") as content:
        values = content["q"][:-1]
        del content["q"]
        content["q"] = values
    assert "q has shape (20, 8) for 21 times" in _refused(file)


def test_summary_is_refused_in_the_same_words(file):
    with h5py.File(file, "a") as content:
        content.attrs["schema_version"] = 1
    with pytest.raises(RecordError) as caught:
        read_summary(file)
    assert str(caught.value) == _refused(file)


def test_summary_says_what_the_record_says(record, good):
    summary = read_summary(good)
    for field in dataclasses.fields(summary):
        if field.name != "metrics":
            assert getattr(summary, field.name) == getattr(record, field.name)
    assert repr(summary.metrics) == repr(record.metrics)


@pytest.mark.parametrize("compression", [-1, 10, 2.5, True, "4"])
def test_compression_that_there_is_not(record, tmp_path, compression):
    with pytest.raises(UsageError, match=r"compression = .*: must be a whole number, from 0 to 9"):
        record.save(tmp_path / "run.h5", compression=compression)


@pytest.mark.parametrize("every", [0, -1, 1.5])
def test_samples_can_be_thinned_out_forward_only(record, tmp_path, every):
    with pytest.raises(UsageError, match="every"):
        record.save(tmp_path / "run.h5", every=every)
