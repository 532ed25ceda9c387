"""``mobman controllers``, ``tasks``, ``scenarios`` and ``metrics``: what can be named, as registered."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable
from typing import Any

import click

from mobman.cli.options import complete, names_of, reports
from mobman.cli.output import console, report, table
from mobman.errors import FOREIGN_ERRORS

Facts = dict[str, Any]


def _summary(thing: Any) -> str:
    """The first paragraph of a docstring, in one line."""
    text = " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split())
    for markup, plain in ((r":\w+:`([^`]*)`", r"\1"), (r"\\dot (\w)", r"\1'"), (r"\\(\w)", r"\1")):
        text = re.sub(markup, plain, text)
    return text.replace("``", "").rstrip(":")


def _controller(name: str) -> Facts:
    from mobman.controllers.gains import as_settings
    from mobman.controllers.protocol import controllers

    law = controllers.get(name)
    kind = getattr(law, "Gains", None)
    try:
        defaults = {} if kind is None else as_settings(kind())
    except FOREIGN_ERRORS:  # another package's gains need not have defaults
        defaults = {}
    gains = []
    for field in () if kind is None else dataclasses.fields(kind):
        about = {key: field.metadata.get(key, "") for key in ("unit", "meaning")}
        gains.append({"name": field.name, "default": defaults.get(field.name), **about})
    uses = list(getattr(law, "uses", ()))
    return {"name": name, "description": _summary(law), "uses": uses, "gains": gains}


def _task(name: str) -> Facts:
    from mobman.tasks.task import parameters_of, tasks

    parameters = []
    for item in parameters_of(name):
        default = "(required)" if item.required else item.default
        about = {"default": default, "unit": item.unit, "meaning": item.meaning}
        parameters.append({"name": item.name, **about})
    return {"name": name, "description": _summary(tasks.get(name)), "parameters": parameters}


def _scenario(name: str) -> Facts:

    from mobman.simulation.scenario import load_scenario

    changes = load_scenario(name).model_dump(mode="json", exclude_defaults=True)
    about = {key: changes.pop(key, "") for key in ("name", "description")}
    return {**about, "changes": changes}


def _metric(name: str) -> Facts:
    from mobman.simulation.metrics import metrics

    keys = ("name", "description", "unit", "better", "section")
    return {key: getattr(metrics.get(name), key) for key in keys}


def _command(kind: str, facts: Callable[[str], Facts], about: str) -> click.Command:
    @click.command(kind, help=f"List {about}")
    @click.argument("name", required=False, **complete(kind))
    @reports
    def command(name: str | None) -> None:
        found = [facts(each) for each in (names_of(kind) if name is None else [name])]
        report(found if name is None else found[0])
        if name is not None:
            _print(found[0])
        else:
            heads = [head for head in ("unit", "better") if found and head in found[0]]
            rows = []
            for item in found:  # of several sentences the first
                what = item["description"].partition(". ")[0].rstrip(".")
                rows.append([item["name"], *(item[head] for head in heads), what])
            # names are listed to be typed: they keep their middle where half of the width is enough
            one = kind[:-1]
            console().print(table(one, *heads, "what it is", rows=rows, names={one}, share=2))

    return command


def _print(facts: Facts) -> None:
    out = console()
    out.print(facts["name"], style="bold")
    out.print(facts["description"])
    apart = ("name", "description", "gains", "parameters", "changes")
    rows = [
        (key, ", ".join(value) if isinstance(value, list) else value)
        for key, value in facts.items()
        if key not in apart and value
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


_LAWS = "the control laws, or the gains of one. Given by --gain NAME=VALUE."
_TASKS = "the tasks, or the parameters of one. Given by --task-option NAME=VALUE."
_SCENARIOS = "the scenarios, or what one (a name or a TOML file) changes."
COMMANDS = [
    _command("controllers", _controller, _LAWS),
    _command("tasks", _task, _TASKS),
    _command("scenarios", _scenario, _SCENARIOS),
    _command("metrics", _metric, "the metrics of a run, or one."),
]
