"""The report's first words, from its numbers alone."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from mobman.benchmark.report.cells import NOMINAL, CellRuns, Group, labels_of, unique
from mobman.benchmark.report.content import FailedRun, ReportedRun
from mobman.benchmark.report.format import count, listing, metric_value, number
from mobman.benchmark.report.leaderboard import Leaderboard, Standing
from mobman.benchmark.report.scores import Field, cell_error
from mobman.benchmark.report.tables import successes

_SPACE = "\u00a0"  # holds a number and its unit together
_ENDINGS = {"diverged": "diverged", "singular": "ended at a singularity"}
_PRICES = {
    "compute_time_median": "median control step",
    "torque_energy": "integral of |v|²",
    "torque_peak": "largest torque",
}


_MOST_LINES = 10
"""Of a summary, whatever the suite's size."""
_FEW = 3  # robots and tasks that each get sentences of their own, as far as there is room
_MOST_NAMES = 5  # scenario families, or controllers, that are named in a sentence


def summary_lines(
    groups: Sequence[Group],
    runs: Sequence[ReportedRun],
    failures: Sequence[FailedRun],
    field: Field,
    board: Leaderboard,
    tuned: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[str]:
    """Sentences on what came out, good and bad, for every controller alike; about ten.

    Args:
        groups: The runs.
        runs: The same, in the suite's order.
        failures: Runs without a result.
        field: What is compared.
        board: The standings.
        tuned: By label, how its gains were tuned.
    """
    if not runs and not failures:
        return ["There is no run to report."]
    lines = [_counts(groups, runs, failures)]
    lines += _pending(failures, field)
    lines += _leader(field, board)
    lines += _tuned(board, tuned or {})
    lines.append(_successes(groups, runs, failures))
    lines += _losses(runs, failures)
    if len(groups) > _FEW:
        return lines
    nominal = [line for group in groups if (line := _nominal(group))]
    worst = [line for group in groups if (line := _over_scenarios(group))]
    for more in (nominal, worst, _prices(groups)):
        if len(lines) + len(more) <= _MOST_LINES:
            lines += more
    return lines


def _pending(failures: Sequence[FailedRun], field: Field) -> list[str]:
    """What was not done yet, which is not to be mistaken for what failed."""
    pending = sum(failure.pending for failure in failures)
    if not pending:
        return []
    verb = "was" if pending == 1 else "were"
    compared = (
        f"only the {count(len(field.cells), 'cell')} in which all were tried are compared, and these "
        "need not be like the others"
    )
    if not field.cells:
        compared = "there is no cell yet in which all were tried, so nothing is compared"
    return [f"Preliminary: {count(pending, 'run')} {verb} not done yet; {compared}."]


def _tuned(board: Leaderboard, tuned: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The best of what is tuned, and of what is not: like with like."""
    of = {label for label, item in tuned.items() if item.get("label") != label}
    kinds = [
        ("tuned gains", [s for s in board.compared if s.label in of]),
        ("the gains as given", [s for s in board.compared if s.label not in of]),
    ]
    if not all(found for _, found in kinds):
        return []
    parts = [
        f"with {name} {_listed([f'{s.label} {number(_estimate(s))}{_SPACE}m' for s in found])}"
        for name, found in kinds
    ]
    return [f"Compare like with like: {'; '.join(parts)}."]


def _listed(names: Sequence[str]) -> str:
    """All names, or the first of many."""
    if len(names) <= _MOST_NAMES + 1:
        return listing(names)
    return f"{', '.join(names[:_MOST_NAMES])} and {len(names) - _MOST_NAMES} more"


def _leader(field: Field, board: Leaderboard) -> list[str]:
    """Who is ahead by how much, and where not."""
    ahead = board.compared
    if len(ahead) < 2 or not field.cells:
        return []
    first = ahead[0]
    over = f"the {count(len(field.cells), 'cell')} that all were asked for"
    if field.pending:
        over = f"the {count(len(field.cells), 'cell')} that are done"
    if len(field.cells) == field.asked:
        over = f"all {count(len(field.cells), 'cell')}"
    if not math.isfinite(first.error.estimate):
        return [f"Over {over}, no controller completes the middle half of the cells."]
    # to the digits shown, several may be equal
    leaders = [s for s in ahead if number(_estimate(s)) == number(_estimate(first))]
    rest = [s for s in ahead if s not in leaders]
    verb = "has" if len(leaders) == 1 else "have"
    line = (
        f"Over {over}, {_listed([s.label for s in leaders])} {verb} the smallest steady |e^e| "
        f"(geometric interquartile mean): {_metres(first)}"
    )
    if rest:
        line += f"; then {rest[0].label}: {_metres(rest[0])}{_times(first, rest[0])}"
    return [f"{line}. {_shared(first, ahead)}", *_weak(first, field, board), *_solved(first, ahead)]


def _shared(first: Standing, ahead: Sequence[Standing]) -> str:
    tied = [s.label for s in ahead[1:] if s.ranks is not None and s.ranks[0] == 1]
    if not tied:
        return f"The cells settle that {first.label} is first."
    if all(s.ranks == (1, len(ahead)) for s in ahead):
        return "These cells are too few, or too alike in what they say, to settle any rank."
    verb = "shares" if len(tied) == 1 else "share"
    return (
        f"The cells do not settle who is first: {_listed(tied)} {verb} the possible rank 1 with "
        f"{first.label}."
    )


def _weak(first: Standing, field: Field, board: Leaderboard) -> list[str]:
    """Where the first is not the best, or fails."""
    better: Counter[str] = Counter()
    factors = []
    for cell in field.cells:
        own = cell_error(cell, first.label)
        errors = {label: cell_error(cell, label) for label in field.labels}
        best = min(errors.values())
        if number(best) == number(own):  # equal to the digits shown
            continue
        better.update(label for label, value in errors.items() if number(value) == number(best))
        factors.append(own / best)
    if not factors:
        return [f"In no cell has another controller a smaller error than {first.label}."]
    factors.sort()
    middle = factors[len(factors) // 2]
    how = f"a factor of {number(middle, 2)} in the median"
    if middle < 1.05:
        how = "by less than 5 % in the median"
    if math.isinf(middle):
        how = f"in {sum(map(math.isinf, factors))} of these it fails"
    names = ", ".join(f"{label} ({n})" for label, n in better.most_common(3))
    line = (
        f"{first.label} is not the best in {len(factors)} of {len(field.cells)} cells, where the best "
        f"are {names}; {how}."
    )
    families = [
        f"{family.family} ({min(family.standings.values(), key=_estimate).label})"
        for family in board.families
        if _estimate(min(family.standings.values(), key=_estimate))
        < 0.995 * _estimate(family.standings[first.label])
    ]
    if families:
        more = f" and {len(families) - _MOST_NAMES} more" if len(families) > _MOST_NAMES else ""
        line += f" By scenario family another leads in: {', '.join(families[:_MOST_NAMES])}{more}."
    return [line]


def _solved(first: Standing, ahead: Sequence[Standing]) -> list[str]:
    """Who solves most cells: to the mean of the middle half, a quarter that fails is invisible."""
    if first.solved == first.cells:
        return []
    most = max(standing.solved for standing in ahead)
    names = [s.label for s in ahead if s.solved == most]
    line = (
        f"{first.label} solves {first.solved} of {first.cells} cells (no run fails, and all settle "
        "below 1e-4 m)"
    )
    if most > first.solved:
        line += f"; most are solved by {_listed(names)}: {most}"
    return [f"{line}."]


def _estimate(standing: Standing) -> float:
    return standing.error.estimate


def _metres(standing: Standing) -> str:
    error = standing.error
    interval = f"{number(error.low, 2)} to {number(error.high, 2)}"
    return f"{number(error.estimate)}{_SPACE}m (95{_SPACE}% interval {interval})"


def _times(first: Standing, second: Standing) -> str:
    factor = second.error.estimate / first.error.estimate
    if not math.isfinite(factor) or factor < 1.05:
        return ""
    if factor >= 1e3:
        return f", {math.log10(factor):.1f} decades more"
    return f", {number(factor, 2)} times as much"


def _counts(
    groups: Sequence[Group], runs: Sequence[ReportedRun], failures: Sequence[FailedRun]
) -> str:
    labels = len(labels_of(runs, failures))
    periods = {cell.dt for group in groups for cell in group.cells}
    what = "robot, task and scenario" if len(periods) == 1 else "robot, task, scenario and dt"
    cells = sum(len(group.cells) for group in groups)
    seeds = len(unique([run.seed for run in runs] + [f.seed for f in failures]))
    return (
        f"{count(len(runs) + len(failures), 'run')}: {count(labels, 'controller')} in "
        f"{count(cells, 'cell')} ({what}), {count(seeds, 'seed')}. A run succeeds "
        "if it goes to its end and |e^e| stays below 1e-4 m from some time on."
    )


def _successes(
    groups: Sequence[Group], runs: Sequence[ReportedRun], failures: Sequence[FailedRun]
) -> str:
    labels = labels_of(runs, failures)
    cells = [cell for group in groups for cell in group.cells]
    score = {label: found for label in labels if (found := successes(cells, label))[1]}
    if not score:
        return "No run was tried yet."
    shares = []
    for won, asked in sorted(set(score.values()), key=lambda s: -s[0] / max(s[1], 1)):
        names = [label for label, found in score.items() if found == (won, asked)]
        share = "none" if won == 0 else "all" if won == asked else f"{won}"
        shares.append(f"{_listed(names)} in {share} of {asked}")
    if len(shares) > _MOST_NAMES + 1:
        shares = [*shares[:_MOST_NAMES], "…", shares[-1]]
    tried = " of the runs that were tried" if any(lost.pending for lost in failures) else ""
    return f"Success{tried}: {'; '.join(shares)}."


def _losses(runs: Sequence[ReportedRun], failures: Sequence[FailedRun]) -> list[str]:
    lines = []
    for status in unique([run.status for run in runs if not run.ok]):
        ended = [run for run in runs if run.status == status]
        by_label = [
            f"{label} ({sum(run.label == label for run in ended)})"
            for label in unique([run.label for run in ended])
        ]
        how = _ENDINGS.get(status, f"ended early ({status})")
        lines.append(f"{count(len(ended), 'run')} {how}: {_listed(by_label)}.")
    lost = sum(not failure.pending for failure in failures)
    if lost:
        verb = "is" if lost == 1 else "are"
        lines.append(
            f"{count(lost, 'run')} gave no result by a fault of the software or the machine, and {verb} "
            "counted as failed."
        )
    return lines


def _nominal(group: Group) -> str:
    """Best and worst where the plant is what controllers suppose."""
    cell = next((cell for cell in group.cells if cell.scenario == NOMINAL), None)
    errors = {} if cell is None else _errors(cell, group.labels)
    if cell is None or len(errors) < 2:
        return ""
    return f"{cell.name}: {_extremes(errors)}."


def _over_scenarios(group: Group) -> str:
    """Best and worst of the worst cases."""
    if len(group.cells) < 2:
        return ""
    worst: dict[str, float] = {}
    where: dict[str, str] = {}
    for label in group.labels:
        errors = [(found[label], cell) for cell in group.cells if (found := _errors(cell, [label]))]
        if len(errors) < len(group.cells):  # not asked everywhere, or not done: no worst yet
            continue
        worst[label], cell = max(errors, key=lambda item: item[0])
        where[label] = cell.variant
    if len(worst) < 2:
        return ""
    notes = {label: f", {variant}" for label, variant in where.items()}
    if not any(math.isfinite(value) for value in worst.values()):
        who = "no controller completes every scenario"
        if len(worst) < len(group.labels):
            who = f"of {listing(list(worst))}, which alone were asked for every cell, none completes all"
        return f"{group.name}: {who}."
    return f"{group.name}, worst of {len(group.cells)} scenarios: {_extremes(worst, notes)}."


def _errors(cell: CellRuns, labels: Sequence[str]) -> dict[str, float]:
    asked = [label for label in labels if cell.of(label) or cell.failures_of(label)]
    return {label: cell_error(cell, label) for label in asked if not cell.pending(label)}


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
            if math.isfinite(low.metric(name))
        ]
        if parts:
            lines.append(f"{cell.name}, cost of success: {'; '.join(parts)}.")
    return lines


def _range(runs: Sequence[ReportedRun], name: str) -> tuple[ReportedRun, ReportedRun]:
    def value(run: ReportedRun) -> float:
        return run.metric(name)

    return min(runs, key=value), max(runs, key=value)


def _spread(name: str, low: ReportedRun, high: ReportedRun) -> str:
    unit = _SPACE + "µs" if name == "compute_time_median" else ""
    least, most = (metric_value(name, run.metrics[name]) + unit for run in (low, high))
    if least == most:
        return f"{least} for all"
    return f"{least} ({low.label}) to {most} ({high.label})"
