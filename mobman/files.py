"""Files: those that somebody names are read with care, new ones are written whole or not at all, so that
other processes, and machines on a shared disk, bear it."""

from __future__ import annotations

import os
import socket
import stat
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

from mobman.errors import MobmanError, SpecError, UsageError

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def resource_folder(name: str) -> Path:
    """The folder ``robots`` or ``benchmarks`` of the project's own robots and suites: in the wheel, or
    next to the package in a checkout. MobmanError if the installation lacks it."""
    package = Path(str(files("mobman")))
    for folder in (package / "data" / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise MobmanError(f"mobman's folder {name!r} is missing: looked in {package} and beside it")


def as_path(what: str, given: Any) -> Path:
    """The path that a user gave as the argument ``what``; UsageError if it is none."""
    if not isinstance(given, (str, os.PathLike)):
        raise UsageError(f"{what} = {given!r}: expected a path")
    return Path(given)


# Reading -----------------------------------------------------------------------------------------------


def read_input(path: Path, what: str, megabytes: float, advice: str) -> bytes:
    """The content of a file; never waits for one, and looks at its size before anything is read.
    SpecError if it is not there, cannot be read, is no file, is empty, or too large, with an ``advice``;
    messages call it ``what``, such as ``"robot file"``."""
    content, most = b"", int(megabytes * 1e6)
    try:
        status = path.stat()
        kind = _KINDS.get(stat.S_IFMT(status.st_mode))
        if kind is None and status.st_size <= most:
            with path.open("rb") as file:
                # it may have grown since, and some files of the system say 0 whatever they hold
                content = file.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise SpecError(f"cannot read the {what} {path}: {reason}") from error
    if kind is not None:
        raise SpecError(f"cannot read the {what} {path}: it is {kind}; give a file")
    if status.st_size > most:
        size = f"{status.st_size / 1e6:.3g} MB; allowed: {megabytes:g} MB"
        raise SpecError(f"the {what} {path} has {size} ({advice})")
    if len(content) > most:
        raise SpecError(f"the {what} {path} is larger than {megabytes:g} MB ({advice})")
    if not content.strip():
        raise SpecError(f"the {what} {path} is empty")
    return content


def check_within(path: Path, folder: Path) -> None:
    """Check that a file of a folder is no link to elsewhere; SpecError if it is one."""
    if not path.resolve().is_relative_to(folder.resolve()):
        raise SpecError(f"{path} is a link out of {folder}, which is not followed")


def read_within(path: Path, folder: Path, what: str, megabytes: float) -> bytes:
    """The content of a file of a folder that somebody else may have made: :func:`read_input` and
    :func:`check_within`, with their errors."""
    check_within(path, folder)
    return read_input(path, what, megabytes, "mobman writes smaller ones")


# Writing -----------------------------------------------------------------------------------------------


def temporary_beside(path: Path) -> Path:
    """A name for a temporary file in the same folder, unique to this call."""
    owner = f"{socket.gethostname()}.{os.getpid()}.{uuid.uuid4().hex}"
    return path.with_name(f".{path.name}.{owner}.tmp")


def is_abandoned(temporary: Path) -> bool:
    """True if the process that wrote a temporary file was on this machine and has ended."""
    parts = temporary.name.rsplit(".", 3)
    if len(parts) != 4 or not parts[0].endswith("." + socket.gethostname()):
        return False
    try:
        os.kill(int(parts[1]), 0)
    except ProcessLookupError:
        return True
    except (ValueError, OverflowError, PermissionError):
        return False
    return False


@contextmanager
def written(path: Path) -> Iterator[Path]:
    """A temporary path beside a file, which becomes the file once the block is done; its folder is made.
    MobmanError if it cannot be written; one that is there is left as it was."""
    temporary = temporary_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise MobmanError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # its folder could not be made
            temporary.unlink(missing_ok=True)


def write_all(contents: Mapping[Path, bytes]) -> None:
    """Write files to temporary names, then give them their own; errors as of :func:`written`."""
    with ExitStack() as all_of_them:
        for path, content in contents.items():
            all_of_them.enter_context(written(path)).write_bytes(content)


def write_whole(path: Path, content: bytes, check: Callable[[Path], None] | None = None) -> None:
    """Write a file whole or not at all, also where the machine loses its power meanwhile; its folder
    exists, and ``check`` is called with the written file before it gets its name, and may raise. OSError
    if it cannot be written; one that is there is left as it was."""
    temporary = temporary_beside(path)
    try:
        temporary.write_bytes(content)
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        if check is not None:
            check(temporary)
        os.replace(temporary, path)
        sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable, where the system can."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_new(path: Path, text: str, force: bool, advice: str) -> None:
    """Write a file whole or not at all, and its folder where there is none; over one that is there only
    by ``force``. UsageError if it cannot be written, with an ``advice`` such as ``"choose another -o"``,
    or is there already; folders made for it are gone then."""
    folder, temporary = path.absolute().parent, temporary_beside(path.absolute())
    missing = [place for place in (folder, *folder.parents) if not os.path.exists(place)]
    what = f"the folder {folder} cannot be made"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        what = f"nothing can be written in the folder {folder}"
        temporary.write_text(text, encoding="utf-8")
        if force or not _linked(temporary, path):
            os.replace(temporary, path)
    except OSError as error:
        raise UsageError(f"{what}: {error.strerror}; {advice}") from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        for place in missing:  # those that are still empty, the innermost first
            with suppress(OSError):
                place.rmdir()


def _linked(temporary: Path, path: Path) -> bool:
    """Link a file to its name, never over one that came up meanwhile; False if there are no links."""
    try:
        os.link(temporary, path)
    except FileExistsError:
        raise UsageError(f"{path} is there already; add --force to replace it") from None
    except OSError:
        return False
    return True
