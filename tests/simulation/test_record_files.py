"""Records on disk: the layout, and that what is read is what was written."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import time

import h5py
import numpy as np
import pytest

import mobman as mm

DATASETS = {
    # place: shape of a column, units
    "q": (8, "m or rad"),
    "z": (5, "1/s of its coordinate"),
    "torque": (5, "N m or N"),
    "tip/position": (3, "m"),
    "tip/desired": (3, "m"),
    "error/task": (3, "m"),
    "error/auxiliary": (2, "1"),
    "sliding/s": (5, "m/s^2"),
    "sliding/S": (5, "1/s^2 of its coordinate"),
    "compute_time": (None, "s"),
}


@pytest.fixture(scope="module")
def record():
    return mm.simulate(
        "youbot",
        mm.make_controller("tsm", a=0.2),
        "paper",
        duration=0.1,
        scenario="disturbed",
        seed=5,
    )


@pytest.fixture(scope="module")
def file(record, tmp_path_factory):
    return record.save(tmp_path_factory.mktemp("runs") / "run.h5")


def test_everything_comes_back(record, file):
    back = mm.load_record(file)
    for field in dataclasses.fields(record):
        before, after = getattr(record, field.name), getattr(back, field.name)
        if isinstance(before, np.ndarray):
            assert np.array_equal(before, after, equal_nan=True), field.name
            assert before.dtype == after.dtype
        elif field.name not in ("signals", "metrics"):
            assert after == before, field.name
    assert back.signals.keys() == record.signals.keys()
    assert all(np.array_equal(back.signals[k], record.signals[k]) for k in record.signals)
    assert back.metrics.keys() == record.metrics.keys()
    for name, value in record.metrics.items():
        assert back.metrics[name] == value or (math.isnan(value) and math.isnan(back.metrics[name]))


def test_attributes(record, file):
    with h5py.File(file) as content:
        attributes = dict(content.attrs)
    assert attributes["schema_version"] == 3
    assert attributes["seed"] == 5
    for name in ("status", "message", "robot", "controller", "task", "scenario", "created"):
        assert attributes[name] == getattr(record, name)
    assert attributes["urdf_sha256"] == record.urdf_sha256
    assert attributes["state_sha256"] == record.state_sha256
    assert json.loads(attributes["machine_json"]) == record.machine
    assert json.loads(attributes["spec_json"]) == record.spec
    assert json.loads(attributes["versions_json"]) == record.versions
    assert json.loads(attributes["settings_json"]) == record.settings


def test_datasets_have_units_a_description_and_the_time_as_their_scale(file):
    with h5py.File(file) as content:
        assert content["t"].attrs["units"] == "s"
        assert content["t"].is_scale
        for place, (columns, units) in DATASETS.items():
            data = content[place]
            assert data.shape == ((101,) if columns is None else (101, columns))
            assert data.dtype == np.float64
            assert data.attrs["units"] == units
            assert data.attrs["description"]
            assert data.dims[0][0].name == "/t"


def test_columns_are_named(file, youbot):
    with h5py.File(file) as content:
        for place, names in (
            ("q", youbot.joint_names),
            ("z", youbot.velocity_names),
            ("torque", youbot.velocity_names),
            ("tip/position", ["x", "y", "z"]),
            ("error/task", ["x", "y", "z"]),
        ):
            assert [name.decode() for name in content[place].dims[1][0][()]] == names


def test_metrics_are_attributes_of_their_group(record, file):
    with h5py.File(file) as content:
        assert dict(content["metrics"].attrs).keys() == record.metrics.keys()
        assert content["metrics"].attrs["task_error_final"] == record.metrics["task_error_final"]


def test_ten_lines_without_mobman(record, file):
    """What a reader of the file who does not have mobman would write."""
    with h5py.File(file) as run:
        t = run["t"][()]
        error = np.linalg.norm(run["error/task"][()], axis=1)
        robot, controller = run.attrs["robot"], run.attrs["controller"]
        settled = run["metrics"].attrs["settling_time_1e-4"]
        gains = json.loads(run.attrs["settings_json"])
    assert (robot, controller, gains["a"]) == ("youbot", "tsm", 0.2)
    assert t[-1] == pytest.approx(0.1)
    assert error[0] == pytest.approx(4.05, abs=0.01)
    assert math.isinf(settled)


def test_every_so_many_th_sample(record, tmp_path):
    back = mm.load_record(record.save(tmp_path / "run.h5", every=10))
    assert np.array_equal(back.t, record.t[::10])
    assert np.array_equal(back.q, record.q[::10])
    assert np.array_equal(back.signals["sliding/s"], record.signals["sliding/s"][::10])
    assert back.decimation == 10
    assert back.metrics["torque_peak"] == record.metrics["torque_peak"]  # of all samples
    again = mm.load_record(back.save(tmp_path / "again.h5", every=2))
    assert again.decimation == 20
    assert np.array_equal(again.t, record.t[::20])


def test_hash_is_of_the_states_and_torques_at_every_tick(record, tmp_path):
    parts = (record.t, record.q, record.z, record.torque)
    content = b"".join(np.asarray(part, dtype="<f8").tobytes(order="C") for part in parts)
    assert record.state_sha256 == hashlib.sha256(content).hexdigest()
    back = mm.load_record(record.save(tmp_path / "run.h5", every=7))
    assert back.state_sha256 == record.state_sha256  # of all ticks, not of those in the file
    same = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.01)
    other = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.011)
    assert len({record.state_sha256, same.state_sha256, other.state_sha256}) == 3


@pytest.mark.parametrize("compression", [0, 1, 4, 9])
@pytest.mark.parametrize("every", [1, 7])
def test_every_number_comes_back_whatever_the_compression(record, tmp_path, compression, every):
    odd = dataclasses.replace(record, torque=record.torque.copy())
    odd.torque[3:7, 0] = [np.nan, np.inf, -np.inf, -0.0]
    path = odd.save(tmp_path / "run.h5", every=every, compression=compression)
    back = mm.load_record(path)
    kept = sorted({*range(0, 101, every), 100})
    assert back.torque.tobytes() == odd.torque[kept].tobytes()
    assert back.q.tobytes() == odd.q[kept].tobytes()
    assert back.signals["sliding/S"].tobytes() == odd.signals["sliding/S"][kept].tobytes()
    with h5py.File(path) as content:
        assert content["q"].compression_opts == (compression or None)


def test_long_runs_have_several_chunks(record, tmp_path):
    """As many samples as need more than one chunk, and do not fill the last one."""
    random = np.random.default_rng(0)
    n = 40_001
    long = dataclasses.replace(
        record,
        **{
            name: random.standard_normal((n, *getattr(record, name).shape[1:])).round(name == "z")
            for name in ("q", "z", "torque", "tip_position", "tip_desired", "task_error")
        },
        auxiliary_error=np.zeros((n, 2)),
        compute_time=np.full(n, 1e-4),
        t=np.arange(n) * 1e-3,
        signals={"own/table": random.standard_normal((n, 2, 3)), "own/one": np.ones(n)},
    )
    path = long.save(tmp_path / "run.h5")
    back = mm.load_record(path)
    for name in ("t", "q", "z", "torque", "auxiliary_error", "compute_time"):
        assert np.array_equal(getattr(back, name), getattr(long, name))
    assert np.array_equal(back.signals["own/table"], long.signals["own/table"])
    with h5py.File(path) as content:
        assert content["q"].chunks[0] < n
        assert content["q"].chunks[1] == 1


def test_content_in_memory_is_that_of_the_file(record, tmp_path):
    path = record.save(tmp_path / "run.h5", every=3, compression=1)
    assert path.read_bytes() == record.to_bytes(every=3, compression=1)


def test_a_record_makes_the_same_bytes_at_any_time(record):
    """HDF5's clock has seconds."""
    first = record.to_bytes()
    time.sleep(1.1)
    assert record.to_bytes() == first


def test_records_do_not_mix(record, tmp_path):
    """The files are made in memory, where HDF5 tells them apart by their names."""
    other = dataclasses.replace(record, message="another", seed=8, metrics=dict(record.metrics))
    other.metrics["torque_peak"] = 1.5
    first, second = record.save(tmp_path / "1.h5"), other.save(tmp_path / "2.h5")
    again = record.save(tmp_path / "3.h5")
    assert first.read_bytes() == again.read_bytes()
    back = mm.load_record(second)
    assert (back.message, back.seed, back.metrics["torque_peak"]) == ("another", 8, 1.5)


def test_urdf_is_in_the_file(record, file, youbot):
    path = youbot.urdf.path
    assert mm.load_record(file).urdf == {"0/youbot.urdf": path.read_bytes()}
    with h5py.File(file) as content:
        assert content["urdf/0/youbot.urdf"][()].tobytes() == path.read_bytes()


def test_text_that_hdf5_has_no_way_for(record, tmp_path):
    odd = dataclasses.replace(record, message="a\0b \udcff", spec={"path": "\udcff"})
    back = mm.load_record(odd.save(tmp_path / "run.h5"))
    assert back.message == "a\\0b \\udcff"
    assert back.spec == odd.spec


@pytest.mark.slow
def test_ten_seconds_fit_in_their_budget(robot):
    """1.5 MB for 10 s at 1 kHz, one sample every 5 ms kept."""
    record = mm.simulate(robot, "tsm", "circle", duration=10.0)
    assert len(record.to_bytes(every=5)) < 1.5e6


def test_folders_are_made_and_files_replaced(record, file, tmp_path):
    path = tmp_path / "a" / "b" / "run.h5"
    assert record.save(path) == path
    other = dataclasses.replace(record, message="another")
    other.save(str(path))
    assert mm.load_record(path).message == "another"
    assert [entry.name for entry in path.parent.iterdir()] == ["run.h5"]


def test_file_is_smaller_than_its_numbers(record, file):
    held = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.05)
    assert file.stat().st_size < 2_000_000
    assert held.save(file.parent / "held.h5").stat().st_size < 200_000


@pytest.mark.parametrize("law", ["tsm-simplified", "extended-jacobian"])
def test_records_of_other_laws(law, tmp_path, tiago):
    """Signals of another length, or none at all."""
    record = mm.simulate(tiago, law, "circle", duration=0.02)
    back = mm.load_record(record.save(tmp_path / "run.h5"))
    assert back.signals.keys() == record.signals.keys()
    assert back.joint_names == tiago.joint_names
    if law == "tsm-simplified":
        assert back.signals["sliding/s"].shape == (21, 3)
        assert back.signals["sliding/S"].shape == (21, tiago.nz)


def test_long_rest_is_read_again(record, tmp_path):
    """Columns of zeros are compressed by more than what a small file may hold."""
    n = 200_000
    rest = {
        field.name: np.zeros((n, *getattr(record, field.name).shape[1:]))
        for field in dataclasses.fields(record)
        if isinstance(getattr(record, field.name), np.ndarray)
    }
    rest = dataclasses.replace(record, **rest, signals={}, decimation=1)
    back = mm.load_record(rest.save(tmp_path / "run.h5"))
    assert np.array_equal(back.q, rest.q)
