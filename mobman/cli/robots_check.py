"""``mobman robots check``: whether a robot's description makes sense."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING

import click
from rich.table import Table
from rich.text import Text

from mobman.cli.output import console, print_json

if TYPE_CHECKING:
    from mobman.checks.checks import Finding

_STYLES = {"ok": "green", "warning": "yellow", "wrong": "bold red"}


@click.command()
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--no-simulation", is_flag=True, help="Leave out the checks that run a closed loop.")
def check(name: str, as_json: bool, no_simulation: bool) -> None:
    """Check the robot NAME (or the TOML file): masses, limits, geometry, equations, a closed loop.

    Exit status 1 if something is wrong, 0 with warnings alone, 2 if the robot cannot be loaded.
    """
    from mobman.checks.checks import run_checks
    from mobman.model.build import load_robot

    robot = load_robot(name)
    findings = run_checks(robot, simulation=not no_simulation)
    counts: Counter[str] = Counter(finding.status for finding in findings)
    status = next((word for word in ("wrong", "warning") if counts[word]), "ok")
    if as_json:
        print_json(
            {
                "robot": robot.name,
                "findings": [asdict(finding) for finding in findings],
                "summary": {"status": status, **{word: counts[word] for word in _STYLES}},
            }
        )
    else:
        _print(robot.name, findings)
        console().print(
            f"{counts['wrong']} wrong, {counts['warning']} warning"
            f"{'' if counts['warning'] == 1 else 's'}, {counts['ok']} ok"
        )
    if counts["wrong"]:
        raise click.exceptions.Exit(1)


def _print(robot: str, findings: list[Finding]) -> None:
    out = console()
    out.print(robot, style="bold")
    table = Table(box=None, pad_edge=False)
    table.add_column("check", no_wrap=True)
    table.add_column("result", no_wrap=True)
    table.add_column("found", overflow="fold")
    for finding in findings:
        result = Text(finding.status, _STYLES[finding.status])
        table.add_row(finding.check, result, finding.found)
        if finding.fix:  # below, where it has room
            table.add_row("", Text("fix", "dim"), out.render_str(finding.fix, style="dim"))
    out.print(table)
