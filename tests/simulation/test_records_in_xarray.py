"""Records open in xarray with their coordinates and units."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

import mobman as mm


@pytest.fixture(scope="module")
def record():
    return mm.simulate("youbot", "tsm", "paper", duration=0.03)


@pytest.fixture(scope="module")
def file(record, tmp_path_factory):
    return record.save(tmp_path_factory.mktemp("runs") / "run.h5")


def _open(file, **options):
    return xarray.open_dataset(file, engine="h5netcdf", **options)


def test_root_has_the_states_with_their_coordinates(record, file, youbot):
    with _open(file) as run:
        assert {"q", "z", "torque", "compute_time"} <= set(run.data_vars)
        assert run.q.dims == ("t", "joint")
        assert run.z.dims == run.torque.dims == ("t", "velocity")
        assert run.joint.values.tolist() == youbot.joint_names
        assert np.array_equal(run.t, record.t)
        assert np.array_equal(run.q.sel(joint="y_2"), record.q[:, 6])
        assert np.array_equal(run.torque.sel(velocity="alpha_1"), record.torque[:, 0])


def test_units_and_attributes_are_there(record, file):
    with _open(file) as run:
        assert run.t.attrs["units"] == "s"
        assert run.torque.attrs["units"] == "N m or N"
        assert run.attrs["status"] == "ok"
        assert run.attrs["urdf_sha256"] == record.urdf_sha256


def test_time_can_be_chosen_by_value(record, file):
    with _open(file) as run:
        assert np.array_equal(run.q.sel(t=0.012, method="nearest"), record.q[12])


@pytest.mark.parametrize(
    ("group", "variables"),
    [
        ("tip", {"position": "tip_position", "desired": "tip_desired"}),
        ("error", {"task": "task_error", "auxiliary": "auxiliary_error"}),
        ("sliding", {"s": "sliding/s", "S": "sliding/S"}),
    ],
)
def test_groups_hold_their_samples(record, file, group, variables):
    with _open(file, group=group) as part:
        assert set(part.data_vars) == set(variables)
        for name, field in variables.items():
            expected = record.signals[field] if "/" in field else getattr(record, field)
            assert part[name].dims[0] == "t"
            assert np.array_equal(part[name], expected)
            assert part[name].attrs["units"]


def test_metrics_are_a_group(record, file):
    with _open(file, group="metrics") as part:
        assert part.attrs["torque_peak"] == record.metrics["torque_peak"]


def test_groups_have_the_roots_coordinates_in_a_tree(record, file):
    with xarray.open_datatree(file, engine="h5netcdf") as tree:
        error = tree["error"].to_dataset()
        assert np.array_equal(error.t, record.t)
        assert error.task.dims == ("t", "axis")
        assert error.axis.values.tolist() == ["x", "y", "z"]
        assert np.array_equal(error.task.sel(axis="y"), record.task_error[:, 1])


def test_baseline_without_signals_opens_too(tmp_path):
    record = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.01)
    with xarray.open_datatree(record.save(tmp_path / "run.h5"), engine="h5netcdf") as tree:
        assert set(tree.children) == {"error", "metrics", "tip", "urdf"}


def test_every_dataset_has_units_and_a_description(file):
    with xarray.open_datatree(file, engine="h5netcdf") as tree:
        named = [
            (f"{node.path}/{name}", v)
            for node in tree.subtree
            for name, v in node.variables.items()
        ]
        assert len(named) > 15
        for name, variable in named:
            assert "units" in variable.attrs, name
            assert variable.attrs["description"], name
            assert not any(dim.startswith("phony") for dim in variable.dims), name


def test_urdf_is_there_byte_by_byte(file, youbot):
    with xarray.open_datatree(file, engine="h5netcdf") as tree:
        content = tree["urdf/0/youbot.urdf"].values.tobytes()
    assert content == youbot.urdf.path.read_bytes()


@pytest.mark.parametrize("compression", [0, 9])
def test_any_compression_opens(record, tmp_path, compression):
    path = record.save(tmp_path / "run.h5", every=4, compression=compression)
    with xarray.open_datatree(path, engine="h5netcdf") as tree:
        assert np.array_equal(tree["q"], record.q[[*range(0, 31, 4), 30]])
