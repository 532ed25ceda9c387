"""``mobman robots add``: a robot's TOML from its URDF."""

from __future__ import annotations

import math
import os
import re
import shlex
import tomllib
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mobman.cli.output import JSON, POSITIVE, console, print_json
from mobman.errors import MobmanError, UsageError
from mobman.files import write_new
from mobman.robots.infer.findings import TYPES, Options

if TYPE_CHECKING:
    from mobman.model.mobile_manipulator import MobileManipulator

_ABOUT_OPTIONS = r"field '(platform|arm|urdf\.lock)\b|\[platform\]|\[arm\]"
"""Parts of a message that an option may mend."""


class _PlatformTypes(click.Choice):  # type: ignore[type-arg]  # a class of str since click 8.2
    """The registered platform types whose fields are found in URDFs, looked up when asked for."""

    def __init__(self) -> None:
        self.case_sensitive = True

    @cached_property
    def fields(self) -> dict[str, tuple[str, ...]]:
        from mobman.model.platforms.platform import platforms

        found = {name: kind.inferred for name, kind in platforms.loaded().items() if kind.inferred}
        return {**TYPES, **found}

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self.fields)


_TYPES = _PlatformTypes()


def _several(
    option: str, name: str, about: str, what: str = "JOINT", **more: Any
) -> Callable[..., Any]:
    return click.option(
        option, name, multiple=True, metavar=what, help=f"{about}; repeatable.", **more
    )


@click.command()
@click.argument("urdf", type=click.Path(path_type=Path))
@click.option(
    "--name",
    help="Name of the robot; by default that of FILE, of the URDF's file or the one in the URDF.",
)
@click.option("--tip", help="Link whose origin is the end-effector.")
@_several("--right-wheel", "right_wheels", "Driven wheel")
@_several("--left-wheel", "left_wheels", "Driven wheel")
@_several("--wheel", "wheels", "Of an omnidirectional platform")
@_several("--steering", "steering", "Of a car")
@click.option("--platform", type=_TYPES, help="Platform type.")
@click.option("--wheel-radius", type=POSITIVE, help="m.")
@click.option("--heading", type=float, help="Direction of forward in the root link's frame, rad.")
@_several("--lock", "lock", "Joints that do not move", "PATTERN")
@_several(
    "--package-path",
    "packages",
    "Folder that holds packages of meshes",
    "DIR",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
)
@click.option("--force", is_flag=True, help="Replace a file or a robot that is there.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="TOML file to write; by default in the user's folder of robots.",
)
@JSON
def add(
    urdf: Path,
    name: str | None,
    output: Path | None,
    packages: tuple[Path, ...],
    force: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Write the TOML of a robot from its URDF: wheels, radius, arm, rest posture.

    Each value has a comment that says why it was taken. What the URDF does not tell is asked for.
    """
    from mobman.robots.catalogue import user_robots_folder
    from mobman.robots.infer.infer import infer
    from mobman.robots.infer.write import choose_name, robot_toml, urdf_source
    from mobman.robots.spec import UrdfSource
    from mobman.robots.urdf.read import urdf_file

    options = Options(**given, types=_TYPES.fields)
    _check_options(output, options)
    if not os.path.isfile(urdf):
        raise UsageError(f"there is no URDF at {os.path.realpath(urdf)}")
    looked_in = UrdfSource(
        path=str(urdf.resolve()), packages=[str(path.resolve()) for path in packages]
    )
    file = urdf_file(looked_in, Path(), f"{urdf}: field 'urdf")
    name = choose_name(name, output, file.parse().get("name", ""), urdf)
    target = output if output is not None else user_robots_folder() / f"{name}.toml"
    _check_free(name, target, force, by_name=output is None)
    found = infer(file, options)
    source = urdf_source(urdf, None if output is None else target.absolute().parent, packages)
    text = robot_toml(found, name, source)
    robot = _robot_of(text, target)
    write_new(target, text, force, "choose another -o")
    known = name if output is None else shlex.quote(str(target))
    summary = {
        "name": name,
        "file": str(target),
        **found.summary(),
        "nq": robot.nq,
        "nz": robot.nz,
        "uncertain": list(found.uncertain),
        "next": [f"mobman robots check {known}", f"mobman run {known}"],
    }
    if as_json:
        print_json(summary)
    else:
        _print(summary)


def _check_options(output: Path | None, options: Options) -> None:
    """Refuse what the types of click let pass."""
    for option, value, allowed in (
        ("--heading", options.heading, "angle (rad)"),
        ("--wheel-radius", options.wheel_radius, "length above 0 (m)"),
    ):
        if value is not None and not math.isfinite(value):
            raise UsageError(f"{option} is {value}; allowed: a finite {allowed}")
    if output is not None and output.suffix != ".toml":
        raise UsageError(
            f"-o {str(output)!r} does not end in .toml, which distinguishes a robot's file from a "
            f"name; give {f'{output}.toml'!r}"
        )


def _check_free(name: str, target: Path, force: bool, by_name: bool) -> None:
    """Before anything is computed: nothing that is there is replaced unasked."""
    from mobman.robots.catalogue import list_robots, own_robots

    if by_name and name in own_robots():
        raise UsageError(f"the robot {name!r} comes with mobman; choose another --name")
    if force:
        return
    if os.path.exists(target):
        raise UsageError(f"{target} is there already; choose another --name or -o, or add --force")
    if by_name and name in list_robots():
        raise UsageError(
            f"there is a robot {name!r} already; choose another --name, or add --force"
        )


def _robot_of(text: str, target: Path) -> MobileManipulator:
    """The robot of a file that is written only if it can be loaded."""
    from mobman.model.build import load_robot
    from mobman.robots.spec import spec_of

    try:
        return load_robot(spec_of(tomllib.loads(text), target))
    except MobmanError as error:
        advice = "correct the URDF"
        if re.search(_ABOUT_OPTIONS, str(error)):
            advice += (
                ", or say what was taken wrongly by --platform, --right-wheel, --left-wheel, --tip, "
                "--lock, --heading"
            )
        # a class with the same exit status that takes a message only
        kind = UsageError if error.exit_status == UsageError.exit_status else MobmanError
        raise kind(
            f"nothing was written, since the robot cannot be loaded: {error}; {advice}"
        ) from error


def _print(summary: dict[str, Any]) -> None:
    out = console()
    joints = summary["arm_joints"]
    out.print(f"{summary['name']}: {summary['file']}", soft_wrap=True)
    lines = [("platform", summary["platform"])]
    if summary["wheels"]:
        lines += [("wheels", ", ".join(summary["wheels"]))]
        lines += [("radius", f"{summary['wheel_radius']:.4g} m")]
    if summary["half_track"] is not None:
        lines += [("half track", f"{summary['half_track']:.4f} m")]
    if summary["heading"]:
        lines += [("heading", f"{summary['heading']:.4g} rad from the root link's x axis")]
    lines += [
        ("arm joints", f"{len(joints)}: {', '.join(joints)}"),
        ("tip", summary["tip"]),
        *([("follow", ", ".join(summary["following"]))] if summary["following"] else []),
        ("locked", f"{len(summary['locked'])} joints"),
        ("rest", ", ".join(f"{joint} {at:.4g}" for joint, at in summary["rest"].items())),
        *(("uncertain", doubt) for doubt in summary["uncertain"]),
        *(("next", command) for command in summary["next"]),
    ]
    for key, text in lines:
        out.print(f"  {key:<11} {text}", soft_wrap=True)
