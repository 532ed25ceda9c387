"""Pieces of a scenario: one protocol, with a registry of types for each group of pieces.

A type of piece is a class of parameters, a :class:`Piece`, whose method ``start`` gives what acts in one
run. It registers itself under a name in the registry of its group. Any module of ``mobman.simulation``
may do so, a new one too, and so may a script.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry
from mobman.toml_model import Strict, validate

PACKAGE = "mobman.simulation"
"""Whose modules are looked through for types of pieces."""

Each = float | Annotated[list[float], Field(min_length=1)]
"""A number for all, or a list with one for each."""
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class Setting:
    """The run in which a piece starts.

    Args:
        robot: The nominal robot; for a difference in inertias, the one to be changed.
        dt: Sampling period (s).
        random: Generator; each piece is given one of its own, from which all its randomness comes.
    """

    def __init__(self, robot: MobileManipulator, dt: float, random: np.random.Generator) -> None:
        self.robot, self.dt, self.random = robot, dt, random

    def with_random(self, random: np.random.Generator) -> Setting:
        """The same with another generator."""
        other = copy(self)
        other.random = random
        return other

    @cached_property
    def inertia(self) -> Array:
        """Effective inertia at each motor at ``q_rest`` (kg m^2, kg), shape (nz,)."""
        return self.robot.motor_inertia(self.robot.q_rest)


class Piece(Strict):
    """Base of the types: its fields are their parameters.

    Numbers are numbers, no text and no truth values.
    """

    model_config = ConfigDict(strict=True)

    def start(self, setting: Setting) -> Any:
        """Start one run: the effect, of the kind that the type's group needs; None if there is none.

        Raises:
            SpecError: If the piece does not fit the robot.
        """
        raise NotImplementedError


Types = Registry[type[Piece]]


class Source(Strict):
    """A piece as a scenario holds it: its type, and the type's own fields, which the type checks.

    Fields that were left out are there with their defaults once it is read, so that a stored scenario
    says all.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    group: ClassVar[str]
    """The scenario's field: what the pieces of one group have in common."""
    what: ClassVar[str]
    """One of them in messages."""
    kinds: ClassVar[Types]

    type: str

    @model_validator(mode="after")
    def _valid(self) -> Self:
        piece = self.resolved()  # reported when it is read, not when it is used
        fields = self.__pydantic_extra__
        if fields is not None:
            fields.clear()
            fields.update(piece.model_dump(mode="json", exclude_none=True))
        return self

    def resolved(self) -> Piece:
        """The piece itself, of its type's class.

        Raises:
            UnknownNameError: If its type is unknown.
            SpecError: If one of its fields is wrong.
        """
        kind = self.kinds.get(self.type)
        return validate(kind, dict(self.__pydantic_extra__ or {}), f"{self.what} {self.type!r}")


def started(sources: Sequence[Source], setting: Setting) -> list[Any]:
    """Start the pieces of a group: their effects, without those that do nothing.

    The generator of each depends on the run's seed, on the group and the type, and on how many of that
    type come before: pieces of other types and groups may be added or left out without any change to the
    others. The setting's own generator is not drawn from.

    Raises:
        SpecError: If a piece does not fit the robot; the message names it.
    """
    root: Any = setting.random.bit_generator.seed_seq
    counts: dict[str, int] = {}
    found = []
    for source in sources:
        position = counts[source.type] = counts.get(source.type, -1) + 1
        # the whole name, so that no two share a number
        name = int.from_bytes(f"{source.group}/{source.type}".encode(), "little")
        key = (*root.spawn_key, name, position)
        own = np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=key))
        try:
            found.append(source.resolved().start(setting.with_random(own)))
        except SpecError as error:
            raise SpecError(f"{source.what} {source.type!r}: {error}") from error
    return [effect for effect in found if effect is not None]


def entries(value: float | list[float], names: list[str], field: str, of: str = "entries") -> Array:
    """A number for all, or a list with one for each, as an array.

    Args:
        value: As a piece has it.
        names: Of what there is one for each.
        field: The piece's field, for messages.
        of: What they are, for messages.

    Raises:
        SpecError: If a list has another length.
    """
    if isinstance(value, list) and len(value) != len(names):
        raise SpecError(
            f"field {field!r} has {len(value)} entries; the robot has {len(names)} {of}: give one "
            f"number, or one for each of {', '.join(names)}"
        )
    return np.zeros(len(names)) + value


def some_given(fields: Mapping[str, Any], least: int = 1, most: int | None = None) -> None:
    """
    Raises:
        ValueError: If fewer or more of the fields than allowed are there.
    """
    given = [name for name, value in fields.items() if value is not None]
    most = len(fields) if most is None else most
    if not least <= len(given) <= most:
        choices = " or ".join(repr(name) for name in fields)
        one = "exactly one of" if least == most == 1 else "at least one of"
        raise ValueError(f"give {one} {choices}")
