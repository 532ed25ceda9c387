"""Records on disk: the layout, and that what is read is what was written."""

from __future__ import annotations

import dataclasses
import json
import math

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
    assert attributes["schema_version"] == 1
    assert attributes["seed"] == 5
    for name in ("status", "message", "robot", "controller", "task", "scenario", "created"):
        assert attributes[name] == getattr(record, name)
    assert attributes["urdf_sha256"] == record.urdf_sha256
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
