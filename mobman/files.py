"""Temporary files that other processes, and other machines on a shared disk, do not stumble over."""

from __future__ import annotations

import os
import socket
import uuid
from pathlib import Path


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
