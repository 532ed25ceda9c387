"""Files that are there whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mobman.errors import MobmanError
from mobman.files import temporary_beside


def write_whole(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file under another name beside it, which gets its own when it is done.

    Args:
        path: The file; one that is there is replaced.
        write: Writes it to the path that it is given, which ends like the file's.

    Raises:
        MobmanError: If it cannot be written.
    """
    beside = temporary_beside(path)
    temporary = beside.with_name(beside.name + path.suffix)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            write(temporary)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise MobmanError(f"cannot write {path}: {error.strerror or error}") from error
