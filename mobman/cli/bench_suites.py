"""``mobman bench list`` and ``show``: what suites there are, and what they ask for."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table

from mobman.cli.output import console, echo, print_json

if TYPE_CHECKING:
    from mobman.benchmark.run_spec import RunSpec
    from mobman.benchmark.suite import Suite


@click.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def list_command(as_json: bool) -> None:
    """List the suites."""
    from mobman.benchmark.suite import list_suites, load_suite

    rows: list[dict[str, Any]] = []
    for name in list_suites():
        suite = load_suite(name)
        rows.append({"name": name, "runs": suite.size(), "description": suite.description})
    if as_json:
        print_json(rows)
        return
    table = Table(box=None, pad_edge=False)
    table.add_column("suite")
    table.add_column("runs", justify="right")
    table.add_column("description")
    for row in rows:
        table.add_row(row["name"], str(row["runs"]), row["description"])
    console().print(table)


@click.command("show")
@click.argument("suite")
@click.option("--runs", "each", is_flag=True, help="List every run.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON, with every run.")
def show_command(suite: str, each: bool, as_json: bool) -> None:
    """Show what SUITE (a name or a TOML file) asks for, and check all of it; nothing is run."""
    from mobman.benchmark.suite import load_suite
    from mobman.model.platforms.types.custom import without_code

    chosen = load_suite(suite)
    with without_code():
        runs = chosen.runs()
    if as_json:
        listing = [{"run_id": run.run_id, **asdict(run)} for run in runs]
        print_json({"suite": chosen.model_dump(mode="json", by_alias=True), "runs": listing})
        return
    out = console()
    out.print(f"{chosen.name}: {chosen.description}")
    out.print(_contents(chosen, runs))
    out.print(_controllers(runs))
    if each:
        for run in runs:
            echo(f"{run.run_id}  {run}")


def _contents(suite: Suite, runs: list[RunSpec]) -> Table:
    simulated = sum(run.duration for run in runs)
    facts = {
        "runs": f"{len(runs)}, in {len({run.cell for run in runs})} cells; {simulated:g} s simulated",
        "robots": _names(run.robot for run in runs),
        "tasks": _names(run.task for run in runs),
        "scenarios": _names(run.scenario["name"] for run in runs),
        "durations": _names(f"{run.duration:g} s" for run in runs),
        "dt": _names(f"{run.dt:g} s" for run in runs),
        "seeds": _names(str(run.seed) for run in runs),
        "time limit": f"{suite.time_limit:g} s a run, wall time",
        "samples": f"one every {suite.record_period:g} s in the files",
    }
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold")
    table.add_column()
    for name, fact in facts.items():
        table.add_row(name, fact)
    return table


def _controllers(runs: list[RunSpec]) -> Table:
    table = Table(box=None, pad_edge=False)
    for head in ("controller", "law", "gains beside the defaults"):
        table.add_column(head)
    found = {(run.label, run.law, _gains(run.gains), run.robot): None for run in runs}
    by_gains: dict[tuple[str, str, str], list[str]] = {}
    for label, law, gains, robot in found:
        by_gains.setdefault((label, law, gains), []).append(robot)
    several = {label for label, *_ in by_gains if sum(key[0] == label for key in by_gains) > 1}
    labels = list(dict.fromkeys(key[0] for key in by_gains))
    for (label, law, gains), robots in sorted(
        by_gains.items(), key=lambda item: labels.index(item[0][0])
    ):
        note = f" ({', '.join(robots)})" if label in several else ""
        table.add_row(label, law, (gains or "none") + note)
    return table


def _gains(gains: dict[str, Any]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in gains.items())


def _names(names: Any) -> str:
    found = list(dict.fromkeys(names))
    return ", ".join(found) if len(found) <= 40 else f"{', '.join(found[:40])} ... ({len(found)})"
