"""``mobman robots add``: a robot's TOML from its URDF."""

from __future__ import annotations

import math
import os
import re
import shlex
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mobman.cli.output import console, print_json
from mobman.errors import MobmanError, UsageError
from mobman.robots.infer.findings import PLATFORMS, Options

if TYPE_CHECKING:
    from mobman.model.mobile_manipulator import MobileManipulator

_ABOUT_OPTIONS = r"field '(platform|arm|urdf\.lock)\b|\[platform\]|\[arm\]"
"""Parts of a message that an option may mend."""


@click.command()
@click.argument("urdf", type=click.Path(path_type=Path))
@click.option(
    "--name",
    help="Name of the robot; by default that of FILE, of the URDF's file or the one in the URDF.",
)
@click.option("--tip", help="Link whose origin is the end-effector.")
@click.option(
    "--right-wheel",
    "right_wheels",
    multiple=True,
    metavar="JOINT",
    help="Driven wheel; repeatable.",
)
@click.option(
    "--left-wheel", "left_wheels", multiple=True, metavar="JOINT", help="Driven wheel; repeatable."
)
@click.option(
    "--wheel",
    "wheels",
    multiple=True,
    metavar="JOINT",
    help="Of an omnidirectional platform; repeatable.",
)
@click.option("--steering", multiple=True, metavar="JOINT", help="Of a car; repeatable.")
@click.option(
    "--platform",
    type=click.Choice(PLATFORMS),
    help="Platform type.",
)
@click.option("--wheel-radius", type=click.FloatRange(0, min_open=True), help="m.")
@click.option("--heading", type=float, help="Direction of forward in the root link's frame, rad.")
@click.option(
    "--lock", multiple=True, metavar="PATTERN", help="Joints that do not move; repeatable."
)
@click.option(
    "--package-path",
    "packages",
    multiple=True,
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    metavar="DIR",
    help="Folder that holds packages of meshes; repeatable.",
)
@click.option("--force", is_flag=True, help="Replace a file or a robot that is there.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="TOML file to write; by default in the user's folder of robots.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
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

    options = Options(**given)
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
    robot = _write(robot_toml(found, name, source), target, force)
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
    heading, radius = options.heading, options.wheel_radius
    if heading is not None and not math.isfinite(heading):
        raise UsageError(f"--heading is {heading}; allowed: a finite angle (rad)")
    if radius is not None and not math.isfinite(radius):
        raise UsageError(f"--wheel-radius is {radius}; allowed: a finite length above 0 (m)")
    if output is not None and output.suffix != ".toml":
        raise UsageError(
            f"-o {str(output)!r} does not end in .toml, by which a robot's file is told from a name; "
            f"give {f'{output}.toml'!r}"
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


def _write(text: str, target: Path, force: bool) -> MobileManipulator:
    """Write the file whole or not at all, once the robot that it describes can be loaded."""
    folder = target.absolute().parent
    temporary = folder / f".{target.name}.{os.getpid()}.part"
    missing = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"the folder {folder} cannot be made: {error.strerror}; choose another -o"
            ) from error
        try:
            temporary.write_text(text, encoding="utf-8")
        except OSError as error:
            raise UsageError(
                f"nothing can be written in the folder {folder}: {error.strerror}; choose another -o"
            ) from error
        robot = _loaded(temporary, target)
        if force:
            temporary.replace(target)
        else:
            _place(temporary, target)
        return robot
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        for path in missing:  # those that are still empty, the innermost first
            with suppress(OSError):
                path.rmdir()


def _loaded(temporary: Path, target: Path) -> MobileManipulator:
    """The robot of a file that will be called otherwise."""
    from mobman.model.build import load_robot
    from mobman.robots.spec import read_spec

    try:
        return load_robot(read_spec(temporary))
    except MobmanError as error:
        said = str(error).replace(str(temporary), str(target))
        advice = "correct the URDF"
        if re.search(_ABOUT_OPTIONS, said):
            advice += (
                ", or say what was taken wrongly by --platform, --right-wheel, --left-wheel, --tip, "
                "--lock, --heading"
            )
        # a class with the same exit status that takes a message only
        kind = UsageError if error.exit_status == UsageError.exit_status else MobmanError
        raise kind(
            f"nothing was written, since the robot cannot be loaded: {said}; {advice}"
        ) from error


def _place(temporary: Path, target: Path) -> None:
    """Rename, but never over a file that came up meanwhile."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise UsageError(f"{target} is there already; add --force to replace it") from None
    except OSError:  # no hard links on this file system
        temporary.replace(target)


def _print(summary: dict[str, Any]) -> None:
    out = console()

    def line(key: str, text: str) -> None:
        out.print(f"  {key:<11} {text}", soft_wrap=True)

    out.print(f"{summary['name']}: {summary['file']}", soft_wrap=True)
    line("platform", summary["platform"])
    if summary["wheels"]:
        line("wheels", ", ".join(summary["wheels"]))
        line("radius", f"{summary['wheel_radius']:.4g} m")
    if summary["half_track"] is not None:
        line("half track", f"{summary['half_track']:.4f} m")
    if summary["heading"]:
        line("heading", f"{summary['heading']:.4g} rad from the root link's x axis")
    line("arm joints", f"{len(summary['arm_joints'])}: {', '.join(summary['arm_joints'])}")
    line("tip", summary["tip"])
    line("locked", f"{len(summary['locked'])} joints")
    rest = (f"{joint} {value:.4g}" for joint, value in summary["rest"].items())
    line("rest", ", ".join(rest))
    for doubt in summary["uncertain"]:
        line("uncertain", doubt)
    for command in summary["next"]:
        line("next", command)
