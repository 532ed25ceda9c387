"""The source of laws and tasks that are not mobman's own, as part of what a run depends on."""

from __future__ import annotations

import hashlib
import inspect
from pathlib import Path
from typing import Any


def foreign_code_sha256(*things: Any) -> str:
    """Hash of the files that hold the sources: who edits a law wants its runs anew.

    Args:
        *things: Classes and functions; those of mobman, whose version says what they are, do not
            count, nor do those without a file, made in a session or compiled.

    Returns:
        16 hexadecimal digits; empty if none counts.
    """
    own = Path(__file__).parents[1]
    digest, foreign = hashlib.sha256(), False
    for thing in things:
        try:
            path = Path(inspect.getfile(thing)).resolve()
        except (TypeError, OSError):
            continue
        if not path.is_relative_to(own) and path.is_file():
            digest.update(path.read_bytes())
            foreign = True
    return digest.hexdigest()[:16] if foreign else ""
