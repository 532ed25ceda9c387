"""The gains in force, and where each comes from."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd

from mobman.benchmark.report.data import DONE, Results
from mobman.benchmark.report.format import UNDEFINED, count, listing, number, setting
from mobman.benchmark.report.tables import Entry, Table, label_entry, table_of
from mobman.benchmark.suite_tables import TunedFrom
from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import controllers
from mobman.errors import UnknownNameError

_ORIGINS = {"given": "Given", "auto": "Found automatically"}


class ControllerSettings(NamedTuple):
    """A label's law, what of it is not the default, and all of it."""

    label: str
    law: str
    remark: str
    table: Table | None  # None for a controller that does not report its settings


def settings_of(results: Results) -> list[ControllerSettings]:
    """List the settings of every label that has a run."""
    done = results.runs[results.runs.state == DONE]
    groups = done.cell.map(results.cells.group)
    found = []
    for label in results.labels:
        own = {
            g: runs
            for g in results.groups
            if len(runs := done[(done.label == label) & (groups == g)])
        }
        if own:
            item = _settings(label, own)
            if tuned := results.tuned.get(label):
                origin = f"Tuned from {tuned.label} in {count(tuned.trials, 'trial')}."
                item = item._replace(remark=f"{origin} {item.remark}")
            found.append(item)
    return found


def _settings(label: str, groups: Mapping[str, pd.DataFrame]) -> ControllerSettings:
    law = str(next(iter(groups.values())).law.iloc[0])
    names = dict.fromkeys(name for runs in groups.values() for own in runs.settings for name in own)
    if not names:
        return ControllerSettings(label, law, "It does not report its settings.", None)
    fields, defaults = _declared(law)
    rows, special = [], []
    for name in names:
        row: list[Entry | str] = [name]
        for group, own in groups.items():
            values = listing(list(dict.fromkeys(setting(s.get(name)) for s in own.settings)))
            origin = _origin(name, own.iloc[0], defaults)
            row.append(Entry(values, "best" if origin == "given" else "", unit=origin))
            special.append((origin, f"{name} = {values}", group))
        default = setting(defaults[name]) if name in defaults else UNDEFINED
        rows.append([*row, Entry(default, "faint"), *fields.get(name, ("", ""))])
    heads = [*map(Entry, groups), Entry("default")]
    heads += [Entry(name, number=False) for name in ("unit", "meaning")]
    table = table_of(f"{label}: settings in force", "gain", rows, *heads)
    return ControllerSettings(label, law, _remark(special, list(groups)), table)


def _origin(name: str, run: Any, defaults: dict[str, Any]) -> str:
    """Find the origin of a setting: "default", "given" or "auto"; empty if that is not known."""
    gains = {key.replace("_", ""): value for key, value in run.gains.items()}
    if gains.get(name.replace("_", ""), defaults.get(name)) == "auto":
        return "auto"
    if name.replace("_", "") in gains:
        return "given"
    return "default" if name in defaults else ""


def _remark(origins: Sequence[tuple[str, str, str]], groups: Sequence[str]) -> str:
    """In words: which settings are not defaults, and what "auto" became."""
    sentences = []
    for origin, words in _ORIGINS.items():
        where: dict[str, list[str]] = {}
        for group in groups:
            clause = ", ".join(text for kind, text, g in origins if (kind, g) == (origin, group))
            if clause:
                where.setdefault(clause, []).append(group)
        for clause, found in where.items():
            place = "" if len(found) == len(groups) else f" for {listing(found)}"
            sentences.append(f"{words}{place}: {clause}.")
    rest = "All others are the law's defaults." if sentences else "All are the law's defaults."
    return " ".join([*sentences, rest])


def _declared(law: str) -> tuple[dict[str, tuple[str, str]], dict[str, Any]]:
    """Units and meanings of a law's gains, and their defaults; empty for a law without a name."""
    try:
        gains = controllers.get(law).Gains
        defaults = as_settings(gains())
    except (UnknownNameError, AttributeError, TypeError):
        return {}, {}
    fields = {
        item.name: (item.metadata.get("unit", ""), item.metadata.get("meaning", ""))
        for item in dataclasses.fields(gains)
    }
    return fields, defaults


def tuning_table(tuned: Mapping[str, TunedFrom]) -> Table | None:
    """Show the budget of every tuned label, and what it brought; None if none was tuned."""
    rows = [
        (
            label_entry(label),
            item.label,
            str(item.trials),
            str(item.trial),
            item.objective,
            number(item.score_default),
            number(item.score),
            ", ".join(f"{k} {setting(v.low)} to {setting(v.high)}" for k, v in item.space.items()),
        )
        for label, item in tuned.items()
    ]
    columns = "tuned;gains of;#trials;#best trial;objective;#score before;#score after;ranges"
    caption = "Budget of tuning; trial 0 is the gains as they were"
    return table_of(caption, columns, rows) if rows else None


def unequal_budgets(tuned: Mapping[str, TunedFrom]) -> str:
    """Say so where controllers were tuned with different budgets; empty if all had the same."""
    trials: dict[tuple[int, str], list[str]] = {}
    for label, item in tuned.items():
        trials.setdefault((item.trials, item.objective), []).append(label)
    if len(trials) < 2:
        return ""
    parts = [f"{listing(labels)}: {n} trials for {what}" for (n, what), labels in trials.items()]
    return f"The budgets were not equal, so tuned gains are not comparable: {'; '.join(parts)}."
