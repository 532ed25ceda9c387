"""From what a user names (a file, ``-``, a folder, an archive, xacro, ...) to a URDF on disk."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import re
import stat
import sys
import types
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from mobman.errors import FOREIGN_ERRORS, MobmanError, SpecError, UnknownNameError, UsageError
from mobman.files import read_input, write_whole
from mobman.isolation import helper
from mobman.robots.incoming import sdf_file
from mobman.robots.incoming.models import urdf_of_mjcf
from mobman.robots.spec import Mount, UrdfSource, made_folder
from mobman.robots.urdf.meshes import MeshFinder
from mobman.robots.urdf.read import MEGABYTES, UrdfFile, macros, parse_xml, urdf_file
from mobman.robots.urdf.validate import listed

URDF_ENDINGS = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".zip")
"""Endings of files that describe a robot without a TOML."""

_ADDRESS = re.compile(r"(?!file:)[A-Za-z][A-Za-z0-9+.-]*://|git@|www\.")
_ROS_NAME = re.compile(r"[a-z0-9_]+_description")
_DEPTH, _MOST_FILES, _MOST_MEGABYTES = 8, 20_000, 2000.0  # of folders and archives
_PACKAGE = "example-robot-data"
_PLAIN = "robot.urdf"  # a name that says nothing: that of the robot is looked for inside


class OnLink(NamedTuple):
    """Something to be mounted."""

    source: str  # as of :func:`incoming`
    link: str | None  # link that carries it; None if the user did not say
    prefix: str = ""


@dataclass(frozen=True)
class UrdfPart:
    """A URDF of a robot."""

    file: UrdfFile
    made: bool = False  # True if it was made from something else, and lies among mobman's own files
    said: tuple[str, ...] = ()  # what was done to get it, and what is not in it, in sentences
    origin: Path | None = None  # the file that it was made from; None if that is itself, or a pipe
    mount: OnLink | None = None  # how it is mounted; None for the platform's

    def source(self, folder: Path | None, packages: Sequence[Path]) -> UrdfSource:
        """The table of a TOML for this part, with folders that hold packages of its meshes; paths are
        relative to the TOML's folder where one is above the other, absolute if that is None."""
        urdf = self.file.path.resolve()
        own: dict[str, Any] = {"path": _path_from(urdf, folder), "up": self.file.up}
        own["packages"] = [_path_from(package.resolve(), folder) for package in packages]
        for robots in (up for up in urdf.parents if up.parts[-2:] == (_PACKAGE, "robots")):
            place = {"path": urdf.relative_to(robots).as_posix(), "package": _PACKAGE}
            with suppress(SpecError):
                if urdf_file(UrdfSource(**place), Path(), "").path == urdf:  # this very file
                    own |= place
        if self.mount is None:
            return UrdfSource(**own)
        return Mount(**own, parent=str(self.mount.link), prefix=self.mount.prefix)


def _path_from(path: Path, folder: Path | None) -> str:
    """A path relative to a folder where one is above the other, else absolute."""
    if folder is not None:
        folder = folder.resolve()
        if path.is_relative_to(folder) or folder.is_relative_to(path.parent):
            return Path(os.path.relpath(path, folder)).as_posix()
    return str(path)


class _Given(NamedTuple):
    packages: tuple[Path, ...]
    arguments: Mapping[str, str]


def incoming(
    source: str | os.PathLike[str],
    *,
    packages: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
) -> UrdfPart:
    """A URDF of what a user names.

    Args:
        source: A URDF, xacro, MJCF or SDF file, a folder or a ZIP archive with one, a pipe, ``"-"`` for
            the standard input, or a name of the package robot_descriptions.
        packages: Folders that hold packages of ``$(find NAME)`` and ``package://NAME/...``.
        arguments: Values of xacro's arguments.

    UsageError if it is none of these, or there are several; SpecError if it cannot be made a URDF.
    """
    text, given = os.fspath(source), _Given(tuple(packages), arguments or {})
    if text == "-":
        return _of_content(_piped(sys.stdin.fileno(), "standard input"), None, given)
    if _ADDRESS.match(text):
        raise UsageError(f"{text} is not fetched; download it first, and name the file")
    path = Path(text.removeprefix("file://"))
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        if _ROS_NAME.fullmatch(text):
            return _of_file(_described(text), given)
        link = isinstance(error, OSError) and path.is_symlink() and not path.exists()
        place = os.path.realpath(path) if link else os.path.abspath(text)
        raise UsageError(f"there is no URDF at {place}") from error
    if stat.S_ISDIR(mode):
        return _of_folder(path, given)
    if stat.S_ISFIFO(mode) or stat.S_ISCHR(mode):
        with path.open("rb") as pipe:
            return _of_content(_piped(pipe.fileno(), str(path)), None, given)
    return (_of_archive if path.suffix.lower() == ".zip" else _of_file)(path, given)


def _piped(descriptor: int, what: str) -> bytes:
    """All that a pipe has; nothing is waited for at a terminal."""
    if os.isatty(descriptor):
        raise UsageError(f"{what} is a terminal; pipe a URDF into it, or name a file")
    with os.fdopen(os.dup(descriptor), "rb") as pipe:
        content = pipe.read(int(MEGABYTES * 1e6) + 1)
    if len(content) > MEGABYTES * 1e6:
        raise SpecError(f"{what} has more than {MEGABYTES:g} MB; geometry belongs in meshes")
    if not content.strip():
        raise SpecError(f"{what} is empty")
    return content


def _described(name: str) -> Path:
    """The URDF of a robot of robot_descriptions, which that package fetches where it is not there."""
    if importlib.util.find_spec("robot_descriptions") is None:
        raise UsageError(
            f"there is no file {name!r}; if it is a robot of the package robot_descriptions, install "
            "that: pip install 'mobman[descriptions]'"
        )
    known = importlib.import_module("robot_descriptions").DESCRIPTIONS
    if name not in known:
        raise UnknownNameError("robot of robot_descriptions", name, known)
    try:
        module = importlib.import_module(f"robot_descriptions.{name}")
        path = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    except FOREIGN_ERRORS as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(
            f"robot_descriptions cannot fetch {name!r}: {reason[:200]}; it needs git and a network the "
            "first time"
        ) from error
    if path is None:
        raise UsageError(f"{name!r} of robot_descriptions has neither a URDF nor an MJCF file")
    return Path(path)


def _of_file(path: Path, given: _Given) -> UrdfPart:
    content = read_input(path, "URDF", MEGABYTES, "geometry belongs in meshes")
    return _of_content(content, path.resolve(), given)


def _of_content(content: bytes, path: Path | None, given: _Given) -> UrdfPart:
    """A URDF of a file's content; the path is None if it came through a pipe."""
    where = f"the URDF {path}" if path is not None else "the URDF of the pipe"
    try:
        root, _ = parse_xml(content, where)
    except SpecError:
        if path is None:
            raise
        return _plain(path, given)  # whoever reads it says what is wrong
    beside = path if path is not None else Path.cwd() / _PLAIN
    files: dict[str, bytes] = {}
    if root.tag == "mujoco":
        text, said, files = urdf_of_mjcf(content, beside)
    elif root.tag == "sdf":
        text, said = sdf_file.urdf_of(root, where.replace("URDF", "SDF file"))
    elif root.tag == "robot" and next(macros(root), None):
        text, said = _expanded(content, beside, *given)
    elif given.arguments:
        raise UsageError("--xacro-arg is for files of xacro, which this is not")
    elif path is None:
        kept = keep_urdf(_PLAIN, content)
        folders = (*given.packages, Path.cwd(), *kept.parents)
        return UrdfPart(UrdfFile(kept, folders), True, (f"a copy is kept: {kept}",))
    else:
        return _plain(path, given)
    kept = keep_urdf(f"{beside.name.split('.')[0] or 'robot'}.urdf", text.encode(), files)
    folders = (*given.packages, *(() if root.tag == "mujoco" else beside.parents), *kept.parents)
    file = UrdfFile(kept, folders, made_of="" if path is None else str(path))
    return UrdfPart(file, True, tuple(said), path)


def _plain(path: Path, given: _Given) -> UrdfPart:
    return UrdfPart(UrdfFile(path, (*given.packages, *path.parents)))


def _of_folder(folder: Path, given: _Given, archive: Path | None = None) -> UrdfPart:
    """The only URDF of a folder, or else its only file ``*.urdf.xacro``; messages speak of the archive
    that was unpacked there."""
    files = list(_files(folder))
    found = [path for path in files if path.suffix.lower() == ".urdf"]
    found = found or [path for path in files if path.name.lower().endswith(".urdf.xacro")]
    if not found:
        place = f"folder {folder.resolve()}" if archive is None else f"archive {archive}"
        raise UsageError(f"there is no URDF in the {place}")
    if len(found) > 1:
        names = listed(str(path.relative_to(folder)) for path in found)
        within = "" if archive is None else f", in {folder}, where it is unpacked"
        raise UsageError(
            f"{archive or folder} has {len(found)} robots: name one of {names}{within}"
        )
    only = _of_file(found[0], given)
    said = f"the robot of the folder {folder} is {found[0].relative_to(folder)}"
    return replace(only, said=(said, *only.said))


def _files(folder: Path) -> Iterator[Path]:
    count = 0
    for place, folders, names in os.walk(folder):
        deep = len(Path(place).relative_to(folder).parts) >= _DEPTH
        folders[:] = [] if deep else sorted(f for f in folders if not f.startswith("."))
        count += len(names)
        if count > _MOST_FILES:
            raise UsageError(f"{folder} has more than {_MOST_FILES} files; name the URDF itself")
        yield from (Path(place) / name for name in sorted(names))


def _of_archive(path: Path, given: _Given) -> UrdfPart:
    """The only robot of a ZIP archive, whose files are kept; SpecError if it is no archive, too large,
    or would write outside its folder."""
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        folder = made_folder() / digest[:16] / path.stem
        with zipfile.ZipFile(path) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            if len(entries) > _MOST_FILES:
                raise SpecError(f"{path} has {len(entries)} files; allowed: {_MOST_FILES}")
            if sum(entry.file_size for entry in entries) > _MOST_MEGABYTES * 1e6:
                raise SpecError(f"{path} unpacks to more than {_MOST_MEGABYTES:g} MB")
            for entry in entries:
                inner = PurePosixPath(entry.filename.replace("\\", "/"))
                link = stat.S_ISLNK(entry.external_attr >> 16)
                if inner.is_absolute() or ".." in inner.parts or link:
                    raise SpecError(f"{path}: {entry.filename!r} leads outside the archive")
                target = folder / inner
                if not (target.is_file() and target.stat().st_size == entry.file_size):
                    target.parent.mkdir(parents=True, exist_ok=True)
                    # of the size that the archive states, whatever it holds
                    with archive.open(entry) as packed:
                        write_whole(target, packed.read(entry.file_size))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise SpecError(f"cannot read the archive {path}: {error}") from error
    except OSError as error:
        raise SpecError(f"cannot unpack the archive {path}: {error.strerror or error}") from error
    only = _of_folder(folder, given, path)
    said = (f"{path.name} is unpacked to {folder}", *only.said[1:])
    return replace(only, made=True, said=said, origin=only.origin or only.file.path)


def keep_urdf(name: str, content: bytes, files: Mapping[str, bytes] | None = None) -> Path:
    """A place for a made URDF and the files that belong to it, the same for the same content."""
    every, digest = {name: content, **(files or {})}, hashlib.sha256(content)
    for key in sorted(files or {}):
        digest.update(key.encode() + every[key])
    folder = made_folder() / digest.hexdigest()[:16]
    try:
        for inner, own in every.items():
            (folder / inner).parent.mkdir(parents=True, exist_ok=True)
            write_whole(folder / inner, own)
    except OSError as error:
        why = error.strerror or error
        raise MobmanError(f"cannot write the URDF in {folder}: {why}") from error
    return folder / name


# Files of xacro, expanded by the package xacro in a process of its own ---------------------------------

# The language evaluates expressions of Python. The package refuses names that begin with ``__``; here
# all attributes of the interpreter (frames, code, classes) are refused as well, there is no environment,
# and time and memory are limited. Files that a xacro file includes are read wherever they lie.
_SECONDS, _HELPER_MEGABYTES = 30.0, 500.0
_FORBIDDEN = re.compile(r"_.*|(gi|cr|ag|tb|f|co|func)_.*|mro|format|format_map")
"""Names of attributes that lead from a value to the interpreter."""
_TWICE = re.compile(r"^(?:<class '[^']*'>: )?(.+) \1$")  # as xacro tells some errors
_BANNER = re.compile(r"<!--\s*(=+|\|.*?\|)\s*-->\s*", re.DOTALL)


def _expanded(
    content: bytes, path: Path, packages: Sequence[Path], arguments: Mapping[str, str]
) -> tuple[str, list[str]]:
    """The URDF of a xacro file, and what was run for it."""
    if importlib.util.find_spec("xacro") is None:
        raise UsageError(
            f"{path} is written in xacro, which makes a URDF of it; install the package xacro: pip "
            f"install 'mobman[xacro]', or run xacro yourself: xacro {path.name} > robot.urdf"
        )
    if not path.is_file() or path.read_bytes() != content:  # of a pipe: its place is not its own
        raise SpecError("xacro cannot be read from a pipe, since it includes files; name the file")
    limits = {"seconds": _SECONDS, "megabytes": _HELPER_MEGABYTES}
    try:
        text, included = helper.call(
            f"{__name__}:expand", str(path), dict(arguments), list(map(str, packages)), **limits
        )
    except MobmanError as error:
        raise SpecError(f"{path} cannot be expanded by xacro: {error}") from error
    files = f", with {len(included)} files that it includes" if included else ""
    return text, [f"expanded by xacro, which evaluates the expressions of {path.name}{files}"]


def expand(path: str, arguments: dict[str, str], folders: list[str]) -> list[Any]:
    """Do the work of :func:`_expanded` in this process."""
    xacro: Any = importlib.import_module("xacro")
    substitution: Any = importlib.import_module("xacro.substitution_args")
    urdf = UrdfFile(Path(path), (*map(Path, folders), *Path(path).parents))

    def find(name: str) -> str:
        if not (found := MeshFinder(urdf).package(name)):
            advice = "name the folder that holds it by --package-path"
            raise MobmanError(f"$(find {name}): there is no package {name!r}; {advice}")
        return str(found[0])

    def guarded(expression: str, known: dict[str, Any], own: Any = None) -> Any:
        code = compile(expression.strip(), "<expression>", "eval")
        _refuse_inner(code, expression)
        known.update(__builtins__={})
        return eval(code, known, own)  # no name of it leads out of its values

    def evaluated(expression: str, context: dict[str, Any]) -> str:
        given = context.get("arg", {}).items()
        values = {name: substitution.convert_value(value, "auto") for name, value in given}
        known = {k: v for k, v in substitution._eval_dict.items() if k != "__builtins__"}
        known |= {"arg": values.__getitem__, "find": find, "dirname": lambda: os.path.dirname(path)}
        known |= {kind.__name__: kind for kind in (list, dict, map, str, float, int)}
        return str(guarded(expression, known | values))

    before = dict(os.environ)
    kept = xacro.safe_eval, substitution._eval, substitution._eval_find
    try:
        os.environ.clear()
        xacro.safe_eval, substitution._eval, substitution._eval_find = guarded, evaluated, find
        xacro.all_includes.clear()
        document = xacro.process_file(path, mappings=dict(arguments), verbosity=0)
        text = _BANNER.sub("", document.toprettyxml(indent="  "))
    except MobmanError:
        raise
    except RecursionError:
        raise MobmanError("its macros or properties call each other without end") from None
    except Exception as error:  # the package raises what its parser, yaml and expressions raise
        if isinstance(cause := getattr(error, "exc", error), MemoryError):
            raise cause from None
        text = _TWICE.sub(r"\1", " ".join(str(error).split()))
        if isinstance(cause, substitution.ArgException):
            text += f": give it by --xacro-arg {cause}:=VALUE"
        raise MobmanError(text or type(error).__name__) from None
    finally:
        os.environ.update(before)
        xacro.safe_eval, substitution._eval, substitution._eval_find = kept
    if len(text) > MEGABYTES * 1e6:
        raise MobmanError(f"it makes a URDF of {len(text) / 1e6:.3g} MB; allowed: {MEGABYTES:g} MB")
    return [text, sorted({str(name) for name in xacro.all_includes})]


def _refuse_inner(code: types.CodeType, expression: str) -> None:
    """Refuse an expression that uses a name that leads to the interpreter, by a MobmanError."""
    if wrong := [name for name in code.co_names if _FORBIDDEN.fullmatch(name)]:
        raise MobmanError(f"the expression {expression[:80]!r} uses {wrong[0]!r}, which is refused")
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _refuse_inner(constant, expression)
