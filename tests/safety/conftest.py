"""A good record to spoil, and the commands that read records, in this process."""

from __future__ import annotations

import faulthandler
import json
import resource
import shutil
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest
from support.crafted_records import SECRET, Trap
from support.suites import suite_of

import mobman as mm
from mobman.benchmark.store import Store
from mobman.cli.main import main
from mobman.isolation import helper

HANG = 60.0  # s; nothing here takes a tenth of it, and what hangs never ends
MEMORY = 2**30  # bytes


@pytest.fixture(scope="session")
def good(tmp_path_factory):
    """A record of 21 samples."""
    record = mm.simulate("youbot", "tsm", "circle", duration=0.02, scenario="disturbed")
    return record.save(tmp_path_factory.mktemp("good") / "good.h5")


@pytest.fixture
def trap(tmp_path):
    """A folder for a record, with what must not be read or run around it."""
    folder = tmp_path / "strange"
    folder.mkdir()
    made = Trap(folder)
    made.lay()
    return made


@pytest.fixture
def craft(good, trap):
    """Makes a copy of the good record with a change, and gives its path."""

    def make(change, name="run.h5", **attributes):
        path = Path(shutil.copy(good, trap.folder / name))
        with h5py.File(path, "a", locking=False) as file:
            file.attrs.update(attributes)
            if "seed" in attributes:  # a record is that of its run by its description
                spec = json.loads(file.attrs["spec_json"]) | {"seed": attributes["seed"]}
                file.attrs["spec_json"] = json.dumps(spec)
            change(file, trap)
        return path

    return make


def _status(command):
    try:
        command()
    except SystemExit as left:
        return left.code or 0
    return 0


@pytest.fixture
def mobman(monkeypatch, capsys, trap):
    """Runs a command as the shell does; it must not hang, nor print a traceback."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["mobman", *map(str, arguments)])
        monkeypatch.chdir(trap.folder)
        faulthandler.dump_traceback_later(HANG, exit=True, file=sys.__stderr__)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("always")  # a process of its own shows each, too
                status = _status(main)
        finally:
            faulthandler.cancel_dump_traceback_later()
        out, err = capsys.readouterr()
        return SimpleNamespace(status=status, out=out, err=err)

    return run


@pytest.fixture
def harmless(trap):
    """Checks what is left behind: no code was run, nothing was read that is not the record's."""

    def check(*texts):
        assert not trap.marker.exists(), "code was run that a file names"
        for text in texts:
            assert SECRET.decode().strip() not in text
            assert "5551212" not in text  # of the mesh
            assert "Traceback" not in text
            assert "internal error" not in text

    return check


def memory_of_helper():
    """The most memory that the process has had which reads files (bytes); 0 if there is none."""
    process = helper._process
    if process is None or process.poll() is not None:
        return 0
    status = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii")
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


@pytest.fixture
def modest():
    """Checks that neither this process nor the one that reads files took a gigabyte for it."""
    if sys.platform != "linux":
        pytest.skip("the memory of another process is not told here")
    # the processes that other tests have started in this one count, too: only what is more counts
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    before = [resource.getrusage(kind).ru_maxrss for kind in kinds]
    yield
    grown, children = (
        resource.getrusage(kind).ru_maxrss - was for kind, was in zip(kinds, before, strict=True)
    )
    assert 1024 * grown < MEMORY / 2
    assert memory_of_helper() < MEMORY
    # a process that was forked counts what this one had then
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    largest = children + before[1]
    assert children == 0 or 1024 * largest < MEMORY or largest <= own


@pytest.fixture
def results(good, tmp_path):
    """A folder of results of a suite with so many runs, and the places of their records."""

    def make(count):
        suite = suite_of(["tsm"], seeds=count, duration=0.02)
        store = Store(tmp_path / "results")
        runs = suite.runs()
        store.begin(suite, runs)
        return store.folder, [store.path(run) for run in runs]

    return make
