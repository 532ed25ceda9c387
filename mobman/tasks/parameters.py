"""Parameters of named tasks: declared where the task is made, checked before there is a robot."""

from __future__ import annotations

import difflib
import inspect
import sys
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from mobman.arrays import SIZES, beyond_sizes
from mobman.errors import UsageError

_NO_DEFAULT = inspect.Parameter.empty
_CONFIG = ConfigDict(strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
_POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def parameter(unit: str, meaning: str, **bounds: Any) -> Any:
    """What is said of a task's parameter in its annotation.

    Args:
        unit: Its unit, ``"1"`` if it has none.
        meaning: What it is.
        **bounds: What pydantic's ``Field`` takes: ``gt``, ``ge``, ``lt``, ``le``, ``min_length``, ...
    """
    return Field(description=meaning, json_schema_extra={"unit": unit}, **bounds)


def _not_zero(value: float | None) -> float | None:
    if value == 0.0:
        raise ValueError("must not be 0")
    return value


NOT_ZERO = AfterValidator(_not_zero)
"""Of a parameter that may be positive or negative."""


@dataclass(frozen=True)
class Parameter:
    """A parameter that a task takes."""

    name: str
    annotation: Any
    default: Any
    """As the factory's signature has it; None is by custom what the robot decides."""
    required: bool

    @property
    def unit(self) -> str:
        """As declared; empty if nothing is."""
        extra = self._declared.json_schema_extra
        return str(extra.get("unit", "")) if isinstance(extra, dict) else ""

    @property
    def meaning(self) -> str:
        """As declared; empty if nothing is."""
        return self._declared.description or ""

    @property
    def _declared(self) -> FieldInfo:
        declared = getattr(self.annotation, "__metadata__", ())
        return next((item for item in declared if isinstance(item, FieldInfo)), FieldInfo())


def declared_parameters(factory: Callable[..., Any]) -> dict[str, Parameter]:
    """The parameters of a task's factory: those of its signature after the robot and q0."""
    found = {}
    for item in _keywords(factory):
        if item.kind is not inspect.Parameter.VAR_KEYWORD:
            required = item.default is _NO_DEFAULT
            default = None if required else item.default
            found[item.name] = Parameter(item.name, _type_of(factory, item), default, required)
    return found


def check(task: str, factory: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """What is given to a factory, as its annotations say.

    Args:
        task: The task's name, for messages.
        factory: What makes it.
        given: Values by parameter.

    Raises:
        UsageError: With one clause for each that is unknown, missing, or no value that it may have.
    """
    allowed = declared_parameters(factory)
    anything = any(p.kind is inspect.Parameter.VAR_KEYWORD for p in _keywords(factory))
    problems, checked = [], {}
    for name, value in given.items():
        if name in allowed:
            try:
                checked[name] = _adapter(allowed[name].annotation).validate_python(value)
            except ValidationError as error:
                problems.append(_wrong(allowed[name], value, error))
                continue
            if beyond_sizes(checked[name]):
                problems.append(_refused(allowed[name], value, f"must be {SIZES}"))
        elif anything:
            checked[name] = value
        else:
            problems.append(_unknown(str(name), list(allowed)))
    problems += [
        f"parameter {name!r} is missing"
        for name, item in allowed.items()
        if item.required and name not in given
    ]
    if problems:
        raise UsageError(f"task {task!r}: " + "; ".join(problems))
    return checked


def _keywords(factory: Callable[..., Any]) -> list[inspect.Parameter]:
    try:
        everything = list(inspect.signature(factory).parameters.values())
    except (TypeError, ValueError):  # some callables of other languages have no signature
        return []
    leading = 0
    while leading < min(2, len(everything)) and everything[leading].kind in _POSITIONAL:
        leading += 1
    taken = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.VAR_POSITIONAL)
    return [item for item in everything[leading:] if item.kind not in taken]


def _type_of(factory: Callable[..., Any], item: inspect.Parameter) -> Any:
    if item.annotation is _NO_DEFAULT:
        return Any
    module = sys.modules.get(getattr(factory, "__module__", ""), None)
    names = getattr(factory, "__globals__", None) or vars(module or SimpleNamespace())
    alone = SimpleNamespace(__annotations__={item.name: item.annotation})
    try:
        return typing.get_type_hints(alone, names, include_extras=True)[item.name]
    except NameError:  # known to type checkers only
        return Any


def _adapter(annotation: Any) -> TypeAdapter[Any]:
    try:
        return TypeAdapter(annotation, config=_CONFIG)
    except TypeError:  # a type with rules of its own
        return TypeAdapter(annotation)


def _wrong(item: Parameter, value: Any, error: ValidationError) -> str:
    reasons = [
        reason["msg"].removeprefix("Value error, ")
        + "".join(f" (entry {part})" for part in reason["loc"] if isinstance(part, int))
        for reason in error.errors()
    ]
    return _refused(item, value, ", ".join(dict.fromkeys(reasons)))


def _refused(item: Parameter, value: Any, reason: str) -> str:
    text = repr(value)
    text = text if len(text) <= 60 else text[:57] + "..."
    unit = f" ({item.unit})" if item.unit not in ("", "1") else ""
    return f"parameter {item.name!r}{unit} is {text}: {reason}"


def _unknown(name: str, allowed: list[str]) -> str:
    near = difflib.get_close_matches(name, allowed, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"parameter {name!r} is unknown; {hint}allowed: {', '.join(allowed) or 'none'}"
