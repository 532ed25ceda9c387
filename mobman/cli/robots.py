"""``mobman robots``: which robots there are, and what one is."""

from __future__ import annotations

from typing import Any

import click
import numpy as np
from rich.table import Table
from rich.text import Text

from mobman.cli.output import console, print_json
from mobman.errors import MobmanError


@click.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.pass_context
def robots(context: click.Context, as_json: bool) -> None:
    """List the robots, or show one."""
    if context.invoked_subcommand is not None:
        return
    from mobman.robots.catalogue import list_robots

    rows = []
    for name in list_robots():
        try:
            rows.append(_summary(name))
        except MobmanError as error:  # one broken robot must not hide the others
            click.echo(f"mobman: {name} is left out: {' '.join(str(error).split())}", err=True)
    if as_json:
        print_json(rows)
        return
    table = Table(box=None, pad_edge=False)
    for heading in ("robot", "platform", "arm joints", "nq", "nz", "mass (kg)", "description"):
        right = heading in ("arm joints", "nq", "nz", "mass (kg)")
        table.add_column(heading, justify="right" if right else "left")
    for row in rows:
        table.add_row(
            row["name"],
            row["platform"],
            str(row["arm_joints"]),
            str(row["nq"]),
            str(row["nz"]),
            f"{row['mass']:.1f}",
            row["description"],
        )
    console().print(table)


@robots.command()
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(name: str, as_json: bool) -> None:
    """Show the robot NAME (or the TOML file): joints, limits, rest posture, source."""
    content = _details(name)
    if as_json:
        print_json(content)
        return
    out = console()
    out.print(Text.assemble((content["name"], "bold"), f"  {content['description']}"))
    for key in ("platform", "tip", "mass", "source", "license", "urdf"):
        out.print(f"  {key:<9} {content[key]}", soft_wrap=True)
    out.print(f"  {'z':<9} {', '.join(content['velocity_names'])}", soft_wrap=True)
    out.print(f"  {'tip at rest':<9} {np.round(content['tip_at_rest'], 4).tolist()} m")
    table = Table(box=None, pad_edge=False)
    for heading in ("q", "rest", "lower", "upper", "weight in F"):
        table.add_column(heading, justify="left" if heading == "q" else "right")
    for joint in content["joints"]:
        table.add_row(
            joint["name"],
            *(f"{joint[key]:.4g}" for key in ("rest", "lower", "upper", "weight")),
        )
    out.print()
    out.print(table)


def _summary(name: str) -> dict[str, Any]:
    from mobman.model.build import load_robot

    robot = load_robot(name)
    return {
        "name": robot.name,
        "platform": robot.spec.platform.type,
        "arm_joints": robot.n,
        "nq": robot.nq,
        "nz": robot.nz,
        "mass": float(sum(link.mass for link in robot.model.inertias)),
        "tip": robot.tip,
        "tags": robot.spec.tags,
        "license": robot.spec.license,
        "source": robot.spec.source,
        "description": robot.spec.description,
    }


def _details(name: str) -> dict[str, Any]:
    from mobman.model.build import load_robot

    robot = load_robot(name)
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    return {
        **_summary(name),
        "platform_parameters": robot.spec.platform.parameters,
        "urdf": str(robot.urdf.path),
        "urdf_sha256": robot.urdf.sha256(),
        "velocity_names": robot.velocity_names,
        "tip_at_rest": np.asarray(robot.tip_pose(robot.q_rest).translation).tolist(),
        "joints": [
            {
                "name": joint,
                "rest": float(robot.q_rest[i]),
                "lower": _bound(lower[i]),
                "upper": _bound(upper[i]),
                "weight": float(robot.criterion_weights[i]),
            }
            for i, joint in enumerate(robot.joint_names)
        ],
    }


def _bound(limit: float) -> float:
    return float(limit) if abs(limit) < 1e8 else float(np.copysign(np.inf, limit))
