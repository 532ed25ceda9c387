"""All checks on one robot."""

from __future__ import annotations

from collections.abc import Collection

from mobman.checks.check import Check, Finding, checks, list_checks
from mobman.checks.subject import Subject
from mobman.errors import FOREIGN_ERRORS
from mobman.model.mobile_manipulator import MobileManipulator


def run_checks(
    robot: MobileManipulator, *, simulation: bool = True, only: Collection[str] | None = None
) -> list[Finding]:
    """What every check finds on a robot, at least one finding each, in the order of their names.

    Args:
        robot: The robot.
        simulation: Whether to run the checks that need a closed loop, too.
        only: Names of the checks to run; all by default.

    Raises:
        UnknownNameError: If ``only`` has a name that is none of :func:`list_checks`.
    """
    subject = Subject(robot)
    found: list[Finding] = []
    chosen = list_checks() if only is None else [checks.get(name) for name in sorted(only)]
    for item in chosen:
        if simulation or not item.simulates:
            found += _findings(item, subject)
    return found


def _findings(item: Check, subject: Subject) -> list[Finding]:
    found: list[Finding] = []
    try:
        for remark in item.function(subject):
            found.append(Finding(item.name, *remark))
    except FOREIGN_ERRORS as error:  # what breaks one check must not hide what the others find
        text = " ".join(str(error).split()) or "no message"
        found.append(
            Finding(
                item.name,
                "wrong",
                f"the check ended with {type(error).__name__}: {text}",
                f"look at what it looks at ({item.meaning}); where nothing is wrong there, the check is",
            )
        )
    return found or [Finding(item.name, "ok", item.meaning, "")]
