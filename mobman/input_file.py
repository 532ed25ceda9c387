"""Reading a file that somebody names: a file only, of a sensible size, and never waiting for one."""

from __future__ import annotations

import stat
from pathlib import Path

from mobman.errors import SpecError

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def read_input(path: Path, what: str, megabytes: float, advice: str) -> bytes:
    """The content of a file.

    Args:
        path: The file.
        what: What it is, for messages, such as ``"robot file"``.
        megabytes: Largest size (MB); the size is looked at before anything is read.
        advice: What to say of a file that is larger.

    Raises:
        SpecError: If it is not there, cannot be read, is no file, is too large, or is empty.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise _cannot_read(path, what, error) from error
    for is_kind, kind in _KINDS:
        if is_kind(status.st_mode):
            raise SpecError(f"cannot read the {what} {path}: it is {kind}; give a file")
    if status.st_size > megabytes * 1e6:
        raise SpecError(
            f"the {what} {path} has {status.st_size / 1e6:.3g} MB; allowed: {megabytes:g} MB ({advice})"
        )
    try:
        with path.open("rb") as file:
            # it may have grown since, and some files of the system say 0 whatever they hold
            content = file.read(int(megabytes * 1e6) + 1)
    except OSError as error:
        raise _cannot_read(path, what, error) from error
    if len(content) > megabytes * 1e6:
        raise SpecError(f"the {what} {path} is larger than {megabytes:g} MB ({advice})")
    if not content.strip():
        raise SpecError(f"the {what} {path} is empty")
    return content


def _cannot_read(path: Path, what: str, error: OSError | ValueError) -> SpecError:
    reason = error.strerror if isinstance(error, OSError) else None
    return SpecError(f"cannot read the {what} {path}: {reason or error}")


def check_within(path: Path, folder: Path) -> None:
    """Check that a file of a folder is no link to elsewhere.

    Raises:
        SpecError: If it is one.
    """
    if not path.resolve().is_relative_to(folder.resolve()):
        raise SpecError(f"{path} is a link out of {folder}, which is not followed")


def read_within(path: Path, folder: Path, what: str, megabytes: float) -> bytes:
    """The content of a file of a folder that somebody else may have made.

    Raises:
        SpecError: As :func:`read_input`, and if it is a link to elsewhere.
    """
    check_within(path, folder)
    return read_input(path, what, megabytes, "mobman writes smaller ones")
