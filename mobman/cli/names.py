"""``mobman controllers``, ``tasks``, ``scenarios`` and ``metrics``: what can be named, as registered."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any

import click
from click.shell_completion import CompletionItem

from mobman.cli.output import console, print_json, reports, table
from mobman.errors import FOREIGN_ERRORS

Facts = dict[str, Any]


def _summary(thing: Any) -> str:
    """The first paragraph of a docstring, in one line."""
    text = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    for markup, plain in ((r":\w+:`([^`]*)`", r"\1"), (r"\\dot (\w)", r"\1'"), (r"\\(\w)", r"\1")):
        text = re.sub(markup, plain, text)
    return text.replace("``", "").rstrip(":")


def _controllers() -> tuple[list[str], Callable[[str], Facts]]:
    from mobman.controllers.gains import as_settings
    from mobman.controllers.protocol import controllers

    def facts(name: str) -> Facts:
        law = controllers.get(name)
        kind = getattr(law, "Gains", None)
        try:
            defaults = {} if kind is None else as_settings(kind())
        except FOREIGN_ERRORS:  # another package's gains need not have defaults
            defaults = {}
        gains = [
            {
                "name": field.name,
                "default": defaults.get(field.name),
                "unit": field.metadata.get("unit", ""),
                "meaning": field.metadata.get("meaning", ""),
            }
            for field in ([] if kind is None else dataclasses.fields(kind))
        ]
        uses = list(getattr(law, "uses", ()))
        return {"name": name, "description": _summary(law), "uses": uses, "gains": gains}

    return list(controllers.every()), facts


def _tasks() -> tuple[list[str], Callable[[str], Facts]]:
    from mobman.tasks.task import parameters_of, tasks

    def facts(name: str) -> Facts:
        parameters = [
            {
                "name": item.name,
                "default": "(required)" if item.required else item.default,
                "unit": item.unit,
                "meaning": item.meaning,
            }
            for item in parameters_of(name)
        ]
        return {"name": name, "description": _summary(tasks.get(name)), "parameters": parameters}

    return list(tasks.every()), facts


def _scenarios() -> tuple[list[str], Callable[[str], Facts]]:
    from mobman.simulation.scenario import list_scenarios, load_scenario

    def facts(name: str) -> Facts:
        scenario = load_scenario(name)
        changes = scenario.model_dump(mode="json", exclude_defaults=True)
        about = {key: changes.pop(key, "") for key in ("name", "description")}
        return {**about, "changes": changes}

    return list_scenarios(), facts


def _metrics() -> tuple[list[str], Callable[[str], Facts]]:
    from mobman.simulation.metrics import metrics

    def facts(name: str) -> Facts:
        metric = metrics.get(name)
        keys = ("name", "description", "unit", "better", "section")
        return {key: getattr(metric, key) for key in keys}

    return list(metrics.every()), facts


_KINDS: Mapping[str, tuple[Callable[[], tuple[list[str], Callable[[str], Facts]]], str, str]] = {
    "controllers": (_controllers, "the control laws, or the gains of one", "--gain NAME=VALUE"),
    "tasks": (_tasks, "the tasks, or the parameters of one", "--task-option NAME=VALUE"),
    "scenarios": (_scenarios, "the scenarios, or what one (a name or a TOML file) changes", ""),
    "metrics": (_metrics, "the metrics of a run, or one", ""),
}


def _names(kind: str) -> list[str]:
    if kind == "robots":
        from mobman.robots.catalogue import list_robots

        return list_robots()
    if kind == "suites":
        from mobman.benchmark.suite import list_suites

        return list_suites()
    return _KINDS[kind][0]()[0]


def complete(kind: str) -> dict[str, Any]:
    """Options of click for an argument that a shell completes with the names of a kind, or with files
    where no name begins so."""

    def found(
        context: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        names = [name for name in _names(kind) if name.startswith(incomplete)]
        return [*map(CompletionItem, names)] or [CompletionItem(incomplete, type="file")]

    return {"shell_complete": found}


def _command(kind: str) -> click.Command:
    look, about, option = _KINDS[kind]

    @click.command(kind, help=f"List {about}." + (f" Given by {option}." if option else ""))
    @click.argument("name", required=False, **complete(kind))
    @reports
    def command(name: str | None, as_json: bool) -> None:
        names, facts = look()
        if name is not None:
            print_json(facts(name)) if as_json else _print(facts(name))
            return
        found = [facts(each) for each in names]
        if as_json:
            print_json(found)
            return
        heads = [head for head in ("unit", "better") if found and head in found[0]]
        rows = [  # of several sentences the first
            [
                item["name"],
                *(item[head] for head in heads),
                item["description"].partition(". ")[0].rstrip("."),
            ]
            for item in found
        ]
        # names are listed to be typed: they keep their middle where half of the width is enough
        shown = table(kind[:-1], *heads, "what it is", rows=rows, names={kind[:-1]}, share=2)
        console().print(shown)

    return command


def _print(facts: Facts) -> None:
    out = console()
    out.print(facts["name"], style="bold")
    out.print(facts["description"])
    rows = [
        (key, ", ".join(value) if isinstance(value, list) else value)
        for key, value in facts.items()
        if key not in ("name", "description", "gains", "parameters", "changes") and value
    ]
    out.print(table(rows=rows))
    for key in ("gains", "parameters"):
        if facts.get(key):
            heads = (key[:-1], "default", "unit", "meaning")
            rows_of = [[_plain(item[h]) for h in ("name", *heads[1:])] for item in facts[key]]
            out.print(table(*heads, rows=rows_of, names={heads[0]}))
    changes = facts.get("changes", {})
    out.print(table(rows=[(field, _plain(value)) for field, value in changes.items()]))


def _plain(value: Any) -> str:
    """A value for people; what the robot decides is None."""
    if value is None:
        return "by the robot"
    if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
        return "\n".join(map(_plain, value))
    if isinstance(value, dict):
        return ", ".join(f"{key} = {_plain(item)}" for key, item in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)


COMMANDS = [_command(kind) for kind in _KINDS]
