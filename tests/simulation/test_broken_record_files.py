"""Files that cannot be written leave nothing behind; files that are no records are refused."""

from __future__ import annotations

import errno
import shutil

import h5py
import numpy as np
import pytest

import mobman as mm
from mobman.errors import MobmanError, RecordError, UsageError


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
    """Makes writing fail with an error at the metrics, the last thing in a file."""

    def install(error):
        original = h5py.Group.create_group

        def create_group(group, name, *args, **kwargs):
            if name == "metrics":
                raise error
            return original(group, name, *args, **kwargs)

        monkeypatch.setattr(h5py.Group, "create_group", create_group)

    return install


FULL = OSError(errno.ENOSPC, "No space left on device")


def test_full_disk_leaves_nothing_half_written(record, tmp_path, fail_late):
    fail_late(FULL)
    with pytest.raises(RecordError, match=r"cannot write the record .*run\.h5: .*No space left"):
        record.save(tmp_path / "run.h5")
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
    original = h5py.Group.create_group

    def look(group, name, *args, **kwargs):
        seen.append((tmp_path / "run.h5").exists())
        return original(group, name, *args, **kwargs)

    monkeypatch.setattr(h5py.Group, "create_group", look)
    record.save(tmp_path / "run.h5")
    assert seen
    assert not any(seen)
    assert (tmp_path / "run.h5").exists()


def test_place_that_cannot_be_written(record, tmp_path):
    (tmp_path / "taken").write_text("a file", encoding="utf-8")
    with pytest.raises(RecordError, match="cannot write the record"):
        record.save(tmp_path / "taken" / "run.h5")


def test_missing_file(tmp_path):
    assert "there is no record" in _refused(tmp_path / "none.h5")


def test_folder(tmp_path):
    assert "there is no record" in _refused(tmp_path)


@pytest.mark.parametrize("content", [b"", b"t,q\n0,1\n", b"\x89HDF\r\n\x1a\n" + b"\x00" * 50])
def test_file_that_is_not_hdf5(tmp_path, content):
    path = tmp_path / "run.h5"
    path.write_bytes(content)
    assert "is not a readable HDF5 file" in _refused(path)


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
    assert "reads version 1" in message


@pytest.mark.parametrize("place", ["t", "q", "error/task", "sliding/s", "metrics", "joint"])
def test_record_with_a_part_missing(file, place):
    with h5py.File(file, "a") as content:
        del content[place]
    assert "is not a whole record" in _refused(file)


@pytest.mark.parametrize("name", ["status", "seed", "spec_json", "signals"])
def test_record_with_an_attribute_missing(file, name):
    with h5py.File(file, "a") as content:
        del content.attrs[name]
    assert "is not a whole record" in _refused(file)


@pytest.mark.parametrize(
    ("name", "value"), [("spec_json", "{"), ("seed", "first"), ("decimation", "x"), ("signals", 3)]
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


@pytest.mark.parametrize("every", [0, -1])
def test_samples_can_be_thinned_out_forward_only(record, tmp_path, every):
    with pytest.raises(UsageError, match="every"):
        record.save(tmp_path / "run.h5", every=every)
