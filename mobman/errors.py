"""The exceptions of mobman: one base class, and messages that list what is allowed."""

from __future__ import annotations

import difflib
import sysconfig
import traceback
from collections.abc import Iterable, Sequence
from importlib import metadata

FOREIGN_ERRORS = (Exception, SystemExit)
"""Exceptions of code that is not mobman's: a plugin or a user's class may call ``sys.exit``."""


class MobmanError(Exception):
    """Base class of every error that mobman raises on purpose.

    ``exit_status`` is what the command line returns for it: 1, the command failed; 2, invalid
    usage.

    >>> import mobman as mm
    >>> try:
    ...     mm.load_robot("yuobot")
    ... except mm.MobmanError as error:
    ...     print(str(error).partition(" or ")[0], error.exit_status)
    unknown robot 'yuobot'; did you mean 'youbot' 2
    """

    exit_status = 1


class UsageError(MobmanError, ValueError):
    """Invalid usage: a name, an option or a value that is not allowed."""

    exit_status = 2


class UnknownNameError(UsageError):
    """A name that is not registered; the message gives the nearest valid names."""

    def __init__(self, kind: str, name: str, choices: Iterable[str]) -> None:
        self.kind = kind
        self.name = name
        self.choices = sorted(choices)
        near = difflib.get_close_matches(name, self.choices, n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(repr(n) for n in near)}? " if near else ""
        listing = ", ".join(self.choices) or "none"
        super().__init__(f"unknown {kind} {name!r}; {hint}valid names: {listing}")


class GainError(UsageError):
    """A controller gain outside what its theory allows; the message gives the reason."""


class SpecError(UsageError):
    """A description (robot, scenario, suite) that is not valid.

    The message names the file, the field, what was found and what is allowed.

    Args:
        message: All of it.
        heading: What is wrong, where there are several faults.
        faults: Each of them; the command line prints a line for each.
    """

    def __init__(self, message: str, heading: str = "", faults: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.heading = heading
        self.faults = tuple(faults)


class ModelError(MobmanError):
    """A robot model that cannot be built, or a quantity that it cannot give."""


class SingularityError(MobmanError):
    """A matrix that must be factorised has lost its rank.

    ``matrix`` is its name: j (kinematic), J (algorithmic), J_e, M, B; empty if it is not known.
    """

    def __init__(self, message: str, matrix: str = "") -> None:
        self.matrix = matrix
        super().__init__(message)


class RecordError(MobmanError):
    """A result file that cannot be read or written."""


def told_of_foreign(error: BaseException) -> str:
    """An error that a user's file or a plugin raised, itself or in a library that it calls, with
    its class, file and line; empty if none of these was under way, so that it is mobman's own."""
    plugins = {
        point.module.partition(".")[0]
        for package in metadata.distributions()
        for point in package.entry_points
        if point.group.startswith("mobman.")
    }
    libraries = tuple({sysconfig.get_path(key) for key in ("stdlib", "purelib", "platlib")})
    within, place = False, ""
    for frame, line in traceback.walk_tb(error.__traceback__):
        root = str(frame.f_globals.get("__name__")).partition(".")[0]
        file, name = frame.f_code.co_filename, frame.f_code.co_name
        if root == "mobman":
            within = True  # what called mobman has no part in it
        elif within and (root in plugins or not file.startswith((*libraries, "<"))):
            place = f"{file}, line {line}, in {name}"
    return f"error in {place}: {type(error).__name__}: {error}" if place else ""
