"""Files for other tools, in the form that their suffix names."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from mobman.bridges.mcap_file import mcap_content
from mobman.bridges.mjcf_file import mjcf_content
from mobman.errors import MobmanError, UsageError
from mobman.files import as_path, write_all
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.record import Record, load_record
from mobman.viewer.scene import robot_of_run

SUFFIXES = (".csv", ".mcap", ".xml")


def export(what: Record | MobileManipulator | str | os.PathLike[str], path: Any) -> tuple[str, ...]:
    """Write a run as CSV (``.csv``) or MCAP (``.mcap``), or a robot as MuJoCo's XML (``.xml``).

    >>> import mobman as mm
    >>> from mobman.bridges.export import export
    >>> record = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05)
    >>> export(record, "run.csv")
    ()

    Args:
        what: A record or its file, or for MuJoCo a robot by name, file or object; of a record its robot.
        path: The file; one that is there is replaced. What is not in it as it should be is returned.

    Raises:
        MobmanError: If the suffix is another, what it needs is not installed, the record or the robot
            cannot be read, or the file cannot be written.
    """
    file = as_path("path", path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError(f"cannot export to {file.name}: allowed: {', '.join(SUFFIXES)}")
    folder = None
    if isinstance(what, (str, os.PathLike)):
        given = Path(what)
        if given.suffix.lower() in (".h5", ".hdf5"):
            what, folder = load_record(given), given.absolute().parent
        elif suffix == ".xml":
            what = load_robot(what)
    record = what if isinstance(what, Record) else None
    robot = what if isinstance(what, MobileManipulator) else None
    problem, remarks = f"{what!r}", tuple[str, ...]()
    if record is None and suffix != ".xml":
        raise UsageError(f"{what!r} is no record, which a {suffix} file is made of")
    if record is not None and suffix != ".csv":
        robot, problem = robot_of_run(record, folder)
    if record is not None and suffix == ".csv":
        content = csv_content(record)
    elif record is not None and suffix == ".mcap":
        content, remarks = mcap_content(record, robot)
        remarks += (f"the robot is left out: {problem}",) if robot is None else ()
    elif robot is not None:
        content, remarks = mjcf_content(robot)
    else:
        raise MobmanError(f"there is no robot to write: {problem}")
    write_all({file: content})
    return remarks


def csv_content(record: Record) -> bytes:
    """The content of a file with a row a sample, and columns as :meth:`mobman.Record.to_pandas` names
    them, with units: ``t [s]``, ``torque/alpha_1 [N m or N]``. Numbers come back to the last bit."""
    frame = record.to_pandas()
    units = {name: f"{name} [{unit}]" for name, (_, unit) in frame.attrs["places"].items()}
    text = frame.rename(columns=units).to_csv(index_label="t [s]", lineterminator="\n")
    return bytes(text.encode())
