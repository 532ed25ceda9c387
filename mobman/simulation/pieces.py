"""What a scenario is made of: pieces, each of a kind that is one file, with parameters of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.registry import Registry
from mobman.toml_model import Strict, validate

Each = float | Annotated[list[float], Field(min_length=1)]
"""A number for all, or a list with one for each."""


class Piece(Strict):
    """Base of the parameters of a kind: numbers are numbers, no text and no truth values."""

    model_config = ConfigDict(strict=True)


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
    kinds: ClassVar[Registry[Any]]

    type: str

    @model_validator(mode="after")
    def _valid(self) -> Self:
        piece = self.resolved()  # told when it is read, not when it is used
        fields = self.__pydantic_extra__
        if fields is not None:
            fields.clear()
            fields.update(piece.model_dump(mode="json", exclude_none=True))
        return self

    def resolved(self) -> Any:
        """The piece itself, of its type's class.

        Raises:
            UnknownNameError: If its type is unknown.
            SpecError: If one of its fields is wrong.
        """
        kind = self.kinds.get(self.type)
        return validate(kind, dict(self.__pydantic_extra__ or {}), f"{self.what} {self.type!r}")


def streams(sources: list[Any], random: np.random.Generator) -> list[np.random.Generator]:
    """A generator for each piece of a group.

    It depends on the run's seed, on the group and the type, and on how many of that type come before:
    so pieces of other types and groups may be added or left out without any change to the others.

    Args:
        sources: The group's :class:`Source`, in order.
        random: The run's generator; it is not drawn from.
    """
    root: Any = random.bit_generator.seed_seq
    counts: dict[str, int] = {}
    found = []
    for source in sources:
        position = counts[source.type] = counts.get(source.type, -1) + 1
        # the whole name, so that no two share a number
        name = int.from_bytes(f"{source.group}/{source.type}".encode(), "little")
        key = (*root.spawn_key, name, position)
        found.append(np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=key)))
    return found


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
    result: Array = (
        np.full(len(names), value, dtype=float)
        if not isinstance(value, list)
        else (np.asarray(value, dtype=float))
    )
    return result


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
