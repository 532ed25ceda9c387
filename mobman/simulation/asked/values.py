"""Dataclasses as plain values that JSON holds, and the way back: to the last bit, or not at all."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

_NUMBERS = re.compile(r"[<>|=]?[biuf][1248]")


class NotPlainError(Exception):
    """A value that a file cannot hold, or cannot be made of again."""


def as_plain(value: Any, allowed: Callable[[str], bool]) -> Any:
    """A value for JSON.

    Args:
        value: Numbers, text, lists, tuples, arrays, dictionaries and dataclasses of such.
        allowed: Whether classes of a module may be made again.

    Raises:
        NotPlainError: If it has something else in it; says what.
    """
    plain = _plain(value, allowed)
    # JSON itself may change it: keys that are numbers become text
    if _plain(from_plain(json.loads(json.dumps(plain)), allowed), allowed) != plain:
        raise NotPlainError(f"{type(value).__name__} does not come back from a file as it was")
    return plain


def _plain(value: Any, allowed: Callable[[str], bool]) -> Any:
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (np.bool_, np.integer, np.floating)):
        return value.item()
    if type(value) is list:
        return [_plain(item, allowed) for item in value]
    if type(value) is tuple:
        return {"tuple": [_plain(item, allowed) for item in value]}
    if type(value) is dict:
        return {"dict": {key: _plain(item, allowed) for key, item in value.items()}}
    if type(value) is np.ndarray and value.dtype.kind in "bif":
        return {"array": value.tolist(), "dtype": value.dtype.str}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        if not allowed(kind.__module__) or "<" in kind.__qualname__:
            raise NotPlainError(f"{kind.__name__} is no class that has a name in mobman")
        fields = {
            field.name: _plain(getattr(value, field.name), allowed)
            for field in dataclasses.fields(value)
            if field.init
        }
        return {"class": f"{kind.__module__}:{kind.__qualname__}", "fields": fields}
    raise NotPlainError(f"{type(value).__name__} is nothing that a file can hold")


def from_plain(plain: Any, allowed: Callable[[str], bool]) -> Any:
    """The value that :func:`as_plain` was given.

    Raises:
        NotPlainError: If a class may not be made, is not there, or refuses its fields.
    """
    if isinstance(plain, list):
        return [from_plain(item, allowed) for item in plain]
    if not isinstance(plain, dict):
        return plain
    if "tuple" in plain:
        return tuple(from_plain(item, allowed) for item in plain["tuple"])
    if "dict" in plain:
        return {key: from_plain(item, allowed) for key, item in plain["dict"].items()}
    if "array" in plain:
        if not _NUMBERS.fullmatch(str(plain["dtype"])):
            raise NotPlainError(f"{plain['dtype']!r} is no type of numbers")
        return np.array(plain["array"], dtype=plain["dtype"])
    kind = _class(str(plain.get("class")), allowed)
    fields = {name: from_plain(item, allowed) for name, item in plain["fields"].items()}
    try:
        return kind(**fields)
    except Exception as error:  # another package's class may raise anything
        raise NotPlainError(f"{kind.__name__} refuses its own fields: {error}") from error


def _class(name: str, allowed: Callable[[str], bool]) -> type[Any]:
    module, _, path = name.partition(":")
    # the name is from a file: nothing is imported for it that the registries do not know
    if not allowed(module):
        raise NotPlainError(f"{name!r} is no class of mobman or of a registered package")
    try:
        found: Any = sys.modules.get(module) or importlib.import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError) as error:
        raise NotPlainError(f"there is no class {name!r} here: {error}") from error
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise NotPlainError(f"{name!r} is no dataclass")
    if found.__module__ != module:
        raise NotPlainError(f"{name!r} is a class of {found.__module__}")
    return found
