"""``mobman export``: runs and robots as files of other tools."""

from __future__ import annotations

import warnings
from pathlib import Path

import click

from mobman.cli.names import complete
from mobman.cli.output import FILE, FORCE, check_new, echo, print_json, reports


@click.command()
@click.argument("what", metavar="RUN.h5 | ROBOT", **complete("robots"))
@click.option("-o", "--output", type=FILE, required=True, help=".csv, .mcap or .xml (MuJoCo).")
@FORCE
@reports
def export(what: str, output: Path, force: bool, as_json: bool) -> None:
    """Write a run as CSV or MCAP (Foxglove), or a robot, or that of a run, as MuJoCo's XML."""
    from mobman.bridges.export import SUFFIXES
    from mobman.bridges.export import export as write

    check_new(output, suffixes=SUFFIXES, force=force)
    for remark in write(what, output):
        warnings.warn(remark, stacklevel=1)
    size = output.stat().st_size
    if as_json:
        print_json({"file": str(output), "bytes": size})
    else:
        echo(f"{output} ({size / 1e6:.2f} MB)")
