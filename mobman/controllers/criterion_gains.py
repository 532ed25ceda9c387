"""The criterion F of a law: its gains, and what they make for a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mobman.controllers.gains import CheckedGains, Diagonal, Positive, diagonal, gain
from mobman.errors import GainError, MobmanError, UnknownNameError
from mobman.model.criterion import Posture, Sum, Term, criteria
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task
from mobman.toml_model import validate


@dataclass(frozen=True, kw_only=True)
class CriterionGains(CheckedGains):
    """Gains of the criterion."""

    c_F: Positive = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )
    criteria: Sequence[Mapping[str, Any]] = gain(
        (), "", "terms added to (12): tables of type, weight and the type's fields"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        terms(self.criteria)

    def criterion(self, robot: MobileManipulator, task: Task) -> Posture | Sum:
        """F of a law with these gains; see :func:`posture_criterion`."""
        return posture_criterion(robot, self.c_F, self.K_F, task, self.criteria)


def terms(given: Sequence[Mapping[str, Any]]) -> list[Term]:
    """The terms of ``criteria``.

    Raises:
        GainError: If one has an unknown type or a wrong field.
    """
    if not isinstance(given, list | tuple):
        raise GainError(f"criteria = {given!r}: must be a list of tables, each with a type")
    found = []
    for number, table in enumerate(given):
        origin = f"criteria[{number}]"
        fields = dict(table) if isinstance(table, Mapping) else {}
        kind = fields.pop("type", None)
        if not isinstance(kind, str):
            raise GainError(
                f"{origin} = {table!r}: must be a table with a type, one of "
                f"{', '.join(map(repr, criteria.names()))}, a weight, and the type's fields"
            )
        try:
            found.append(validate(criteria.get(kind), fields, origin))
        except UnknownNameError as error:
            raise GainError(f"{origin}: {error}") from error
        except MobmanError as error:
            raise GainError(str(error)) from error
    return found


def posture_criterion(
    robot: MobileManipulator,
    c_F: float = 1.0,
    K_F: Diagonal | None = None,
    task: Task | None = None,
    added: Sequence[Mapping[str, Any]] = (),
) -> Posture | Sum:
    """The criterion of a law: (12), and what is added to it.

    Args:
        robot: The nominal robot.
        c_F: Its factor.
        K_F: Diagonal of its weights; if None the task's ``criterion_weights(robot)`` where it has that
            method, else the robot's own. The robot's couplings stay.
        task: The task.
        added: Tables of the gain ``criteria``.

    Raises:
        GainError: If K_F has not one weight for each coordinate of q.
        UsageError: If a term means nothing for this robot.
    """
    own = getattr(task, "criterion_weights", None)
    if K_F is not None:
        weights = diagonal("K_F", K_F, robot.nq)
    else:
        weights = robot.criterion_weights if own is None else own(robot)
    posture = Posture(weights, robot.q_rest, c_F, robot.criterion_couplings)
    return Sum(posture, [term.on(robot) for term in terms(added)]) if added else posture
