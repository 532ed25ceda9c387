"""``mobman bench merge``: folders of results from several machines into one."""

from __future__ import annotations

from pathlib import Path

import click

from mobman.cli.output import echo


@click.command("merge")
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder that gets everything; new, or with results of the same suite.",
)
def merge_command(folders: tuple[Path, ...], output: Path) -> None:
    """Join FOLDERS of one suite's results into another folder.

    The folders are left as they are. Exit status 1 if a record could not be read, or two folders
    have different results for one run.
    """
    from mobman.benchmark.merging import merge

    merged = merge(folders, output)
    for message in merged.unusable:
        echo(f"mobman: left out: {message}", err=True)
    for message in merged.conflicts:
        echo(f"mobman: conflict, the first is kept: {message}", err=True)
    echo(
        f"{output}: {merged.there} of {merged.asked} runs, {merged.copied} copied; the "
        f"report is written by: mobman bench report {output}"
    )
    if merged.unusable or merged.conflicts:
        raise click.exceptions.Exit(1)
