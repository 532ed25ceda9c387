"""The report's first words, from its numbers alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from mobman.benchmark.report.cells import NOMINAL, Cell, Group, labels_of, unique
from mobman.benchmark.report.content import FailedRun, ReportedRun
from mobman.benchmark.report.format import count, listing, metric_value, number
from mobman.benchmark.report.tables import successes, worst_error

_SPACE = "\u00a0"  # holds a number and its unit together
_ENDINGS = {"diverged": "diverged", "singular": "ended at a singularity"}
_PRICES = {
    "compute_time_median": "median control step",
    "torque_energy": "integral of |v|²",
    "torque_peak": "largest torque",
}


def summary_lines(
    groups: Sequence[Group], runs: Sequence[ReportedRun], failures: Sequence[FailedRun]
) -> list[str]:
    """Sentences on what came out, good and bad, for every controller alike."""
    if not runs and not failures:
        return ["There is no run to report."]
    lines = [_counts(groups, runs, failures), _successes(groups, labels_of(runs, failures))]
    lines += _losses(runs, failures)
    for group in groups:
        lines += [line for line in (_nominal(group), _over_scenarios(group)) if line]
    return lines + _prices(groups)


def _counts(
    groups: Sequence[Group], runs: Sequence[ReportedRun], failures: Sequence[FailedRun]
) -> str:
    labels = len(labels_of(runs, failures))
    cells = sum(len(group.cells) for group in groups)
    seeds = len(unique([run.record.seed for run in runs] + [f.seed for f in failures]))
    return (
        f"{count(len(runs) + len(failures), 'run')}: {count(labels, 'controller')} in "
        f"{count(cells, 'cell')} (robot, task and scenario), {count(seeds, 'seed')}. A run succeeds "
        "if it goes to its end and |e^e| stays below 1e-4 m from some time on."
    )


def _successes(groups: Sequence[Group], labels: Sequence[str]) -> str:
    cells = [cell for group in groups for cell in group.cells]
    score = {label: successes(cells, label) for label in labels}
    shares = []
    for won, asked in sorted(set(score.values()), key=lambda s: -s[0] / max(s[1], 1)):
        names = [label for label in labels if score[label] == (won, asked)]
        share = "none" if won == 0 else "all" if won == asked else f"{won}"
        shares.append(f"{listing(names)} in {share} of {asked}")
    return f"Success: {'; '.join(shares)}."


def _losses(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[str]:
    lines = []
    for status in unique([run.record.status for run in runs if not run.record.ok]):
        ended = [run for run in runs if run.record.status == status]
        by_label = [
            f"{label} ({sum(run.label == label for run in ended)})"
            for label in unique([run.label for run in ended])
        ]
        how = _ENDINGS.get(status, f"ended early ({status})")
        lines.append(f"{count(len(ended), 'run')} {how}: {listing(by_label)}.")
    if failures:
        lines.append(
            f"{count(len(failures), 'run')} gave no result by a fault of the software, and is "
            "counted as not succeeded."
            if len(failures) == 1
            else f"{len(failures)} runs gave no result by a fault of the software, and are counted as "
            "not succeeded."
        )
    return lines


def _nominal(group: Group) -> str:
    """Best and worst where the plant is what controllers suppose."""
    cell = next((cell for cell in group.cells if cell.scenario == NOMINAL), None)
    errors = {} if cell is None else _errors(cell, group.labels)
    if len(errors) < 2:
        return ""
    return f"{group.name}, nominal: {_extremes(errors)}."


def _over_scenarios(group: Group) -> str:
    """Best and worst of the worst cases."""
    if len(group.cells) < 2:
        return ""
    worst: dict[str, float] = {}
    where: dict[str, str] = {}
    for label in group.labels:
        errors = [(found[label], cell) for cell in group.cells if (found := _errors(cell, [label]))]
        worst[label], cell = max(errors, key=lambda item: item[0])
        where[label] = cell.scenario
    notes = {label: f", {where[label]}" for label in group.labels}
    if not any(math.isfinite(value) for value in worst.values()):
        return f"{group.name}: no controller completes every scenario."
    return f"{group.name}, worst of {len(group.cells)} scenarios: {_extremes(worst, notes)}."


def _errors(cell: Cell, labels: Sequence[str]) -> dict[str, float]:
    return {
        label: math.inf if cell.failures_of(label) else worst_error(cell.of(label))
        for label in labels
        if cell.of(label) or cell.failures_of(label)
    }


def _extremes(errors: Mapping[str, float], notes: Mapping[str, str] | None = None) -> str:
    """ "smallest steady |e^e| with a (1e-9 m), largest with b (0.2 m); c does not finish"."""
    notes = notes or {}
    finite = {label: value for label, value in errors.items() if math.isfinite(value)}
    parts = []
    if finite:
        parts.append(f"smallest steady |e^e| with {_with(finite, min(finite.values()), notes)}")
    if len(finite) > 1 and number(max(finite.values())) != number(min(finite.values())):
        parts[-1] += f", largest with {_with(finite, max(finite.values()), notes)}"
    lost = [label for label in errors if label not in finite]
    if lost:
        verb = "does" if len(lost) == 1 else "do"
        parts.append(f"{listing(lost)} {verb} not finish")
    return "; ".join(parts)


def _with(values: Mapping[str, float], value: float, notes: Mapping[str, str]) -> str:
    """Those that have a value to all digits shown, and the value."""
    names = [label for label, other in values.items() if number(other) == number(value)]
    return f"{listing(names)} ({number(value)}{_SPACE}m{notes.get(names[0], '')})"


def _prices(groups: Sequence[Group]) -> list[str]:
    """What success costs, in computing time and in torque."""
    lines = []
    for group in groups:
        cell = next((cell for cell in group.cells if cell.scenario == NOMINAL), None)
        if cell is None:
            continue
        won = [run for run in cell.first_seed if run.succeeded]
        if len(won) < 2:
            continue
        ranges = [(name, what, *_range(won, name)) for name, what in _PRICES.items()]
        parts = [
            f"{what} {_spread(name, low, high)}"
            for name, what, low, high in ranges
            if math.isfinite(low.record.metrics.get(name, math.nan))
        ]
        if parts:
            lines.append(f"{group.name}, nominal, cost of success: {'; '.join(parts)}.")
    return lines


def _range(runs: Sequence[ReportedRun], name: str) -> tuple[ReportedRun, ReportedRun]:
    def value(run: ReportedRun) -> float:
        return run.record.metrics.get(name, math.nan)

    return min(runs, key=value), max(runs, key=value)


def _spread(name: str, low: ReportedRun, high: ReportedRun) -> str:
    unit = _SPACE + "µs" if name == "compute_time_median" else ""
    least, most = (metric_value(name, run.record.metrics[name]) + unit for run in (low, high))
    if least == most:
        return f"{least} for all"
    return f"{least} ({low.label}) to {most} ({high.label})"
