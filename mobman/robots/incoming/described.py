"""Robots of the package robot_descriptions, by their names there."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path

from mobman.errors import FOREIGN_ERRORS, UnknownNameError, UsageError


def urdf_of(name: str) -> Path:
    """The URDF of a robot of robot_descriptions, which that package fetches where it is not there.

    Raises:
        UsageError: If the package is not installed, or the robot cannot be fetched.
        UnknownNameError: If it has no such robot.
    """
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
