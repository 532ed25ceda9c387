"""``mobman robots add``: a robot's TOML from its URDF."""

from __future__ import annotations

import os
import re
import shlex
import tomllib
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from click import BadParameter, Choice, argument, command, option
from click import Path as click_path

from mobman.cli.options import FILE, POSITIVE, reports
from mobman.cli.output import console, report
from mobman.errors import MobmanError, UsageError
from mobman.files import write_new
from mobman.robots.infer.findings import TYPES, Inferred, Options
from mobman.robots.spec import own_robots, spec_of, user_robots_folder

if TYPE_CHECKING:
    from mobman.model.mobile_manipulator import MobileManipulator
    from mobman.robots.urdf.read import UrdfFile, UrdfSources

_ABOUT_OPTIONS = r"field '(platform|arm|urdf\.lock)\b|\[platform\]|\[arm\]"
"""Parts of a message that an option may mend."""


class _PlatformTypes(Choice):  # type: ignore[type-arg]  # a class of str since click 8.2
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
    flag: str, name: str, about: str, what: str = "JOINT", **more: Any
) -> Callable[..., Any]:
    return option(flag, name, multiple=True, metavar=what, help=f"{about}; repeatable.", **more)


def _assigned(text: str) -> tuple[str, str]:
    """A NAME:=VALUE text."""
    name, equals, value = text.partition(":=")
    if not name or not equals:
        raise BadParameter(f"{text!r} is not NAME:=VALUE")
    return name, value


def _mounts(
    mounted: Sequence[str], carriers: Sequence[str], prefixes: Sequence[str]
) -> Iterator[tuple[str, str | None, str]]:
    """The file that is mounted, its link (None: not said) and prefix."""
    if len(carriers) > len(mounted) or len(prefixes) > len(mounted):
        raise UsageError(
            f"--mount is given {len(mounted)} times, --on {len(carriers)} and --prefix "
            f"{len(prefixes)} times; give one --on, and at most one --prefix, for each --mount"
        )
    for urdf, link, prefix in zip_longest(mounted, carriers, prefixes):
        yield urdf, link, prefix or ""


_FOLDER = click_path(path_type=Path, exists=True, file_okay=False)
_NAME = "Name of the robot; by default that of FILE, of the URDF's file or the one in the URDF."
_UP = "Axis of the root link that points up."
_FILE = "TOML file to write; by default in the user's folder of robots."


@command()
@argument("urdf", metavar="URDF")
@option("--name", help=_NAME)
@option("--tip", help="Link whose origin is the end-effector.")
@_several("--right-wheel", "right_wheels", "Driven wheel")
@_several("--left-wheel", "left_wheels", "Driven wheel")
@_several("--wheel", "wheels", "Of an omnidirectional platform")
@_several("--steering", "steering", "Of a car")
@option("--platform", type=_TYPES, help="Platform type.")
@option("--wheel-radius", type=POSITIVE, help="m.")
@option("--heading", type=float, help="Direction of forward in the root link's frame, rad.")
@_several("--lock", "lock", "Joints that do not move", "PATTERN")
@_several("--package-path", "packages", "Folder that holds packages of meshes", "DIR", type=_FOLDER)
@option("--up", type=Choice(["x", "y", "z", "-x", "-y", "-z"]), default="z", help=_UP)
@_several("--xacro-arg", "arguments", "Argument of a xacro file", "NAME:=VALUE", type=_assigned)
@_several("--mount", "mounted", "URDF of an arm to be mounted", "URDF")
@_several("--on", "carriers", "Link that carries what is mounted, in the same order", "LINK")
@_several("--prefix", "prefixes", "Put before all names of what is mounted", "TEXT")
@option("--as-it-is", is_flag=True, help="Write also sizes that the checks call wrong.")
@option("--force", is_flag=True, help="Replace a file or a robot that is there.")
@option("-o", "--output", type=FILE, metavar="FILE", help=_FILE)
@reports
def add(urdf: str, name: str | None, output: Path | None, force: bool, **facts: Any) -> None:
    """Write the TOML of a robot from its URDF: wheels, radius, arm, rest posture.

    URDF is a file of URDF, xacro, MJCF or SDF, a folder or a ZIP archive with one, - for the standard
    input, or a name of the package robot_descriptions. Each value has a comment that says why it was
    taken. What the URDF does not tell is asked for.
    """
    from mobman.robots.incoming.describe import describe
    from mobman.robots.incoming.incoming import OnLink
    from mobman.robots.urdf.meshes import with_absolute_meshes
    from mobman.robots.urdf.read import UrdfFile, UrdfSources

    mounts = _mounts(*(facts.pop(key) for key in ("mounted", "carriers", "prefixes")))
    given: dict[str, Any] = {
        "up": facts.pop("up"),
        "packages": [path.resolve() for path in facts.pop("packages")],
        "arguments": dict(facts.pop("arguments")),
    }
    if output is not None and output.suffix != ".toml":
        raise UsageError(
            f"-o {str(output)!r} does not end in .toml, which distinguishes a robot's file from a "
            f"name; give {f'{output}.toml'!r}"
        )
    options = Options(**facts, types=_TYPES.fields)
    options.check("--{}")
    on_links = [OnLink(*mount) for mount in mounts]
    found = describe(urdf, options, name=name, output=output, mounts=on_links, **given)
    name = found.name
    target = output if output is not None else user_robots_folder() / f"{name}.toml"
    _check_free(name, target, force, by_name=output is None)
    folder = None if output is None else target.absolute().parent
    sources, copies, files = [], dict[Path, str](), []
    for i, part in enumerate(found.parts):
        source, file = part.source(folder, found.packages), part.file
        if source.package is None and (output is None or part.made):
            # what was made, or lies anywhere: a copy, so that nothing breaks where the file is moved
            place = target.with_name(f"{target.stem}{f'.mount{i}' if i else ''}.urdf")
            copies[place] = with_absolute_meshes(file).decode()
            source = source.model_copy(update={"path": place.name, "packages": []})
            file = UrdfFile(place, file.package_folders, copies[place].encode(), up=file.up)
        else:  # the file itself, which may change
            source = source.model_copy(update={"sha256": file.sha256()})
        sources.append(source)
        files.append(file)
    text, heading, built = found.toml(sources), None, UrdfSources(tuple(files)) if copies else None
    robot = _robot_of(text, target, built)
    for path in () if force else copies:
        _check_absent(path)
    if robot.platform.base_joints:
        heading = _heading(robot)
        text = found.toml(sources, heading)
        robot = _robot_of(text, target, built)
    if doubts := _verified(robot, options.as_it_is):
        found = found._replace(warnings=(*found.warnings, *doubts))
        text = found.toml(sources, heading)
    for place, content in {**copies, target: text}.items():
        write_new(place, content, force, "choose another -o")
    known = name if output is None else shlex.quote(str(target))
    summary = {
        "name": name,
        "file": str(target),
        **found.found.summary(),
        "nq": robot.nq,
        "nz": robot.nz,
        "uncertain": list(found.found.uncertain),
        "warnings": [*found.warnings, *_missing_meshes(files)],
        "next": [f"mobman robots check {known}", f"mobman run {known}"],
    }
    report(summary)
    _print(summary)


def _heading(robot: MobileManipulator) -> Inferred:
    """The weight of the heading in the posture criterion, by the rule, and what it is good for."""
    from mobman.model.metric import conditioning

    weights = robot.criterion_weights
    weight = weights[robot.joint_names.index(robot.platform.base_joints[-1])]
    why = f"1/rad^2: conditioning {conditioning(robot, weights):.2g} at rest"
    return Inferred(float(weight), why)


def _check_free(name: str, target: Path, force: bool, by_name: bool) -> None:
    """Before anything is computed: nothing that is there is replaced unasked."""
    from mobman.robots.catalogue import list_robots

    if by_name and name in own_robots():
        raise UsageError(f"the robot {name!r} comes with mobman; choose another --name")
    if force:
        return
    _check_absent(target)
    if by_name and name in list_robots():
        raise UsageError(
            f"there is a robot {name!r} already; choose another --name, or add --force"
        )


def _check_absent(path: Path) -> None:
    if os.path.exists(path):
        raise UsageError(f"{path} is there already; choose another --name or -o, or add --force")


def _verified(robot: MobileManipulator, as_it_is: bool) -> list[str]:
    """Checks of what is about to be written; what is or may be wrong, in sentences. UsageError if a size
    is wrong: it is asked for, and never written without ``--as-it-is``."""
    from mobman.checks.checks import run_checks

    findings = run_checks(robot, only=("ground", "wheel-radius"))
    wrong = [finding for finding in findings if finding.status == "wrong"]
    if wrong and not as_it_is:
        said = "; ".join(finding.found for finding in wrong)
        raise UsageError(
            f"nothing was written, since a size cannot be right: {said}; correct the URDF, or give "
            "--wheel-radius (m), --up or --heading; with --as-it-is it is written as it is"
        )
    return [
        f"{one.check}{', wrong' if one.status == 'wrong' else ''}: {one.found}"
        for one in findings
        if one.status != "ok"
    ]


def _missing_meshes(files: Sequence[UrdfFile]) -> Iterator[str]:
    """A sentence about meshes that are not where the URDFs name them, if there are any."""
    from mobman.robots.urdf.meshes import mesh_paths

    named = {mesh.filename: mesh for file in files for mesh in mesh_paths(file.parse(), file)}
    if missing := [name for name, mesh in named.items() if mesh.path is None]:
        yield (
            f"{len(missing)} of {len(named)} meshes are missing, {missing[0]!r} for instance: plain "
            "shapes are drawn instead; --package-path names the folder that holds their packages"
        )


def _robot_of(text: str, target: Path, sources: UrdfSources | None) -> MobileManipulator:
    """The robot of a file that is written only if it can be loaded; its copies are not there yet."""
    from mobman.model.build import build_robot, load_robot

    try:
        spec = spec_of(tomllib.loads(text), target)
        return load_robot(spec) if sources is None else build_robot(spec, sources)
    except MobmanError as error:
        advice = "correct the URDF"
        if re.search(_ABOUT_OPTIONS, str(error)):
            flags = "--platform, --right-wheel, --left-wheel, --tip, --lock, --heading"
            advice += f", or say what was taken wrongly by {flags}"
        # a class with the same exit status that takes a message only
        kind = UsageError if error.exit_status == UsageError.exit_status else MobmanError
        message = f"nothing was written, since the robot cannot be loaded: {error}; {advice}"
        raise kind(message) from error


def _print(summary: dict[str, Any]) -> None:
    out = console()
    out.print(f"{summary['name']}: {summary['file']}", soft_wrap=True)
    joints, wheels = summary["arm_joints"], ", ".join(summary["wheels"])
    lines = [("platform", summary["platform"])]
    if wheels:
        lines += [("wheels", wheels), ("radius", f"{summary['wheel_radius']:.4g} m")]
    if summary["half_track"] is not None:
        lines += [("half track", f"{summary['half_track']:.4f} m")]
    if summary["heading"]:
        lines += [("heading", f"{summary['heading']:.4g} rad from the root link's x axis")]
    lines += [("arm joints", f"{len(joints)}: {', '.join(joints)}"), ("tip", summary["tip"])]
    if summary["following"]:
        lines += [("follow", ", ".join(summary["following"]))]
    rest = ", ".join(f"{joint} {at:.4g}" for joint, at in summary["rest"].items())
    lines += [("locked", f"{len(summary['locked'])} joints"), ("rest", rest)]
    for key, texts in (("uncertain", "uncertain"), ("warning", "warnings"), ("next", "next")):
        lines += [(key, text) for text in summary[texts]]
    for key, text in lines:
        out.print(f"  {key:<11} {text}", soft_wrap=True)
