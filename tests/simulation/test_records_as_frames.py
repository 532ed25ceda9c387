"""Records as an xarray tree and as a pandas frame: the numbers of the record, under names."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mobman as mm


@pytest.fixture(scope="module")
def record():
    return mm.simulate("youbot", "tsm", "paper", duration=0.03)


def test_tree_is_what_xarray_opens_in_the_file(record, tmp_path):
    tree = record.to_xarray()
    with xr.open_datatree(record.save(tmp_path / "run.h5"), engine="h5netcdf") as opened:
        assert tree.identical(opened.load())
    assert tree["torque"].sel(velocity="alpha_1").dims == ("t",)
    assert tree["error/task"].attrs["units"] == "m"
    assert tree["metrics"].attrs["torque_peak"] == record.metrics["torque_peak"]


def test_frame_has_every_sample_under_its_name(record, youbot):
    frame = record.to_pandas()
    assert frame.index.name == "t"
    assert np.array_equal(frame.index, record.t)
    columns = {
        "q": (record.q, youbot.joint_names),
        "z": (record.z, youbot.velocity_names),
        "torque": (record.torque, youbot.velocity_names),
        "tip/position": (record.tip_position, "xyz"),
        "tip/desired": (record.tip_desired, "xyz"),
        "error/task": (record.task_error, "xyz"),
        "error/auxiliary": (record.auxiliary_error, "01"),
        "sliding/s": (record.signals["sliding/s"], "01234"),
        "sliding/S": (record.signals["sliding/S"], "01234"),
    }
    names = [f"{place}/{part}" for place, (_, parts) in columns.items() for part in parts]
    assert sorted(frame.columns) == sorted([*names, "compute_time"])
    for place, (values, parts) in columns.items():
        found = frame[[f"{place}/{part}" for part in parts]].to_numpy()
        assert np.array_equal(found, values), place
    assert np.array_equal(frame["compute_time"], record.compute_time)


def test_signals_of_any_shape_are_columns(record):
    signals = {"mine": record.t, "gains/K": np.ones((len(record.t), 2, 2))}
    frame = mm.Record(**{**vars(record), "signals": signals}).to_pandas()
    assert np.array_equal(frame["mine"], record.t)
    assert {f"gains/K/{i}/{j}" for i in "01" for j in "01"} <= set(frame.columns)


def test_plot_has_sliding_variables_and_shares_of_the_limits(record):
    axes = {chart["layer"][0]["encoding"]["y"]["title"]: chart for chart in _charts(record)}
    assert {"|eᵉ|  (m)", "|eᵃ|", "|s|", "|S|", "share of the limit", "v  (N m or N)"} == set(axes)
    # every panel has its own curves: none shares the name of a view with another
    drawn = [chart["data"]["values"][0]["y"] for chart in axes.values()]
    assert len({tuple(values[:5]) for values in drawn}) == len(axes)
    assert not [layer for chart in axes.values() for layer in chart["layer"] if "name" in layer]


def test_shares_are_those_of_the_robots_limits(record, youbot):
    limits, (panel,) = youbot.limits, _shares(record)
    shares = {row["label"]: row for row in panel["data"]["values"]}
    largest = {
        "velocity": np.abs(record.z / limits.velocity).max(),
        "torque": np.abs(record.torque / limits.torque).max(),
    }
    for kind, expected in largest.items():
        # the curve leaves out bends of less than 0.1 % of its height, three decades: 10^0.003
        assert max(shares[kind]["y"]) == pytest.approx(expected, rel=7e-3)
    (line,) = [
        layer for layer in panel["layer"] if layer.get("data", {}).get("values") == [{"at": 1}]
    ]
    assert line["mark"]["type"] == "rule"


def test_record_without_its_robot_has_no_shares(record):
    assert not _shares(mm.Record(**{**vars(record), "urdf": {}}))


def _charts(record):
    return record.plot().to_dict()["vconcat"]


def _shares(record):
    return [
        chart
        for chart in _charts(record)
        if chart["layer"][0]["encoding"]["y"]["title"] == "share of the limit"
    ]
