"""Which robots there are: mobman's own, those registered by the user, and other packages'."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from mobman.errors import UnknownNameError, UsageError
from mobman.resources import resource_folder
from mobman.robots.spec import RobotSpec, read_spec
from mobman.toml_model import validate

_GROUP = "mobman.robots"
_registered: dict[str, RobotSpec] = {}


def list_robots() -> list[str]:
    """The names that :func:`load_robot` takes, sorted."""
    return sorted({*_own(), *_registered, *_plugins()})


def register_robot(spec_or_path: RobotSpec | Mapping[str, Any] | str | os.PathLike[str]) -> str:
    """Make a robot known under its name, for this process.

    Args:
        spec_or_path: A :class:`RobotSpec`, a dictionary of its fields, or a TOML file.

    Returns:
        The robot's name.

    Raises:
        SpecError: If the description is not valid.
    """
    spec = as_spec(spec_or_path)
    _registered[spec.name] = spec
    return spec.name


def as_spec(spec_or_path: RobotSpec | Mapping[str, Any] | str | os.PathLike[str]) -> RobotSpec:
    """A description from whatever form the user has it in; a string is a file's path."""
    if isinstance(spec_or_path, RobotSpec):
        return spec_or_path
    if isinstance(spec_or_path, Mapping):
        content = {"folder": Path.cwd(), **spec_or_path}
        return validate(RobotSpec, content, f"robot {spec_or_path.get('name', '')!r}")
    if not isinstance(spec_or_path, (str, os.PathLike)):
        raise UsageError(f"{spec_or_path!r} is no robot: give a description or a TOML file")
    return read_spec(Path(spec_or_path))


def find_spec(name_or_path: str | os.PathLike[str]) -> RobotSpec:
    """The description of a robot by name, or of a TOML file by path.

    Anything that ends in ``.toml`` or has a path separator is a path.

    Raises:
        UnknownNameError: If no robot has the name.
        SpecError: If the description is not valid.
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise UsageError(f"{name_or_path!r} is no robot: give a name or a TOML file")
    text = os.fspath(name_or_path)
    if text.endswith(".toml") or os.sep in text or not isinstance(name_or_path, str):
        return read_spec(Path(text))
    if text in _registered:
        return _registered[text]
    if text in (own := _own()):
        return read_spec(own[text])
    if text in (plugins := _plugins()) and (spec := _load_plugin(plugins[text])) is not None:
        return spec
    # a broken package's name is no choice
    raise UnknownNameError("robot", text, set(list_robots()) - {text})


def _own() -> dict[str, Path]:
    return {path.stem: path for path in sorted(resource_folder("robots").glob("*.toml"))}


def _plugins() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=_GROUP)}


def _load_plugin(point: EntryPoint) -> RobotSpec | None:
    try:
        found = point.load()
        return as_spec(found() if callable(found) else found)
    except Exception as error:  # another package's fault must not take mobman down
        warnings.warn(f"robot {point.name!r} of {point.value} is left out: {error}", stacklevel=3)
        return None
