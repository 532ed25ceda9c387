"""The gains in force, and where each comes from."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mobman.benchmark.report.cells import Group, unique
from mobman.benchmark.report.content import ReportedRun
from mobman.benchmark.report.format import UNDEFINED, count, listing, number, setting
from mobman.benchmark.report.table import Entry, Row, Table, text
from mobman.controllers.gains import as_settings
from mobman.controllers.protocol import controllers
from mobman.errors import UnknownNameError

_AUTO = "auto"
_ORIGINS = {
    "given": "Given",
    _AUTO: "Found automatically",
    "auto or given": "Found automatically or given",
}


@dataclass(frozen=True)
class ControllerSettings:
    """A label's law, what of it is not the default, and all of it."""

    label: str
    law: str
    remark: str
    table: Table | None
    """None for a controller that does not tell its settings."""


def settings_of(
    groups: Sequence[Group], tuned: Mapping[str, Mapping[str, Any]] | None = None
) -> list[ControllerSettings]:
    """The settings of every label that has a run.

    Args:
        groups: The runs.
        tuned: By label, how its gains were tuned; see :class:`ReportedSuite`.
    """
    labels = unique([label for group in groups for label in group.labels])
    found = [item for label in labels if (item := _settings(label, groups)) is not None]
    return [
        dataclasses.replace(item, remark=f"{_origin_of_tuned(tuned[item.label])} {item.remark}")
        if tuned and item.label in tuned
        else item
        for item in found
    ]


def tuning_table(tuned: Mapping[str, Mapping[str, Any]]) -> Table | None:
    """The budget of every tuned label, and what it brought; None if none was tuned."""
    if not tuned:
        return None
    rows = []
    for label, item in tuned.items():
        space = item.get("space") or {}
        rows.append(
            Row(
                text(label, label=label),
                [
                    text(str(item.get("label", UNDEFINED))),
                    Entry(str(item.get("trials", UNDEFINED))),
                    Entry(str(item.get("trial", UNDEFINED))),
                    text(str(item.get("objective", UNDEFINED))),
                    Entry(_score(item.get("score_default"))),
                    Entry(_score(item.get("score"))),
                    text(", ".join(f"{name} {_range(value)}" for name, value in space.items())),
                ],
            )
        )
    columns = [
        text("tuned"),
        text("gains of"),
        Entry("trials"),
        Entry("best trial"),
        text("objective"),
        Entry("score before"),
        Entry("score after"),
        text("ranges"),
    ]
    return Table("Budget of tuning; trial 0 is the gains as they were", columns, rows)


def unequal_budgets(tuned: Mapping[str, Mapping[str, Any]]) -> str:
    """Says so where controllers were tuned with different budgets; empty if all had the same."""
    trials: dict[Any, list[str]] = {}
    for label, item in tuned.items():
        trials.setdefault((item.get("trials"), item.get("objective")), []).append(label)
    if len(trials) < 2:
        return ""
    parts = [f"{listing(labels)}: {n} trials for {what}" for (n, what), labels in trials.items()]
    return f"The budgets were not equal, so tuned gains are not comparable: {'; '.join(parts)}."


def _origin_of_tuned(item: Mapping[str, Any]) -> str:
    trials = item.get("trials")
    budget = f" in {count(int(trials), 'trial')}" if isinstance(trials, int) else ""
    return f"Tuned from {item.get('label', 'another')}{budget}."


def _score(value: Any) -> str:
    return number(float(value)) if isinstance(value, (int, float)) else UNDEFINED


def _range(value: Any) -> str:
    if isinstance(value, Mapping):
        low, high = value.get("low"), value.get("high")
        if low is not None and high is not None:
            return f"{setting(low)} to {setting(high)}"
        return ", ".join(f"{key} {setting(item)}" for key, item in value.items())
    return setting(value)


def _settings(label: str, groups: Sequence[Group]) -> ControllerSettings | None:
    columns = {
        group.name: runs
        for group in groups
        if (runs := [run for cell in group.cells for run in cell.of(label)])
    }
    if not columns:
        return None
    runs = [run for found in columns.values() for run in found]
    law = runs[0].law
    names = unique([name for run in runs for name in run.settings])
    if not names:
        return ControllerSettings(label, law, "It does not tell its settings.", None)
    fields, defaults = _declared(law)
    rows, special = [], []
    for name in names:
        entries = []
        for group, found in columns.items():
            entry, origin = _entry(name, found, defaults)
            entries.append(entry)
            if origin and origin != "default":
                special.append((origin, f"{name} = {entry.text}", group))
        default = setting(defaults[name]) if name in defaults else UNDEFINED
        unit, meaning = fields.get(name, ("", ""))
        more = [Entry(default, "faint"), text(unit), text(meaning)]
        rows.append(Row(text(name), [*entries, *more]))
    heads = [text("gain"), *map(Entry, columns), Entry("default"), text("unit"), text("meaning")]
    table = Table(f"{label}: settings in force", heads, rows)
    return ControllerSettings(label, law, _remark(special, list(columns)), table)


def _entry(name: str, runs: Sequence[ReportedRun], defaults: dict[str, Any]) -> tuple[Entry, str]:
    values = unique([setting(run.settings.get(name)) for run in runs])
    origin = _origin(name, runs[0], defaults)
    return Entry(listing(values), "best" if origin == "given" else "", unit=origin), origin


def _origin(name: str, run: ReportedRun, defaults: dict[str, Any]) -> str:
    """Where a setting comes from: "default", "given" or "auto"; empty if that is not known."""
    if run.gains is not None:
        given = {key.replace("_", ""): value for key, value in run.gains.items()}
        plain = name.replace("_", "")
        if plain in given and given[plain] != _AUTO:
            return "given"
        if plain in given or defaults.get(name) == _AUTO:
            return _AUTO
        return "default" if name in defaults else ""
    if name not in defaults:
        return ""
    if run.settings.get(name) == defaults[name]:
        return "default"
    # a number where the default is "auto" may be either
    return "auto or given" if defaults[name] == _AUTO else "given"


def _remark(special: Sequence[tuple[str, str, str]], groups: Sequence[str]) -> str:
    """In words: which settings are not defaults, and what "auto" became."""
    sentences = []
    for origin, words in _ORIGINS.items():
        clauses = []
        for group in groups:
            found = [clause for kind, clause, other in special if (kind, other) == (origin, group)]
            if found:
                clauses.append((", ".join(found), group))
        for clause in unique([clause for clause, _ in clauses]):
            where = [group for other, group in clauses if other == clause]
            place = "" if len(where) == len(groups) else f" for {listing(where)}"
            sentences.append(f"{words}{place}: {clause}.")
    rest = "All others are the law's defaults." if special else "All are the law's defaults."
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
