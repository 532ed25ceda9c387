"""Reading a TOML file into a validated model, with every error at once and each naming its field."""

from __future__ import annotations

import os
import re
import shlex
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from mobman.arrays import SIZES, beyond_sizes
from mobman.errors import SpecError, UnknownNameError, UsageError
from mobman.files import read_input

_MEGABYTES = 1.0
_BRANCH = re.compile(r"int|float|str|constrained-.*|.*\[.*")
"""Names that pydantic gives the branches of a union, ``constrained-float`` say, which are no fields."""

M = TypeVar("M", bound=BaseModel)
Place = tuple[str | int, ...]
"""Names of tables and fields, and numbers in arrays, from the outermost on."""


class Strict(BaseModel):
    """Base of all descriptions: unknown fields are errors, values do not change once read."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Make one of a dictionary of its fields; SpecError with every field that is wrong."""
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            raise SpecError(f"{cls.__name__}: {describe(cls, error)}") from error

    @field_validator("*")
    @classmethod
    def _of_a_size(cls, value: Any) -> Any:
        if beyond_sizes(value):
            raise ValueError(f"must be {SIZES}")
        return value


def named_file(what: str, name_or_path: str | os.PathLike[str], files: Mapping[str, Path]) -> Path:
    """The file that a user's name, one of ``files``, or path means; what ends in ``.toml`` or has a
    separator is a path. ``what`` says in messages what the files describe. UnknownNameError if it is a
    name that is not there, UsageError if it is neither a name nor a path."""
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise UsageError(f"{name_or_path!r} is not a {what}: expected a name or a TOML file")
    text = os.fspath(name_or_path)
    if text in files:
        return files[text]
    if text.endswith(".toml") or os.sep in text:
        return Path(text)
    raise UnknownNameError(what, text, files)


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The content of a TOML file, at most 1 MB, in UTF-8; SpecError if it cannot be read or is not TOML,
    with the file, called ``what``, such as ``"robot file"``, and the line."""
    content = read_input(path, what, _MEGABYTES, "a description has a few kB")
    where = f"the {what} {path} is not valid TOML"
    try:
        text = content.decode("utf-8-sig")  # editors of some systems begin a file with a mark
        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise SpecError(
            f"{where}: byte 0x{content[error.start]:02x} in line {line} is not UTF-8; save it as UTF-8"
        ) from error
    except RecursionError as error:
        raise SpecError(f"{where}: arrays or tables are nested without end") from error
    except ValueError as error:  # TOMLDecodeError, and numbers that Python does not take
        advice = "; it looks like XML" if text.lstrip().startswith("<") else ""
        if advice and what == "robot file":
            advice += f": a URDF becomes a robot by: mobman robots add {shlex.quote(str(path))}"
        raise SpecError(f"{where}: {error}{advice}") from error


def validate(model: type[M], content: Any, origin: str, lines: TomlLines | None = None) -> M:
    """``content`` as ``model``; ``origin`` is what to call it in messages, usually the file. SpecError
    with a clause for each wrong field: its name, what was found, what is allowed; with ``lines`` of the
    file also its line."""
    try:
        made: M = model.__pydantic_validator__.validate_python(content)
        return made
    except ValidationError as error:
        clauses = _clauses(model, error)
        faults = clauses if lines is None else at_lines(clauses, lines)
        raise SpecError(f"{origin}: {'; '.join(faults)}", origin, list(faults)) from error


def describe(model: type[BaseModel], error: ValidationError) -> str:
    """All of a validation's errors in one line."""
    return "; ".join(_clauses(model, error))


def _clauses(model: type[BaseModel], error: ValidationError) -> dict[str, Place]:
    """A validation's errors, each with the place of its field."""
    clauses: dict[str, Place] = {}
    for item in error.errors():
        loc = [part for part in item["loc"] if not _BRANCH.fullmatch(str(part))]
        field = ".".join(map(str, loc))
        message = item["msg"].removeprefix("Value error, ")
        if item["type"] == "model_type":  # not by the name of a class, which no file has
            message = "must be a table"
        if not loc and item["type"] == "value_error":  # of several fields together
            clause = message
        elif item["type"] == "extra_forbidden":
            clause = f"field {field!r} is unknown; allowed beside it: {_siblings(model, item)}"
        elif item["type"] == "missing":
            clause = f"field {field!r} is missing"
        else:
            found = " ".join(repr(item["input"]).split())
            found = found if len(found) <= 60 else found[:57] + "..."
            clause = f"field {field or '(whole)'!r} is {found}: {message}"
        clauses.setdefault(clause, tuple(loc))
    return clauses


def _siblings(model: type[BaseModel], item: Any) -> str:
    """The names of the fields at the place of an unknown one."""

    def fields(of: Any) -> dict[str, Any]:
        own = getattr(of, "model_fields", {}).items()
        return {info.alias or name: info for name, info in own}

    current: Any = model
    for part in item["loc"][:-1]:
        if part in fields(current):
            current = _model_in(fields(current)[part].annotation)
    return ", ".join(name for name, info in fields(current).items() if not info.exclude) or "none"


def _model_in(annotation: Any) -> Any:
    """The description class inside an annotation such as ``list[X]`` or ``X | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    inside = map(_model_in, getattr(annotation, "__args__", ()))
    return next((found for found in inside if found is not None), None)


# Lines -------------------------------------------------------------------------------------------------

_KEY = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
_DOTTED = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_DOTTED})\s*\]")
_FIELD = re.compile(rf"\s*({_DOTTED})\s*=")


class TomlLines:
    """The lines of a valid TOML file on which its fields stand; a guess by its text, for messages."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._found: dict[Place, int] = {}
        counts: dict[Place, int] = {}
        table: Place = ()
        within = ""  # delimiter of a text over several lines
        for number, line in enumerate(self._lines, start=1):
            if within:
                within = "" if line.count(within) % 2 else within
                continue
            for delimiter in ('"""', "'''"):
                if line.count(delimiter) % 2:
                    within = delimiter
            if header := _HEADER.match(line):
                table = ()
                # with the numbers of the arrays that it goes through
                for part in _parts(header[2]):
                    table = (*table, *([counts[table]] if table in counts else []), part)
                if header[1] == "[[":
                    counts[table] = counts.get(table, -1) + 1
                    table = (*table, counts[table])
                self._found.setdefault(table, number)
            elif field := _FIELD.match(line):
                self._found.setdefault((*table, *_parts(field[1])), number)

    def line(self, place: Sequence[str | int], word: str = "") -> int | None:
        """The line of a field, or of the table that it would be in; None if that is the whole file. With
        a ``word`` of its value, the first line with that from there on, before the next table."""
        around = (self._found.get(tuple(place[:n])) for n in range(len(place), 0, -1))
        start = next((number for number in around if number is not None), None)
        if not word or start is None:
            return start
        for number in range(start, len(self._lines) + 1):
            line = self._lines[number - 1]
            if number > start and _HEADER.match(line):
                break
            if f'"{word}"' in line or f"'{word}'" in line:
                return number
        return start


def _parts(dotted: str) -> Place:
    return tuple(part.strip("\"'") for part in re.findall(_KEY, dotted))


def at_lines(
    faults: Mapping[str, Place], lines: TomlLines, words: Mapping[str, str] | None = None
) -> list[str]:
    """Faults in the order of the file, with the lines of their fields or of a word in these."""
    told = words or {}
    numbered = [(lines.line(at, told.get(fault, "")) or 0, fault) for fault, at in faults.items()]
    numbered.sort(key=lambda item: item[0])
    return [f"line {line}: {fault}" if line else fault for line, fault in numbered]
