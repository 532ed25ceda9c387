"""From what a user names (a file, ``-``, a folder, an archive, xacro, ...) to a URDF on disk."""

from __future__ import annotations

import hashlib
import os
import re
import stat
import sys
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from mobman.errors import MobmanError, SpecError, UsageError
from mobman.files import read_input, write_whole
from mobman.robots.incoming import described, mujoco_model, sdf_file, xacro_file
from mobman.robots.places import made_folder
from mobman.robots.urdf.read import MEGABYTES, parse_xml
from mobman.robots.urdf.validate import listed

URDF_ENDINGS = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".zip")
"""Endings of files that describe a robot without a TOML."""

_ADDRESS = re.compile(r"(?!file:)[A-Za-z][A-Za-z0-9+.-]*://|git@|www\.")
_ROS_NAME = re.compile(r"[a-z0-9_]+_description")
_DEPTH, _MOST_FILES, _MOST_MEGABYTES = 8, 20_000, 2000.0  # of folders and archives
_PLAIN = "robot.urdf"  # a name that says nothing: that of the robot is looked for inside


@dataclass(frozen=True)
class Incoming:
    """A URDF on disk.

    Attributes:
        path: The file; absolute.
        packages: Folders in which packages of its meshes are looked for, the user's own first.
        made: True if it was made from something else, and lies among mobman's own files.
        said: What was done to get it, and what is not in it, in sentences.
        origin: The file that it was made from; None if that is itself, or a pipe.
    """

    path: Path
    packages: tuple[Path, ...] = ()
    made: bool = False
    said: tuple[str, ...] = ()
    origin: Path | None = None


def incoming(
    source: str | os.PathLike[str],
    *,
    packages: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
) -> Incoming:
    """A URDF of what a user names.

    Args:
        source: A URDF, xacro, MJCF or SDF file, a folder or a ZIP archive with one, a pipe, ``"-"`` for
            the standard input, or a name of the package robot_descriptions.
        packages: Folders that hold packages of ``$(find NAME)`` and ``package://NAME/...``.
        arguments: Values of xacro's arguments.

    Raises:
        UsageError: If it is none of these, or there are several.
        SpecError: If it cannot be read or made into a URDF.
    """
    text, own = os.fspath(source), tuple(packages)
    if text == "-":
        return _of_content(_piped(sys.stdin.fileno(), "standard input"), None, own, arguments)
    if _ADDRESS.match(text):
        raise UsageError(f"{text} is not fetched; download it first, and name the file")
    path = Path(text.removeprefix("file://"))
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        if _ROS_NAME.fullmatch(text):
            return _of_file(described.urdf_of(text), own, arguments)
        if isinstance(error, OSError) and path.is_symlink() and not path.exists():
            raise UsageError(f"there is no URDF at {os.path.realpath(path)}") from error
        raise UsageError(f"there is no URDF at {os.path.abspath(text)}") from error
    if stat.S_ISDIR(mode):
        return _of_folder(path, own, arguments)
    if stat.S_ISFIFO(mode) or stat.S_ISCHR(mode):
        with path.open("rb") as pipe:
            return _of_content(_piped(pipe.fileno(), str(path)), None, own, arguments)
    if path.suffix.lower() == ".zip":
        return _of_archive(path, own, arguments)
    return _of_file(path, own, arguments)


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


def _of_file(
    path: Path, packages: tuple[Path, ...], arguments: Mapping[str, str] | None
) -> Incoming:
    content = read_input(path, "URDF", MEGABYTES, "geometry belongs in meshes")
    return _of_content(content, path.resolve(), packages, arguments)


def _of_content(
    content: bytes,
    path: Path | None,
    packages: tuple[Path, ...],
    arguments: Mapping[str, str] | None,
) -> Incoming:
    """A URDF of a file's content; the path is None if it came through a pipe."""
    where = f"the URDF {path}" if path is not None else "the URDF of the pipe"
    try:
        root, _ = parse_xml(content, where)
    except SpecError:
        if path is None:
            raise
        return Incoming(path, packages)  # whoever reads it says what is wrong
    beside = path if path is not None else Path.cwd() / _PLAIN
    name = f"{beside.name.split('.')[0] or 'robot'}.urdf"
    if root.tag == "mujoco":
        text, said, files = mujoco_model.urdf_of(content, beside)
        kept = keep_urdf(name, text.encode(), files)
        return Incoming(kept, packages, True, tuple(said), path)
    if root.tag == "sdf":
        text, said = sdf_file.urdf_of(root, where.replace("URDF", "SDF file"))
        found = (*packages, beside.parent, *beside.parent.parents)
        return Incoming(keep_urdf(name, text.encode()), found, True, tuple(said), path)
    if root.tag == "robot" and xacro_file.is_xacro(root):
        text, said = xacro_file.expanded(content, beside, packages, dict(arguments or {}))
        found = (*packages, beside.parent, *beside.parent.parents)
        return Incoming(keep_urdf(name, text.encode()), found, True, tuple(said), path)
    if arguments:
        raise UsageError("--xacro-arg is for files of xacro, which this is not")
    if path is None:
        kept = keep_urdf(_PLAIN, content)
        return Incoming(kept, (*packages, Path.cwd()), True, (f"a copy is kept: {kept}",))
    return Incoming(path, packages)


def _of_folder(
    folder: Path, packages: tuple[Path, ...], arguments: Mapping[str, str] | None
) -> Incoming:
    """The only URDF of a folder, or else the only xacro file that is no part of another."""
    files = list(_files(folder))
    found = [path for path in files if path.suffix.lower() == ".urdf"]
    if not found:
        found = [path for path in files if path.name.lower().endswith(".urdf.xacro")]
    if not found:
        raise UsageError(f"there is no URDF in the folder {folder.resolve()}")
    if len(found) > 1:
        names = listed(str(path.relative_to(folder)) for path in found)
        raise UsageError(f"{folder} has {len(found)} robots: name one of {names}")
    given = _of_file(found[0], packages, arguments)
    said = (f"the robot of the folder {folder} is {found[0].relative_to(folder)}", *given.said)
    return replace(given, said=said)


def _files(folder: Path) -> Iterator[Path]:
    count = 0
    for place, folders, names in os.walk(folder):
        deep = len(Path(place).relative_to(folder).parts) >= _DEPTH
        folders[:] = [] if deep else sorted(f for f in folders if not f.startswith("."))
        for name in sorted(names):
            count += 1
            if count > _MOST_FILES:
                raise UsageError(
                    f"{folder} has more than {_MOST_FILES} files; name the URDF itself"
                )
            yield Path(place) / name


def _of_archive(
    path: Path, packages: tuple[Path, ...], arguments: Mapping[str, str] | None
) -> Incoming:
    """The only robot of a ZIP archive, whose files are kept.

    Raises:
        SpecError: If it is no archive, too large, or would write outside its folder.
    """
    try:
        digest = hashlib.sha256()
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
        folder = made_folder() / digest.hexdigest()[:16] / path.stem
        with zipfile.ZipFile(path) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            if len(entries) > _MOST_FILES:
                raise SpecError(f"{path} has {len(entries)} files; allowed: {_MOST_FILES}")
            if sum(entry.file_size for entry in entries) > _MOST_MEGABYTES * 1e6:
                raise SpecError(f"{path} unpacks to more than {_MOST_MEGABYTES:g} MB")
            for entry in entries:
                inner = PurePosixPath(entry.filename.replace("\\", "/"))
                if (
                    inner.is_absolute()
                    or ".." in inner.parts
                    or stat.S_ISLNK(entry.external_attr >> 16)
                ):
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
    given = _of_folder(folder, packages, arguments)
    said = (f"{path.name} is unpacked to {folder}", *given.said[1:])
    return replace(given, made=True, said=said, origin=given.origin or given.path)


def keep_urdf(name: str, content: bytes, files: Mapping[str, bytes] | None = None) -> Path:
    """A place for a made URDF and the files that belong to it, the same for the same content."""
    files, digest = files or {}, hashlib.sha256(content)
    for key in sorted(files):
        digest.update(key.encode() + files[key])
    folder = made_folder() / digest.hexdigest()[:16]
    try:
        for inner, own in {name: content, **files}.items():
            (folder / inner).parent.mkdir(parents=True, exist_ok=True)
            write_whole(folder / inner, own)
    except OSError as error:
        raise MobmanError(
            f"cannot write the URDF in {folder}: {error.strerror or error}"
        ) from error
    return folder / name
