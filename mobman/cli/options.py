"""Shared by the sub-commands: options, their types, and names that shells complete."""

from __future__ import annotations

from collections.abc import Callable, Collection
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from mobman.errors import UsageError

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)
PATH = click.Path(path_type=Path)
PORT = click.IntRange(0, 65535)
COUNT = click.IntRange(min=1)
POSITIVE = click.FloatRange(min=0, min_open=True)
FORCE = click.option("--force", is_flag=True, help="Replace a file that is there.")
_LEVEL, _JSON = "mobman.cli.level", "mobman.cli.json"


def _set_level(context: click.Context, parameter: click.Parameter, given: bool) -> None:
    if given:
        context.meta[_LEVEL] = -1 if parameter.name == "quiet" else 1


def _set_json(context: click.Context, parameter: click.Parameter, given: bool) -> None:
    context.meta[_JSON] = given


def reports(command: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator: the options --json, see :func:`wants_json`, and -q and -v, see :func:`level`."""
    flag: dict[str, Any] = {"is_flag": True, "expose_value": False}
    more = "Print more, and the traceback of an internal error."
    command = click.option("-v", "--verbose", help=more, callback=_set_level, **flag)(command)
    less = "Print errors alone, and what --json asks for."
    command = click.option("-q", "--quiet", help=less, callback=_set_level, **flag)(command)
    return click.option("--json", help="Print JSON.", callback=_set_json, **flag)(command)


def level(context: click.Context | None = None) -> int:
    """Amount that a command prints: -1 errors alone, 0 as usual, 1 more."""
    context = context or click.get_current_context(silent=True)
    found: int = 0 if context is None else context.meta.get(_LEVEL, 0)
    return found


def wants_json() -> bool:
    """True if the running command is to print JSON alone."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(_JSON))


def check_new(path: Path | None, *, suffixes: Collection[str], force: bool) -> None:
    """Refuse a file to write, if there is one, before anything is computed: UsageError if its suffix, in
    small letters, is another, or if it is there already and may not be replaced."""
    if path is not None and path.suffix.lower() not in suffixes:
        raise UsageError(f"-o {str(path)!r} does not end in {' or '.join(sorted(suffixes))}")
    if path is not None and path.exists() and not force:
        raise UsageError(f"{path} is there already; choose another name, or add --force")


_MODULES = {
    "controllers": "mobman.controllers.protocol",
    "tasks": "mobman.tasks.task",
    "scenarios": "mobman.simulation.scenario",
    "metrics": "mobman.simulation.metrics",
    "robots": "mobman.robots.catalogue",
    "suites": "mobman.benchmark.suite",
}
"""Modules that have a registry of what a word means, or a function that lists it, loaded when asked."""


def names_of(kind: str) -> list[str]:
    """All names of a kind; of a registry those that can be loaded."""
    module = import_module(_MODULES[kind])
    if registry := getattr(module, kind, None):
        return list(registry.every())
    found: list[str] = getattr(module, f"list_{kind}")()
    return found


def complete(kind: str) -> dict[str, Any]:
    """Options of click for an argument that a shell completes with names of a kind, or else files."""

    def found(
        context: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        names = [name for name in names_of(kind) if name.startswith(incomplete)]
        return [*map(CompletionItem, names)] or [CompletionItem(incomplete, type="file")]

    return {"shell_complete": found}
