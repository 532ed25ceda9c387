"""Files written whole or not at all, so that other processes, and machines on a shared disk, bear it."""

from __future__ import annotations

import os
import socket
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from mobman.errors import UsageError


def as_path(what: str, given: Any) -> Path:
    """A path that a user gave.

    Args:
        what: Name of the argument, for messages.
        given: Its value.

    Raises:
        UsageError: If it is none.
    """
    if not isinstance(given, (str, os.PathLike)):
        raise UsageError(f"{what} = {given!r}: expected a path")
    return Path(given)


def temporary_beside(path: Path) -> Path:
    """A name for a temporary file in the same folder, unique to this call."""
    return path.with_name(
        f".{path.name}.{socket.gethostname()}.{os.getpid()}.{uuid.uuid4().hex}.tmp"
    )


def is_abandoned(temporary: Path) -> bool:
    """True if the process that wrote a temporary file was on this machine and has ended."""
    parts = temporary.name.rsplit(".", 3)
    if len(parts) != 4 or not parts[0].endswith("." + socket.gethostname()):
        return False
    try:
        os.kill(int(parts[1]), 0)
    except ProcessLookupError:
        return True
    except (ValueError, PermissionError):
        return False
    return False


def write_new(path: Path, text: str, force: bool, advice: str) -> None:
    """Write a file whole or not at all, and its folder where there is none.

    Args:
        path: The file.
        text: Its content.
        force: Whether it may replace one that is there.
        advice: Added to messages, such as ``"choose another -o"``.

    Raises:
        UsageError: If it cannot be written, or is there already; folders made for it are gone then.
    """
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


def write_whole(path: Path, content: bytes, check: Callable[[Path], None] | None = None) -> None:
    """Write a file whole or not at all, also where the machine loses its power meanwhile.

    Args:
        path: The file; its folder exists.
        content: Its content.
        check: Is called with the written file before it gets its name, and may raise.

    Raises:
        OSError: If it cannot be written; one that is there is left as it was.
    """
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
