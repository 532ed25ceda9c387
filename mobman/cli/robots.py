"""``mobman robots``: the list of robots, the facts of one, and the checks of its description."""

from __future__ import annotations

import glob
import math
import os
import re
from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from rich.text import Text

from mobman.cli.options import complete, reports, wants_json
from mobman.cli.output import console, echo, note, number, report, table
from mobman.cli.robots_add import add
from mobman.errors import MobmanError, UnknownNameError, UsageError
from mobman.robots.spec import RobotSpec, own_robots, user_robots_folder

if TYPE_CHECKING:
    from mobman.model.mobile_manipulator import MobileManipulator

_TASK = "circle"  # the default one
_NUMBERS = ("arm", "nz", "kg")
_WIDE = 110  # characters that leave room for the descriptions
_OTHERS = 76  # what the other columns take
_STYLES = {"ok": "green", "warning": "yellow", "wrong": "bold red"}


@click.group(invoke_without_command=True)
@reports
@click.pass_context
def robots(context: click.Context) -> None:
    """List the robots (arm: joints of the arm; nz: motors), or show, check, add or remove one;
    or compute the bounds that the theorems suppose of one."""
    from mobman.robots.catalogue import list_robots

    if context.invoked_subcommand is not None:
        if wants_json():
            raise click.UsageError(f"put --json behind {context.invoked_subcommand!r}")
        return

    rows = []
    for name in list_robots():
        try:
            rows.append(_summary(*_found(name)))
        except UnknownNameError:
            continue  # a package's, of which there was a warning
        except MobmanError as error:  # one broken robot must not hide the others
            note(f"{name} is left out: {error}")
    report(rows)
    out = console()
    about = ["description"] if out.width >= _WIDE else []
    cells = []
    for row in rows:
        mass = None if row["mass"] is None else f"{row['mass']:.1f}"
        numbers = ("–" if n is None else n for n in (row["arm_joints"], row["nz"], mass))
        rest = (re.split(r"[ ;(]", row["license"])[0], row["origin"], *(row[key] for key in about))
        cells.append((row["name"], row["platform"], *numbers, *rest))
    names, origin = ("robot", "platform"), ("licence", "from")
    headings = (*names, *_NUMBERS, *origin, *about)
    listing = table(*headings, rows=cells, right=_NUMBERS, no_wrap=True, names=names + origin)
    if about:
        listing.columns[-1].max_width = out.width - _OTHERS
    out.print(listing)


robots.add_command(add)


@robots.command()
@click.argument("name", **complete("robots"))
@reports
def show(name: str) -> None:
    """Show the robot NAME (or a TOML file or URDF): joints, limits, rest posture, source."""
    content = _details(name)
    report(content)
    out = console()
    out.print(out.render_str(content["name"], style="bold"), f" {content['description']}")
    keys = ["platform", "tip", "mass", "tags", "source", "license", "origin", "urdf"]
    lines = {key: content[key] for key in keys if content[key] is not None}
    if content["code"]:
        lines["code"] = (
            f"the platform is Python code, {content['code']}, which runs when the robot is loaded for a "
            "run or a check, and not here: joints and limits are not known"
        )
    else:
        lines["z"] = content["velocity_names"]
        lines["tip at rest"] = f"{np.round(content['tip_at_rest'], 4).tolist()} m"
    for key, value in lines.items():
        text = ", ".join(value) if isinstance(value, list) else value
        out.print(f"  {key:<9} {text}", soft_wrap=True)
    if content["code"]:
        return
    numbers = ("rest", "lower", "upper", "weight in F")
    rows = [
        (joint["name"], *(f"{joint[key.split()[0]]:.4g}" for key in numbers))
        for joint in content["joints"]
    ]
    out.print()
    out.print(table("q", *numbers, rows=rows, right=numbers, names={"q"}))


def _summary(spec: RobotSpec, robot: MobileManipulator | None, origin: str) -> dict[str, Any]:
    """Facts of a robot; of one whose platform is code, and is not run here, those of its description."""
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
        **{key: getattr(spec, key) for key in ("tags", "license", "source", "description")},
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
    columns = (robot.q_rest, limits.lower, limits.upper, robot.criterion_weights)
    keys = ("name", "rest", "lower", "upper", "weight")
    rows = zip(robot.joint_names, *(column.tolist() for column in columns), strict=True)
    return {
        **content,
        "velocity_names": robot.velocity_names,
        "velocity_limits": limits.velocity.tolist(),
        "torque_limits": limits.torque.tolist(),
        "tip_at_rest": np.asarray(robot.tip_pose(robot.q_rest).translation).tolist(),
        "joints": [dict(zip(keys, row, strict=True)) for row in rows],
    }


@robots.command()
@click.argument("name", **complete("robots"))
@reports
def remove(name: str) -> None:
    """Remove the robot NAME that was added by the user: its TOML, and its copy of the URDF."""
    from mobman.robots.catalogue import list_robots

    folder = user_robots_folder()
    file = folder / f"{name}.toml"
    if file.parent != folder or not os.path.lexists(file):  # a name that is no path
        if name in own_robots():
            raise UsageError(f"the robot {name!r} comes with mobman and stays")
        if name in list_robots():
            raise UsageError(f"the robot {name!r} is another package's; uninstall that")
        known = ", ".join(sorted(path.stem for path in folder.glob("*.toml"))) or "none"
        raise UsageError(f"no robot of the name {name!r} was added by you; added: {known}")
    copy = re.compile(rf"{re.escape(name)}\.(mount\d+\.)?urdf")
    copies = [path for path in folder.glob(f"{glob.escape(name)}.*") if copy.fullmatch(path.name)]
    removed = [file, *copies]  # the TOML first: without it there is no robot
    for path in removed:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise MobmanError(f"cannot remove {path}: {error.strerror}") from error
    report({"name": name, "removed": [*map(str, removed)]})
    echo(f"removed {', '.join(map(str, removed))}")


@robots.command()
@click.argument("name", **complete("robots"))
@reports
def bounds(name: str) -> None:
    """Compute what the theorems suppose of the robot NAME (or a TOML file or URDF): w_1 to w_9, a, A.

    They hold over sampled states of the default task, with a margin; beside them the paper's.
    """
    from mobman.controllers import bounds as computing
    from mobman.controllers.bounds import SEED, SPREAD
    from mobman.model.build import load_robot
    from mobman.tasks.task import make_task

    robot = load_robot(name)
    computed = computing.computed_bounds(robot, make_task(_TASK, robot))
    about = computed._asdict()
    content = {"robot": robot.name, "task": _TASK, **about.pop("values")}
    content |= {"paper": computing.PAPER, "bounded": computing.BOUNDED, **about}
    content |= {"margin": computing.MARGIN, "confidence": computing.CONFIDENCE}
    report({**content, "seed": SEED, "arm_spread": SPREAD})
    out = console()
    out.print(robot.name, style="bold")
    numbers = ("paper", "computed", "found")
    listing = table("", *numbers, "of", right=numbers)
    for key, value in computed.values.items():
        values = (computing.PAPER[key], value, computed.found.get(key, math.nan))
        listing.add_row(key, *map(number, values), computing.BOUNDED[key])
    out.print(listing)
    share = computed.exceeded
    echo(
        f"Over {computed.states} sampled states of {_TASK!r} (arm and steering within {SPREAD:g} "
        f"rad of rest, any heading, any direction of z) and a local search from the worst; "
        f"{computing.MARGIN:.0%} margin. With {computing.CONFIDENCE:.0%} confidence at most "
        f"{share['w_7']:.1%} of such states lie beyond what the samples gave (w_1, w_2: "
        f"{share['w_1']:.1%}). The paper's are for its youBot."
    )
    if computed.singular:
        echo(f"At {computed.singular} more J does not exist: (15) supposes that they are not met.")
    if not computed.regular:
        echo(
            f"No a > 0 holds for all of them: J is singular, lambda_min(J J^T) = "
            f"{computed.found['a']:.1g}, where the search ended, which (15) excludes. The a above is "
            "that of the laws' \"auto\" without its floor, a tenth of the samples' least."
        )


@robots.command()
@click.argument("name")
@reports
@click.option("--no-simulation", is_flag=True, help="Leave out the checks that run a closed loop.")
def check(name: str, no_simulation: bool) -> None:
    """Check the robot NAME (or a TOML file or URDF): masses, limits, geometry, equations, a closed loop.

    Exit status 1 if something is wrong, 0 with warnings alone, 2 if the robot cannot be loaded.
    """
    from mobman.checks.checks import run_checks
    from mobman.model.build import load_robot

    robot = load_robot(name)
    findings = run_checks(robot, simulation=not no_simulation)
    counts: Counter[str] = Counter(finding.status for finding in findings)
    status = next((word for word in ("wrong", "warning") if counts[word]), "ok")
    summary = {"status": status, **{word: counts[word] for word in _STYLES}}
    found = [asdict(finding) for finding in findings]
    report({"robot": robot.name, "findings": found, "summary": summary})
    out = console()
    out.print(robot.name, style="bold")
    listing = table("check", "result", no_wrap=True)
    listing.add_column("found", overflow="fold")
    for finding in findings:
        listing.add_row(finding.check, Text(finding.status, _STYLES[finding.status]), finding.found)
        if finding.fix:  # below, where it has room
            listing.add_row("", Text("fix", "dim"), out.render_str(finding.fix, style="dim"))
    out.print(listing)
    warned = f"{counts['warning']} warning{'' if counts['warning'] == 1 else 's'}"
    echo(f"{counts['wrong']} wrong, {warned}, {counts['ok']} ok")
    if counts["wrong"]:
        raise click.exceptions.Exit(1)
