"""Reading a TOML file into a validated model, with every error at once and each naming its field."""

from __future__ import annotations

import os
import shlex
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from mobman.arrays import SIZES, beyond_sizes
from mobman.errors import SpecError, UnknownNameError, UsageError
from mobman.input_file import read_input
from mobman.toml_lines import Place, TomlLines

_MEGABYTES = 1.0


class Strict(BaseModel):
    """Base of all descriptions: unknown fields are errors, values do not change once read."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Make one of a dictionary of its fields.

        Raises:
            SpecError: With every field that is wrong.
        """
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


M = TypeVar("M", bound=BaseModel)


def named_file(what: str, name_or_path: str | os.PathLike[str], files: Mapping[str, Path]) -> Path:
    """The file that a name or a path means; what ends in ``.toml`` or has a separator is a path.

    Args:
        what: What the files describe, for messages.
        name_or_path: As the user gave it.
        files: Those that have names.

    Raises:
        UnknownNameError: If it is a name that is not there.
        UsageError: If it is neither a name nor a path.
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise UsageError(f"{name_or_path!r} is not a {what}: expected a name or a TOML file")
    text = os.fspath(name_or_path)
    if text in files:
        return files[text]
    if text.endswith(".toml") or os.sep in text:
        return Path(text)
    raise UnknownNameError(what, text, files)


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The content of a TOML file.

    Args:
        path: The file; at most 1 MB, in UTF-8.
        what: What it describes, for messages, such as ``"robot file"``.

    Raises:
        SpecError: If it cannot be read or is not TOML; the message names the file and the line.
    """
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
        advice = ""
        if text.lstrip().startswith("<"):
            advice = "; it looks like XML"
            if what == "robot file":
                advice += f": a URDF becomes a robot by: mobman robots add {shlex.quote(str(path))}"
        raise SpecError(f"{where}: {error}{advice}") from error


def validate(model: type[M], content: Any, origin: str, lines: TomlLines | None = None) -> M:
    """``content`` as ``model``.

    Args:
        model: The description's class.
        content: What was read or given.
        origin: What to call it in messages, usually the file.
        lines: Of the file, for messages with the line of each fault.

    Raises:
        SpecError: With one clause for each wrong field: its name, what was found, what is allowed.
    """
    try:
        made: M = model.__pydantic_validator__.validate_python(content)
        return made
    except ValidationError as error:
        clauses = _clauses(model, error)
        faults = clauses if lines is None else at_lines(clauses, lines)
        raise SpecError(f"{origin}: {'; '.join(faults)}", origin, list(faults)) from error
    except SpecError as error:
        raise SpecError(f"{origin}: {error}") from error


def at_lines(
    faults: Mapping[str, Place], lines: TomlLines, words: Mapping[str, str] | None = None
) -> list[str]:
    """Faults in the order of the file, with their lines.

    Args:
        faults: Each with the place of its field.
        lines: Of the file.
        words: Of a fault, a text of the field's value.
    """
    found = {
        fault: lines.line(place, (words or {}).get(fault, "")) for fault, place in faults.items()
    }
    numbered = [(line or 0, fault) for fault, line in found.items()]
    numbered.sort(key=lambda item: item[0])
    return [f"line {line}: {fault}" if line else fault for line, fault in numbered]


def describe(model: type[BaseModel], error: ValidationError) -> str:
    """All of a validation's errors in one line."""
    return "; ".join(_clauses(model, error))


def _clauses(model: type[BaseModel], error: ValidationError) -> dict[str, Place]:
    """A validation's errors, each with the place of its field."""
    clauses: dict[str, Place] = {}
    for item in error.errors():
        # the branches of a union ("float", "constrained-float", "list[float]") are no fields
        loc = [part for part in item["loc"] if str(part) not in ("int", "float", "str")]
        loc = [p for p in loc if "[" not in str(p) and not str(p).startswith("constrained-")]
        field = ".".join(str(part) for part in loc)
        message = item["msg"].removeprefix("Value error, ")
        if not loc and item["type"] == "value_error":  # of several fields together
            clause = message
        elif item["type"] == "extra_forbidden":
            clause = f"field {field!r} is unknown; allowed beside it: {_siblings(model, item)}"
        elif item["type"] == "missing":
            clause = f"field {field!r} is missing"
        else:
            found = repr(item["input"])
            found = found if len(found) <= 60 else found[:57] + "..."
            clause = f"field {field or '(whole)'!r} is {found}: {message}"
        clauses.setdefault(clause, tuple(loc))
    return clauses


def _siblings(model: type[BaseModel], item: Any) -> str:
    """The names of the fields at the place of an unknown one."""
    current: Any = model
    for part in item["loc"][:-1]:
        fields = getattr(current, "model_fields", {})
        by_name = {info.alias or name: info for name, info in fields.items()}
        if part in by_name:
            current = _model_in(by_name[part].annotation)
    fields = getattr(current, "model_fields", {})
    own = [info.alias or name for name, info in fields.items() if not info.exclude]
    return ", ".join(own) or "none"


def _model_in(annotation: Any) -> Any:
    """The description class inside an annotation such as ``list[X]`` or ``X | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_in(argument)
        if found is not None:
            return found
    return None
