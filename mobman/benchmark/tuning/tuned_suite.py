"""The suite that compares a suite's own gains with tuned ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from mobman.benchmark.tuning.candidates import SUFFIX
from mobman.benchmark.tuning.declaration import Tuning
from mobman.benchmark.tuning.tuned_from import TunedFrom
from mobman.controllers.protocol import gains_by_field
from mobman.toml_model import validate

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite


def tuned_suite(
    suite: Suite,
    tuning: Tuning,
    found: Mapping[str, TunedFrom],
    gains: Mapping[str, Mapping[str, float]],
) -> Suite:
    """A suite with the entries of another one, and ``LABEL-tuned`` beside each that gained by tuning.

    Where a group or an override has gains for a label, they hold for its tuned one, too, but for
    those that were tuned.

    Args:
        suite: What was tuned.
        tuning: The budget, with everything that it was.
        found: What came of it, by label.
        gains: The tuned ones by label; none where nothing better was found.
    """
    content = suite.model_dump(mode="json", by_alias=True, exclude_unset=True)
    better = {label: own for label, own in gains.items() if own}
    entries: dict[str, Any] = {}
    for label, entry in content["controllers"].items():
        entries[label] = entry
        if label in better:
            law = entry["law"]
            own = {**gains_by_field(law, entry.get("gains", {})), **better[label]}
            entries[label + SUFFIX] = {"law": law, "gains": own, "tuned": _plain(found[label])}
        elif label in found:
            entries[label] = {**entry, "tuned": _plain(found[label])}
    written = {
        **content,
        "name": f"{suite.name}{SUFFIX}",
        "controllers": entries,
        "groups": [_group(suite, group, better) for group in content["groups"]],
        "overrides": [
            part
            for override in content.get("overrides", [])
            for part in _overrides(suite, override, better)
        ],
        "tuning": tuning.model_dump(mode="json", exclude_none=True),
    }
    if not written["overrides"]:
        del written["overrides"]
    return validate(type(suite), _given(written), f"suite {written['name']!r}")


def _given(value: Any) -> Any:
    """Without what is None, for which TOML has no word: it is the default."""
    if isinstance(value, dict):
        return {key: _given(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_given(item) for item in value]
    return value


def _plain(found: TunedFrom) -> dict[str, Any]:
    return found.model_dump(mode="json")


def _group(
    suite: Suite, group: Mapping[str, Any], better: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """A group with the tuned labels."""
    changed = deepcopy(dict(group))
    if "controllers" in group:
        changed["controllers"] = _with_tuned(suite, group["controllers"], better)
    own = changed.get("gains", {})
    for label in better:
        if rest := _untuned(suite, label, own.get(label, {}), better):
            own[label + SUFFIX] = rest
    return changed


def _overrides(
    suite: Suite, override: Mapping[str, Any], better: Mapping[str, Mapping[str, float]]
) -> list[dict[str, Any]]:
    """An override, for the tuned labels too; its gains for each of them in one of its own."""
    where = override["where"]
    patterns = where.get("controllers", ["*"])
    if not override.get("gains"):
        if "controllers" not in where:
            return [dict(override)]
        return [
            {**override, "where": {**where, "controllers": _with_tuned(suite, patterns, better)}}
        ]
    fitting = [label for label in suite.controllers if _fits(label, patterns)]
    if not any(label in better for label in fitting):
        return [dict(override)]
    own = [*fitting, *_of_grids(suite, patterns)]
    parts = [{**override, "where": {**where, "controllers": own}}]
    for label in (label for label in fitting if label in better):
        rest = {key: value for key, value in override.items() if key != "gains"}
        if left := _untuned(suite, label, override["gains"], better):
            rest["gains"] = left
        if rest.keys() - {"where"}:
            parts.append({**rest, "where": {**where, "controllers": [label + SUFFIX]}})
    return parts


def _with_tuned(suite: Suite, patterns: Sequence[str], better: Mapping[str, Any]) -> list[str]:
    """Patterns, and the tuned labels of what they fit, and of nothing else."""
    tuned = {label: label + SUFFIX for label in better}
    if any(_fits(name, patterns) and not _fits(label, patterns) for label, name in tuned.items()):
        named = [label for label in suite.controllers if _fits(label, patterns)]
        patterns = [*named, *_of_grids(suite, patterns)]
    own = [name for label, name in tuned.items() if _fits(label, patterns)]
    return [*patterns, *(name for name in own if not _fits(name, patterns))]


def _of_grids(suite: Suite, patterns: Sequence[str]) -> list[str]:
    """Patterns that fit no label, but members of one that has a grid."""
    return [
        pattern
        for pattern in patterns
        if not any(_fits(label, [pattern]) for label in suite.controllers)
    ]


def _untuned(
    suite: Suite,
    label: str,
    gains: Mapping[str, Any],
    better: Mapping[str, Mapping[str, float]],
) -> dict[str, Any]:
    """Gains without those that were tuned."""
    fields = gains_by_field(suite.controllers[label].law, gains)
    return {name: value for name, value in fields.items() if name not in better[label]}


def _fits(label: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(label, pattern) for pattern in patterns)
