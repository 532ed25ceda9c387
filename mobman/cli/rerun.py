"""``mobman rerun``: a run again from its record, and whether it is the same."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mobman.cli.output import echo, print_json, progress_bar
from mobman.cli.run import tell
from mobman.errors import MobmanError

if TYPE_CHECKING:
    from mobman.simulation.rerun import Own, Verification

_TOLD = 5


@click.command()
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
@click.option(
    "--verify",
    "verifies",
    is_flag=True,
    help="Compare with what is in the file: bit for bit, or within a tolerance on another processor "
    "or with other versions.",
)
@click.option(
    "--tolerance",
    type=float,
    metavar="X",
    help="With --verify: largest difference, over the larger of 1 and the largest value, 100 times as "
    "much in torques and signals; 0 for bit for bit.  [default: 0, or 1e-4 on another processor or with "
    "other versions]",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="HDF5 file for the new record, at every tick.",
)
@click.option(
    "--robot",
    metavar="FILE",
    help="Robot (a TOML file or a name) to use instead of the record's, for a platform that is Python "
    "code.",
)
@click.option(
    "--controller",
    metavar="FILE.py:NAME",
    help="Python code of a law that is not registered: called without arguments, gives the controller.",
)
@click.option(
    "--task",
    metavar="FILE.py:NAME",
    help="Python code of a task that is not registered: called with the robot and q0, gives the task.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def rerun(
    files: tuple[Path, ...],
    verifies: bool,
    tolerance: float | None,
    output: Path | None,
    robot: str | None,
    controller: str | None,
    task: str | None,
    as_json: bool,
) -> None:
    """Repeat the run of each record FILE from the file alone.

    No code is taken from the file. What is Python code, and not registered, is named by --robot,
    --controller and --task.

    Exit status 1 if a run cannot be repeated, if it diverged or met a singularity, or, with --verify, if
    the repetition differs from the file.
    """
    if output is not None and len(files) > 1:
        raise click.UsageError(f"-o is for one record; {len(files)} files are given")
    if tolerance is not None and not verifies:
        raise click.UsageError("--tolerance goes with --verify")
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise click.BadParameter(f"{tolerance} is not a number from 0 on", param_hint="--tolerance")
    told: list[dict[str, Any]] = []
    failed = False
    own = _own(robot, controller, task)
    for file in files:
        try:
            if verifies:
                failed |= not _verify(file, tolerance, output, own, told, as_json=as_json)
            else:
                failed |= not _repeat(file, output, own, as_json=as_json)
        except MobmanError as error:
            if len(files) == 1:
                raise
            echo(f"mobman: {' '.join(str(error).split())}", err=True)
            failed = True
    if verifies and as_json:
        print_json(told)
    if failed:
        raise click.exceptions.Exit(1)


def _own(robot: str | None, controller: str | None, task: str | None) -> Own:
    """What the user names instead of the record's parts."""
    from mobman.model.build import load_robot
    from mobman.simulation.rerun import Own

    law = None
    if controller is not None:
        try:
            law = _code(controller, "--controller")()
        except (Exception, SystemExit) as error:  # the user's code may raise anything
            raise click.BadParameter(
                f"calling {controller} failed: {error!r}", param_hint="--controller"
            ) from error
    return Own(
        robot=None if robot is None else load_robot(robot),
        controller=law,
        make_task=None if task is None else _code(task, "--task"),
    )


def _code(name: str, option: str) -> Any:
    from mobman.model.platforms.types.custom import load_code

    if ":" not in name:
        raise click.BadParameter(f"{name!r} is not FILE.py:NAME", param_hint=option)
    return load_code(name, Path.cwd(), f"{option} {name}")


def _repeat(file: Path, output: Path | None, own: Own, *, as_json: bool) -> bool:
    from mobman.simulation.rerun import repeat

    with progress_bar(str(file)) as progress:
        record = repeat(file, own=own, progress=progress)
    tell(record, None if output is None else record.save(output), as_json=as_json)
    if not record.ok:
        echo(f"mobman: the run ended as {record.status} {record.message}", err=True)
    return record.ok


def _verify(
    file: Path,
    tolerance: float | None,
    output: Path | None,
    own: Own,
    told: list[dict[str, Any]],
    *,
    as_json: bool,
) -> bool:
    from mobman.simulation.rerun import verify

    with progress_bar(str(file)) as progress:
        found = verify(file, tolerance=tolerance, own=own, progress=progress)
    saved = None if output is None else found.record.save(output)
    if as_json:
        told.append(_as_json(file, found, saved))
        return found.equal
    echo(f"{file}: {_verdict(found)}")
    for line in _circumstances(found):
        echo(f"  {line}")
    for item in found.differences[:_TOLD]:
        by = "" if math.isnan(item.difference) else f" by {item.difference:.3g}"
        echo(f"  {item.name} differs{by}: {item.where}")
    if len(found.differences) > _TOLD:
        echo(f"  and {len(found.differences) - _TOLD} more (see --json)")
    if saved is not None:
        echo(f"record: {saved}")
    return found.equal


def _verdict(found: Verification) -> str:
    metrics = sum(item.name.startswith("metrics/") for item in found.compared)
    what = f"{len(found.compared)} compared, {metrics} of them metrics"
    if found.identical:
        return f"identical, bit for bit ({what})"
    if found.equal:
        return f"equal within a tolerance of {found.tolerance:g} ({what})"
    how = "bit for bit" if found.tolerance == 0.0 else f"with a tolerance of {found.tolerance:g}"
    return f"differs in {len(found.differences)} ({what}, {how})"


def _circumstances(found: Verification) -> list[str]:
    lines = [
        f"other {name}: {was or 'unknown'} then, {now or 'unknown'} now"
        for name, (was, now) in {**found.machine, **found.versions}.items()
    ]
    if lines and found.tolerance > 0.0:
        lines.append("these round in other ways, so the comparison is within a tolerance")
    return lines + ([found.note] if found.note else [])


def _as_json(file: Path, found: Verification, saved: Path | None) -> dict[str, Any]:
    return {
        "file": str(file),
        "equal": found.equal,
        "identical": found.identical,
        "tolerance": found.tolerance,
        "machine": {name: {"then": w, "now": n} for name, (w, n) in found.machine.items()},
        "versions": {name: {"then": w, "now": n} for name, (w, n) in found.versions.items()},
        "note": found.note,
        "compared": [
            {
                "name": item.name,
                "identical": item.identical,
                "equal": item.equal,
                "difference": item.difference,
                "where": item.where,
            }
            for item in found.compared
        ],
        "record": None if saved is None else str(saved),
    }
