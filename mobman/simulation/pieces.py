"""Pieces of a scenario: one protocol, with a registry of types for each group of pieces.

A type of piece is a class of parameters, a :class:`Piece`, whose method ``start`` gives what acts in one
run. It registers itself under a name in the registry of its group. Any module of ``mobman.simulation``
may do so, a new one too, and so may a script.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, PrivateAttr

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry
from mobman.toml_model import Strict


class Setting:
    """The run in which a piece starts.

    Args:
        robot: The nominal robot; for a difference in inertias, the one to be changed.
        dt: Sampling period (s).
        random: Generator; each piece is given one of its own, from which all its randomness comes.
    """

    def __init__(self, robot: MobileManipulator, dt: float, random: np.random.Generator) -> None:
        self.robot, self.dt, self.random = robot, dt, random

    @cached_property
    def inertia(self) -> Array:
        """Effective inertia at each motor at ``q_rest`` (kg m^2, kg), shape (nz,)."""
        return self.robot.motor_inertia(self.robot.q_rest)

    def of_piece(self, name: str, position: int) -> Setting:
        """The setting of a piece by the name of its group and type, so many of which come before.

        Its generator depends on the run's seed, on the name and on that number: pieces of other types
        and groups may be added or left out without any change to the others. This setting's own
        generator is not drawn from.
        """
        root: Any = self.random.bit_generator.seed_seq
        # the whole name, so that no two share a number
        key = (*root.spawn_key, int.from_bytes(name.encode(), "little"), position)
        own = np.random.SeedSequence(root.entropy, spawn_key=key)
        return Setting(self.robot, self.dt, np.random.default_rng(own))


class Piece(Strict):
    """Base of the types: its fields are their parameters.

    Numbers are numbers, no text and no truth values.
    """

    model_config = ConfigDict(strict=True)
    _type: str = PrivateAttr("")

    @property
    def type(self) -> str:
        """The name by which a scenario has its type; empty for one that was made in Python."""
        return self._type

    def of_type(self, name: str) -> Self:
        """The piece itself, as one of a type of this name."""
        self._type = name
        return self

    def start(self, setting: Setting) -> Any:
        """Start one run: the effect, of the kind that the type's group needs; None if there is none.

        Raises:
            SpecError: If the piece does not fit the robot.
        """
        raise NotImplementedError


P = TypeVar("P", bound=Piece)
Types = Registry[type[Piece]]


def types_of(kind: str, group: str | None = None) -> Types:
    """A registry of types, which any module here may add to: what one is called, and the entry points of
    other packages."""
    return Types(kind, "mobman.simulation", group)


# Fields -----------------------------------------------------------------------------------------------


def checked(message: str, zero: bool = False) -> AfterValidator:
    """Validator that refuses what is below 0, in a list too, and 0 itself unless ``zero``."""

    def check(value: Any) -> Any:
        if np.min(value) < 0.0 or (np.min(value) == 0.0 and not zero):
            raise ValueError(message)
        return value

    return AfterValidator(check)


Each = float | Annotated[list[float], Field(min_length=1)]
"""A number for all, or a list with one for each."""
EachPositive = Annotated[Each, checked("must be above 0")]
Factor = Annotated[float, Field(gt=0)]
Spread = Annotated[float, Field(ge=0, lt=1)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


def entries(value: float | list[float], names: list[str], field: str, of: str) -> Array:
    """A field's number for all, or list with one for each of the names, as an array; SpecError if a list
    has another length, where ``of`` says of what there is one for each."""
    if isinstance(value, list) and len(value) != len(names):
        raise SpecError(
            f"field {field!r} has {len(value)} entries; the robot has {len(names)} {of}: give one "
            f"number, or one for each of {', '.join(names)}"
        )
    return np.zeros(len(names)) + value


def some_given(piece: P, *names: str, most: int = 9) -> P:
    """The piece, if one of the fields is there, and no more than so many of them; else ValueError."""
    if not 1 <= sum(getattr(piece, name) is not None for name in names) <= most:
        one = "exactly one of" if most == 1 else "at least one of"
        raise ValueError(f"give {one} {' or '.join(map(repr, names))}")
    return piece
