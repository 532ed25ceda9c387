"""``mobman robots add``: a robot's TOML from its URDF."""

from __future__ import annotations

import errno
import math
import os
import re
import shlex
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mobman.cli.output import console, print_json
from mobman.errors import MobmanError, UsageError

if TYPE_CHECKING:
    from mobman.robots.infer.infer import Inference

_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]*"
_GENERIC = r"((robot|model|urdf|main|description)([_.-]|$))+"
"""File names that say nothing of the robot."""
_ABOUT_OPTIONS = r"field '(platform|arm|urdf\.lock)\b|\[platform\]|\[arm\]"
"""What a message speaks of where an option may mend it."""


@click.command()
@click.argument("urdf", type=click.Path(path_type=Path))
@click.option(
    "--name",
    help="Name of the robot; by default that of FILE, of the URDF's file or the one in the URDF.",
)
@click.option("--tip", help="Link whose origin is the end-effector.")
@click.option("--right-wheel", multiple=True, metavar="JOINT", help="Driven wheel; repeatable.")
@click.option("--left-wheel", multiple=True, metavar="JOINT", help="Driven wheel; repeatable.")
@click.option(
    "--wheel", multiple=True, metavar="JOINT", help="Of an omnidirectional platform; repeatable."
)
@click.option("--steering", multiple=True, metavar="JOINT", help="Of a car; repeatable.")
@click.option(
    "--platform",
    type=click.Choice(
        ["differential", "skid-steer", "omnidirectional", "car-like", "unicycle", "fixed"]
    ),
    help="Platform type.",
)
@click.option("--wheel-radius", type=click.FloatRange(0, min_open=True), help="m.")
@click.option("--heading", type=float, help="Direction of forward in the root link's frame, rad.")
@click.option(
    "--lock", multiple=True, metavar="PATTERN", help="Joints that do not move; repeatable."
)
@click.option(
    "--package-path",
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
def add(urdf: Path, name: str | None, output: Path | None, force: bool, **given: Any) -> None:
    """Write the TOML of a robot from its URDF: wheels, radius, arm, rest posture.

    Each value has a comment that says why it was taken. What the URDF does not tell is asked for.
    """
    from mobman.robots.catalogue import user_robots_folder
    from mobman.robots.infer.infer import infer
    from mobman.robots.infer.write import robot_toml, urdf_source
    from mobman.robots.spec import UrdfSource
    from mobman.robots.urdf.read import urdf_file

    _check_options(output, given)
    if not os.path.isfile(urdf):
        raise UsageError(f"there is no URDF at {os.path.realpath(urdf)}")
    packages = given["package_path"]
    looked_in = UrdfSource(
        path=str(urdf.resolve()), packages=[str(path.resolve()) for path in packages]
    )
    file = urdf_file(looked_in, Path(), f"{urdf}: field 'urdf")
    name = _name(name, output, file.parse().get("name", ""), urdf)
    target = output if output is not None else user_robots_folder() / f"{name}.toml"
    _check_free(name, target, force, by_name=output is None)
    found = infer(file, _options(given))
    source = urdf_source(urdf, None if output is None else target.absolute().parent, packages)
    text = robot_toml(found, name, source)
    robot = _write(text, target, force)
    summary = _summary(found, name, target, robot, in_catalogue=output is None)
    if given["as_json"]:
        print_json(summary)
    else:
        _print(summary)


def _check_options(output: Path | None, given: dict[str, Any]) -> None:
    """What the types of click let pass."""
    heading, radius = given["heading"], given["wheel_radius"]
    if heading is not None and not math.isfinite(heading):
        raise UsageError(f"--heading is {heading}; allowed: a finite angle (rad)")
    if radius is not None and not math.isfinite(radius):
        raise UsageError(f"--wheel-radius is {radius}; allowed: a finite length above 0 (m)")
    if output is not None and output.suffix != ".toml":
        raise UsageError(
            f"-o {str(output)!r} does not end in .toml, by which a robot's file is told from a name; "
            f"give {f'{output}.toml'!r}"
        )


def _options(given: dict[str, Any]) -> Any:
    from mobman.robots.infer.findings import Options

    return Options(
        tip=given["tip"],
        right_wheels=given["right_wheel"],
        left_wheels=given["left_wheel"],
        wheels=given["wheel"],
        steering=given["steering"],
        platform=given["platform"],
        wheel_radius=given["wheel_radius"],
        heading=given["heading"],
        lock=given["lock"],
    )


def _name(name: str | None, output: Path | None, of_urdf: str, urdf: Path) -> str:
    if name is not None:
        if not re.fullmatch(_NAME, name):
            raise UsageError(
                f"--name {name!r}: allowed: letters, digits, '_', '.' and '-', first a letter or digit"
            )
        return name
    generic = re.fullmatch(_GENERIC, urdf.stem.lower()) is not None
    of_files = (of_urdf, urdf.stem) if generic else (urdf.stem, of_urdf)
    for candidate in (output.stem if output is not None else "", *of_files):
        clean = re.sub(r"[^A-Za-z0-9_.-]+", "_", candidate).strip("_.-").lower()
        if re.fullmatch(_NAME, clean):
            # many URDFs are those of robots that come with mobman
            return f"my_{clean}" if output is None and _comes_with_mobman(clean) else clean
    raise UsageError(f"{urdf}: no name for the robot; give --name")


def _comes_with_mobman(name: str) -> bool:
    from mobman.resources import resource_folder

    return (resource_folder("robots") / f"{name}.toml").is_file()


def _check_free(name: str, target: Path, force: bool, by_name: bool) -> None:
    """Before anything is computed: nothing that is there is replaced unasked."""
    from mobman.robots.catalogue import list_robots

    if by_name and _comes_with_mobman(name):
        raise UsageError(f"the robot {name!r} comes with mobman; choose another --name")
    if force:
        return
    if os.path.exists(target):
        raise UsageError(f"{target} is there already; choose another --name or -o, or add --force")
    if by_name and name in list_robots():
        raise UsageError(
            f"there is a robot {name!r} already; choose another --name, or add --force"
        )


def _write(text: str, target: Path, force: bool) -> Any:
    """Write the file whole or not at all, once the robot that it describes can be loaded."""
    from mobman.model.build import load_robot
    from mobman.robots.spec import read_spec

    made = _make_folder(target.absolute().parent)
    temporary: Path | None = None
    try:
        handle, path = _temporary(target)
        temporary = Path(path)
        with open(handle, "w", encoding="utf-8") as file:
            file.write(text)
        try:
            robot = load_robot(read_spec(temporary))
        except MobmanError as error:
            said = str(error).replace(str(temporary), str(target))
            advice = "correct the URDF"
            if re.search(_ABOUT_OPTIONS, said):
                advice += (
                    ", or say what was taken wrongly by --platform, --right-wheel, --left-wheel, --tip, "
                    "--lock, --heading"
                )
            raise _class_of(error)(
                f"nothing was written, since the robot cannot be loaded: {said}; {advice}"
            ) from error
        temporary.chmod(0o666 & ~_umask())
        if force:
            temporary.replace(target)
        else:
            _place(temporary, target)
        made = []
        return robot
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        for folder in made:
            if not any(folder.iterdir()):
                folder.rmdir()


def _class_of(error: MobmanError) -> type[MobmanError]:
    """A class with the same exit status that takes a message only."""
    return UsageError if error.exit_status == UsageError.exit_status else MobmanError


def _make_folder(folder: Path) -> list[Path]:
    """Make a folder; those that were not there, the innermost first."""
    missing = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    made: list[Path] = []
    try:
        for path in reversed(missing):
            path.mkdir()
            made.insert(0, path)
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "it is a file")
    except BaseException as error:
        for path in made:
            path.rmdir()
        if isinstance(error, OSError):
            raise UsageError(
                f"the folder {folder} cannot be made: {error.strerror}; choose another -o"
            ) from error
        raise
    return made


def _temporary(target: Path) -> tuple[int, str]:
    """An open file beside the target."""
    folder = target.absolute().parent
    try:
        return tempfile.mkstemp(dir=folder, prefix=f".{target.name}.", suffix=".part")
    except OSError as error:
        raise UsageError(
            f"nothing can be written in the folder {folder}: {error.strerror}; choose another -o"
        ) from error


def _place(temporary: Path, target: Path) -> None:
    """Rename, but never over a file that came up meanwhile."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise UsageError(f"{target} is there already; add --force to replace it") from None
    except OSError:  # no hard links on this file system
        temporary.replace(target)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _summary(
    found: Inference, name: str, target: Path, robot: Any, in_catalogue: bool
) -> dict[str, Any]:
    drive = found.platform
    radius = found.fields.get("wheel_radius")
    known = name if in_catalogue else shlex.quote(str(target))
    return {
        "name": name,
        "file": str(target),
        "urdf": str(found.urdf.path),
        "platform": drive.type.value,
        "wheels": [w.name for w in drive.rolling],
        "wheel_radius": None if radius is None else radius.value,
        "half_track": drive.half_track if drive.rolling else None,
        "heading": drive.forward.heading,
        "tip": found.arm.tip.value,
        "arm_joints": [joint.name for joint in found.arm.joints],
        "locked": [joint for lock in found.locks for joint in lock.joints],
        "rest": {joint: value.value for joint, value in found.rest.items()},
        "nq": robot.nq,
        "nz": robot.nz,
        "uncertain": list(found.uncertain),
        "next": [f"mobman robots check {known}", f"mobman run {known}"],
    }


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
