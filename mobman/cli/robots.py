"""``mobman robots``: which robots there are, and what one is."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Literal

import click
import numpy as np
from rich.table import Table

from mobman.cli.output import console, echo, print_json
from mobman.cli.robots_add import add
from mobman.cli.robots_check import check
from mobman.errors import MobmanError, UnknownNameError

if TYPE_CHECKING:
    from mobman.model.mobile_manipulator import MobileManipulator
    from mobman.robots.spec import RobotSpec

_NUMBERS = ("arm", "nz", "kg")
_COLUMNS = ("robot", "platform", *_NUMBERS, "licence", "from")
_WIDE = 110  # characters that leave room for the descriptions
_OTHERS = 76  # what the other columns take


@click.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.pass_context
def robots(context: click.Context, as_json: bool) -> None:
    """List the robots (arm: joints of the arm; nz: motors), or show, check or add one."""
    if context.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError(f"put --json behind {context.invoked_subcommand!r}")
        return
    from mobman.robots.catalogue import list_robots

    rows = []
    for name in list_robots():
        try:
            rows.append(_summary(*_found(name)))
        except MobmanError as error:  # one broken robot must not hide the others
            if isinstance(error, UnknownNameError):
                continue  # a package's, of which there was a warning
            echo(f"mobman: {name} is left out: {' '.join(str(error).split())}", err=True)
    if as_json:
        print_json(rows)
        return
    out = console()
    table = Table(box=None, pad_edge=False)
    for heading in _COLUMNS:
        side: Literal["right", "left"] = "right" if heading in _NUMBERS else "left"
        table.add_column(heading, justify=side, no_wrap=True)
    if out.width >= _WIDE:
        table.add_column("description", no_wrap=True, max_width=out.width - _OTHERS)
    for row in rows:
        table.add_row(
            row["name"],
            row["platform"],
            *("–" if row[key] is None else str(row[key]) for key in ("arm_joints", "nz")),
            "–" if row["mass"] is None else f"{row['mass']:.1f}",
            re.split(r"[ ;(]", row["license"])[0],
            row["origin"],
            *([row["description"]] if out.width >= _WIDE else []),
        )
    out.print(table)


robots.add_command(add)
robots.add_command(check)


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
    out.print(out.render_str(content["name"], style="bold"), f" {content['description']}")
    for key in ("platform", "tip", "mass", "tags", "source", "license", "origin", "urdf"):
        if content[key] is not None:
            out.print(f"  {key:<9} {_plain(content[key])}", soft_wrap=True)
    if content["code"]:
        out.print(
            f"  {'code':<9} the platform is Python code, {content['code']}, which runs when the robot "
            "is loaded for a run or a check, and not here: joints and limits are not known",
            soft_wrap=True,
        )
        return
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


def _plain(value: Any) -> str:
    return ", ".join(value) if isinstance(value, list) else str(value)


def _summary(spec: RobotSpec, robot: MobileManipulator | None, origin: str) -> dict[str, Any]:
    """What a robot is; without a model, of one whose platform is code, what its description says."""
    model: dict[str, Any] = dict.fromkeys(("arm_joints", "nq", "nz", "mass"))
    if robot is not None:
        mass = float(sum(link.mass for link in robot.model.inertias))
        model = {"arm_joints": robot.n, "nq": robot.nq, "nz": robot.nz, "mass": mass}
    return {
        "name": spec.name,
        "origin": origin,
        "platform": spec.platform.type,
        **model,
        "code": spec.code or None,
        "tip": spec.arm.tip,
        "tags": spec.tags,
        "license": spec.license,
        "source": spec.source,
        "description": spec.description,
    }


def _found(name: str) -> tuple[RobotSpec, MobileManipulator | None, str]:
    """A robot's description, its model unless that takes running code, and where it is from."""
    from mobman.model.build import build_robot
    from mobman.robots.catalogue import find_spec, list_robots, origin_of

    spec = find_spec(name)
    origin = origin_of(name) if name in list_robots() else "file"
    return spec, None if spec.code else build_robot(spec), origin


def _details(name: str) -> dict[str, Any]:
    from mobman.robots.urdf.read import urdf_sources

    spec, robot, origin = _found(name)
    urdf = urdf_sources(spec)
    content = {
        **_summary(spec, robot, origin),
        "platform_parameters": spec.platform.parameters,
        "urdf": str(urdf),
        "urdf_sha256": urdf.sha256(),
    }
    if robot is None:
        return content
    limits = robot.limits
    lower, upper = limits.lower, limits.upper
    return {
        **content,
        "velocity_names": robot.velocity_names,
        "velocity_limits": limits.velocity.tolist(),
        "torque_limits": limits.torque.tolist(),
        "tip_at_rest": np.asarray(robot.tip_pose(robot.q_rest).translation).tolist(),
        "joints": [
            {
                "name": joint,
                "rest": float(robot.q_rest[i]),
                "lower": float(lower[i]),
                "upper": float(upper[i]),
                "weight": float(robot.criterion_weights[i]),
            }
            for i, joint in enumerate(robot.joint_names)
        ],
    }
