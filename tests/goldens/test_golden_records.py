"""Records in files: the samples, metrics and repetition of stored ones, the layout of a new one."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.golden_access import metrics_of
from support.goldens import (
    FOLDER,
    differences,
    metric_differences,
    mobman,
    plain,
    read_json,
    steady_metrics,
    terminal,
    write_json,
)

import mobman as mm

RECORDS, FILE, LAYOUT = FOLDER / "records", "record_metrics.json", FOLDER / "record_layout.txt"
TOLERANCE = 1e-9
RUNS = {
    "youbot": ("youbot", "extended-jacobian", "circle", "nominal"),
    "ridgeback_panda": ("ridgeback_panda", "pseudo-inverse", "circle", "saturated"),
}
FIELDS = {
    "t": "t",
    "q": "q",
    "z": "z",
    "torque": "torque",
    "tip/position": "tip_position",
    "tip/desired": "tip_desired",
    "error/task": "task_error",
    "error/auxiliary": "auxiliary_error",
    "compute_time": "compute_time",
}


def measured(record: mm.Record) -> dict[str, float]:
    """Metrics of its samples, with made-up values of what no record holds."""
    limited = np.arange(len(record.t)) % 7 == 3
    return steady_metrics(metrics_of(record, work=1.5, constraint_residual=2e-3, limited=limited))


def layout(file: h5py.File) -> str:
    """List groups, datasets and attributes of a file, one a line."""
    lines: list[str] = []

    def attributes(thing: h5py.HLObject, indent: str) -> None:
        for name in sorted(thing.attrs):
            value = thing.attrs[name]
            if name in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"):
                continue
            kind = type(value).__name__ if np.ndim(value) == 0 else f"{value.dtype} {value.shape}"
            shown = f" = {value}" if name in ("schema_version", "units") else ""
            lines.append(f"{indent}@{name}: {kind}{shown}")

    def visit(name: str, thing: h5py.HLObject) -> None:
        if isinstance(thing, h5py.Group):
            lines.append(f"{name}/")
        else:
            kind = "text" if h5py.check_string_dtype(thing.dtype) else thing.dtype.str
            size = "bytes" if name.startswith("urdf/") else thing.shape
            line = f"{name}: {kind} {size}, {thing.compression or 'not compressed'}"
            scales = [[scale.name.lstrip("/") for scale in dim.values()] for dim in thing.dims]
            if thing.is_scale:
                line += ", dimension scale"
            elif any(scales):
                line += f", scales {scales}"
            lines.append(line)
        attributes(thing, "  ")

    attributes(file, "")
    file.visititems(visit)
    return "\n".join(lines) + "\n"


def saved(folder):
    """The file of a short run with signals and an actuation between."""
    record = mm.simulate("youbot", "tsm", "circle", duration=0.1, scenario="saturated")
    return record.save(folder / "run.h5")


@pytest.mark.parametrize("name", RUNS)
def test_a_stored_record_is_read_as_it_is(name):
    path = RECORDS / f"{name}.h5"
    record = mm.load_record(path)
    with h5py.File(path) as file:
        for place, field in FIELDS.items():
            np.testing.assert_array_equal(getattr(record, field), file[place][()], err_msg=place)
        for place in file.attrs["signals"]:
            np.testing.assert_array_equal(record.signals[place], file[place][()], err_msg=place)
        assert record.metrics == pytest.approx(dict(file["metrics"].attrs), abs=0, nan_ok=True)
        for field in ("status", "robot", "controller", "task", "scenario", "seed", "created"):
            assert getattr(record, field) == file.attrs[field]
        assert record.settings == json.loads(file.attrs["settings_json"])
        assert record.joint_names == list(file["joint"].asstr())
        assert record.velocity_names == list(file["velocity"].asstr())


@pytest.mark.parametrize("name", RUNS)
def test_metrics_of_a_stored_record_are_those_stored(name):
    found = plain(measured(mm.load_record(RECORDS / f"{name}.h5")))
    problems = list(metric_differences(found, read_json(FILE)[name], TOLERANCE))
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("name", RUNS)
def test_a_stored_record_is_repeated(name, tmp_path):
    path, again = RECORDS / f"{name}.h5", tmp_path / "again.h5"
    with terminal():
        status, _, err = mobman("rerun", str(path), "-o", str(again))
    assert status == 0, err
    old, new = mm.load_record(path), mm.load_record(again)
    for field in ("t", "q", "z", "torque", "task_error", "auxiliary_error", "signals"):
        values = getattr(new, field), getattr(old, field)
        assert not list(differences(*values, TOLERANCE, where=field))
    assert not list(metric_differences(new.metrics, old.metrics, TOLERANCE))


def test_the_layout_of_a_record_is_the_one_stored(tmp_path):
    with h5py.File(saved(tmp_path)) as file:
        assert layout(file).splitlines() == LAYOUT.read_text(encoding="utf-8").splitlines()


# Making the files ---------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store records, their metrics and the layout of one; a record that is there stays as it is."""
    RECORDS.mkdir(exist_ok=True)
    found = {}
    for name, (robot, law, task, scenario) in RUNS.items():
        path = RECORDS / f"{name}.h5"
        if not path.exists():
            record = mm.simulate(robot, law, task, duration=0.1, scenario=scenario, seed=2)
            record.save(path, compression=9)
        found[name] = plain(measured(mm.load_record(path)))
    write_json(FILE, found)
    with tempfile.TemporaryDirectory() as folder, h5py.File(saved(Path(folder))) as file:
        LAYOUT.write_text(layout(file), encoding="utf-8")
