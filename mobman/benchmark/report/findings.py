"""Findings in sentences made from the numbers alone, and the limitations of the numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from mobman.benchmark.report.data import DONE, NOMINAL, NOT_RUN, Results
from mobman.benchmark.report.format import (
    count,
    environment,
    interval_range,
    listing,
    metric_value,
    number,
)
from mobman.benchmark.report.standings import Board, Standing, unit_of
from mobman.controllers.protocol import information_of

_SPACE = "\u00a0"  # holds a number and its unit together
_ENDINGS = {"diverged": "diverged", "singular": "ended at a singularity"}
_PRICES = {
    "compute_time_median": "median control step",
    "torque_energy": "integral of |v|²",
    "torque_peak": "largest torque",
}
_MOST_LINES = 10  # of a summary, whatever the suite's size
_FEW = 3  # robots and tasks that each get sentences of their own, as far as there is room
_MOST_NAMES = 5  # scenario families, or controllers, that are named in a sentence


def summary_lines(results: Results, board: Board) -> list[str]:
    """Say what came out, good and bad, for every controller alike, in about ten sentences."""
    if not len(results.runs):
        return ["There is no run to report."]
    lines = [_counts(results), *_pending(results, board), *_leader(results, board)]
    lines += [*_tuned(results, board), _successes(results), *_losses(results)]
    if len(results.groups) > _FEW:
        return lines
    nominal, worst, prices = [], [], []
    errors = results.errors.mask(results.pending)
    for _, cells in results.cells.groupby("group", sort=False):
        if cells.scenario.iloc[0] == NOMINAL:
            first, own = cells.index[0], dict(errors.loc[cells.index[0]].dropna())
            nominal += [f"{cells.name[first]}: {_extremes(own)}."] if len(own) > 1 else []
            prices += _price(results, first)
        worst += _over_scenarios(results, errors.loc[cells.index], cells)
    for more in (nominal, worst, prices):
        if len(lines) + len(more) <= _MOST_LINES:
            lines += more
    return lines


def first_sentences(lines: Sequence[str]) -> list[str]:
    """Choose three sentences of a summary: what was run, who is ahead, who succeeds."""
    chosen = [lines[0], *(line for line in lines if line.startswith(("Over ", "Success")))]
    return chosen if len(chosen) == 3 else list(lines[:3])


def _counts(results: Results) -> str:
    runs, cells = results.runs, results.cells
    what = "robot, task and scenario" if cells.dt.nunique() == 1 else "robot, task, scenario and dt"
    return (
        f"{count(len(runs), 'run')}: {count(len(results.labels), 'controller')} in "
        f"{count(len(cells), 'cell')} ({what}), {count(runs.seed.nunique(), 'seed')}. A run succeeds "
        "if it goes to its end and |e^e| stays below 1e-4 m from some time on."
    )


def _pending(results: Results, board: Board) -> list[str]:
    """Count runs that are not done yet, which are not to be mistaken for failures."""
    pending = int((results.runs.state == NOT_RUN).sum())
    if not pending:
        return []
    compared = "there is no cell yet in which all were tried, so nothing is compared"
    if len(board.cells):
        compared = (
            f"only the {count(len(board.cells), 'cell')} in which all were tried are compared, and "
            "these need not be like the others"
        )
    verb = "was" if pending == 1 else "were"
    return [f"Preliminary: {count(pending, 'run')} {verb} not done yet; {compared}."]


def _leader(results: Results, board: Board) -> list[str]:
    """Name the leader, its lead, and the cells in which others are better."""
    if not board.compares:
        return []
    ahead = board.ranked
    first, n = ahead[0], count(len(board.cells), "cell")
    over = f"the {n} that {'are done' if board.pending else 'all controllers ran in'}"
    if len(board.cells) == board.asked:
        over = f"all {n}"
    if not math.isfinite(first.error.estimate):
        return [f"Over {over}, no controller completes the middle half of the cells."]
    # to the digits shown, several may be equal
    leaders = [s for s in ahead if number(s.error.estimate) == number(first.error.estimate)]
    line = (
        f"Over {over}, {_listed([s.label for s in leaders])} {'has' if len(leaders) == 1 else 'have'} "
        f"the smallest steady |e^e| (geometric interquartile mean): {_metres(first)}"
    )
    if rest := [s for s in ahead if s not in leaders]:
        line += f"; then {rest[0].label}: {_metres(rest[0])}{_times(first, rest[0])}"
    weak, solved = _weak(results, first, board), _solved(first, ahead)
    return [f"{line}. {_shared(first, ahead)}", weak, *solved]


def _shared(first: Standing, ahead: Sequence[Standing]) -> str:
    tied = [s.label for s in ahead[1:] if s.ranks is not None and s.ranks[0] == 1]
    if not tied:
        return f"The cells establish that {first.label} is first."
    if all(s.ranks == (1, len(ahead)) for s in ahead):
        return "There are too few cells, or too similar ones, to establish a ranking."
    verb = "shares" if len(tied) == 1 else "share"
    return (
        f"The cells do not settle who is first: {_listed(tied)} {verb} the possible rank 1 with "
        f"{first.label}."
    )


def _weak(results: Results, first: Standing, board: Board) -> str:
    """Count the cells in which the first is not the best, or fails."""
    better: Counter[str] = Counter()
    factors = []
    for _, errors in results.errors.loc[board.cells, board.labels].iterrows():
        own, best = float(errors[first.label]), float(errors.min())
        if number(best) != number(own):  # to the digits shown
            better.update(str(k) for k, value in errors.items() if number(value) == number(best))
            factors.append(own / best)
    if not factors:
        return f"In no cell has another controller a smaller error than {first.label}."
    middle = sorted(factors)[len(factors) // 2]
    how = f"a factor of {number(middle, 2)} in the median"
    if middle < 1.05:
        how = "by less than 5 % in the median"
    if math.isinf(middle):
        how = f"in {sum(map(math.isinf, factors))} of these it fails"
    names = ", ".join(f"{label} ({n})" for label, n in better.most_common(3))
    line = (
        f"{first.label} is not the best in {len(factors)} of {len(board.cells)} cells, where the best "
        f"are {names}; {how}."
    )
    families = []
    for family, found in board.families.items():
        leader = min(found.values(), key=lambda s: s.error.estimate)
        if leader.error.estimate < 0.995 * found[first.label].error.estimate:
            families.append(f"{family} ({leader.label})")
    if families:
        more = f" and {len(families) - _MOST_NAMES} more" if len(families) > _MOST_NAMES else ""
        line += f" By scenario family another leads in: {', '.join(families[:_MOST_NAMES])}{more}."
    return line


def _solved(first: Standing, ahead: Sequence[Standing]) -> list[str]:
    """Name those that solve most cells: the mean does not see a quarter that fails."""
    if first.solved == first.cells:
        return []
    most = max(standing.solved for standing in ahead)
    names = _listed([s.label for s in ahead if s.solved == most])
    others = f"; most are solved by {names}: {most}" if most > first.solved else ""
    return [
        f"{first.label} solves {first.solved} of {first.cells} cells (no run fails, and all settle "
        f"below 1e-4 m){others}."
    ]


def _tuned(results: Results, board: Board) -> list[str]:
    """The best of what is tuned, and of what is not: like with like."""
    of = {label for label, item in results.tuned.items() if item.label != label}
    kinds = {
        "tuned gains": [s for s in board.ranked if s.label in of],
        "the gains as given": [s for s in board.ranked if s.label not in of],
    }
    if not all(kinds.values()):
        return []
    parts = [
        f"with {name} {_listed([f'{s.label} {number(s.error.estimate)}{_SPACE}m' for s in found])}"
        for name, found in kinds.items()
    ]
    return [f"Compare like with like: {'; '.join(parts)}."]


def _listed(names: Sequence[str]) -> str:
    """All names, or the first of many."""
    if len(names) <= _MOST_NAMES + 1:
        return listing(names)
    return f"{', '.join(names[:_MOST_NAMES])} and {len(names) - _MOST_NAMES} more"


def _metres(standing: Standing) -> str:
    error = standing.error
    return f"{number(error.estimate)}{_SPACE}m (95{_SPACE}% interval {interval_range(error)})"


def _times(first: Standing, second: Standing) -> str:
    factor = second.error.estimate / first.error.estimate
    if not math.isfinite(factor) or factor < 1.05:
        return ""
    if factor >= 1e3:
        return f", {math.log10(factor):.1f} decades more"
    return f", {number(factor, 2)} times as much"


def _successes(results: Results) -> str:
    tried = results.runs[results.runs.state != NOT_RUN]
    if not len(tried):
        return "No run was tried yet."
    by_score: dict[tuple[int, int], list[str]] = {}
    for label in results.labels:
        if len(own := tried.succeeded[tried.label == label]):
            by_score.setdefault((int(own.sum()), len(own)), []).append(label)
    shares = []
    for (won, asked), names in sorted(by_score.items(), key=lambda s: -s[0][0] / s[0][1]):
        share = "none" if won == 0 else "all" if won == asked else f"{won}"
        shares.append(f"{_listed(names)} in {share} of {asked}")
    if len(shares) > _MOST_NAMES + 1:
        shares = [*shares[:_MOST_NAMES], "…", shares[-1]]
    some = " of the runs that were tried" if len(tried) < len(results.runs) else ""
    return f"Success{some}: {'; '.join(shares)}."


def _losses(results: Results) -> list[str]:
    lines = []
    early = results.runs[(results.runs.state == DONE) & ~results.runs.ok]
    for status, ended in early.groupby("status", sort=False):
        sizes = ended.groupby("label", sort=False).size()
        how = _ENDINGS.get(str(status), f"ended early ({status})")
        names = _listed([f"{label} ({n})" for label, n in sizes.items()])
        lines.append(f"{count(len(ended), 'run')} {how}: {names}.")
    if lost := int((results.lost.state != NOT_RUN).sum()):
        lines.append(
            f"{count(lost, 'run')} gave no result by a fault of the software or the machine, and "
            f"{'is' if lost == 1 else 'are'} counted as failed."
        )
    return lines


def _over_scenarios(results: Results, errors: pd.DataFrame, cells: pd.DataFrame) -> list[str]:
    """Best and worst of the worst cases of a group."""
    asked = list(errors.columns[results.errors.loc[cells.index].notna().any()])
    # one that did not run everywhere has no worst yet
    whole = [label for label in asked if errors[label].notna().all()]
    if len(cells) < 2 or len(whole) < 2:
        return []
    group, worst = cells.group.iloc[0], dict(errors[whole].max())
    if any(map(math.isfinite, worst.values())):
        notes = {label: f", {cells.variant[errors[label].idxmax()]}" for label in whole}
        return [f"{group}, worst of {len(cells)} scenarios: {_extremes(worst, notes)}."]
    who = "no controller completes every scenario"
    if len(whole) < len(asked):
        who = f"of {listing(whole)}, which alone ran in every cell, none completes all"
    return [f"{group}: {who}."]


def _extremes(errors: Mapping[str, float], notes: Mapping[str, str] | None = None) -> str:
    """ "smallest steady |e^e| with a (1e-9 m), largest with b (0.2 m); c does not finish"."""
    finite = {label: value for label, value in errors.items() if math.isfinite(value)}

    def best(value: float) -> str:
        names = [label for label, other in finite.items() if number(other) == number(value)]
        note = (notes or {}).get(names[0], "")
        return f"{listing(names)} ({number(value)}{_SPACE}m{note})"

    parts = []
    if finite:
        low, high = min(finite.values()), max(finite.values())
        parts.append(f"smallest steady |e^e| with {best(low)}")
        if number(high) != number(low):
            parts[-1] += f", largest with {best(high)}"
    if lost := [label for label in errors if label not in finite]:
        parts.append(f"{listing(lost)} {'does' if len(lost) == 1 else 'do'} not finish")
    return "; ".join(parts)


def _price(results: Results, cell: int) -> list[str]:
    """Give the cost of success in computing time and torque."""
    runs = results.runs[results.runs.cell == cell]
    won = runs[(runs.seed == runs.seed.iloc[0]) & runs.succeeded]
    parts = []
    for name, what in _PRICES.items():
        values = results.metric(name).loc[won.index]
        if len(won) < 2 or not np.isfinite(values.min()):
            continue
        unit = _SPACE + "µs" if name == "compute_time_median" else ""
        (low, a), (high, b) = (
            (metric_value(name, values[i]) + unit, won.label[i])
            for i in (values.idxmin(), values.idxmax())
        )
        parts.append(
            f"{what} {low} for all" if low == high else f"{what} {low} ({a}) to {high} ({b})"
        )
    return [f"{results.cells.name[cell]}, cost of success: {'; '.join(parts)}."] if parts else []


# Limitations ---------------------------------------------------------------------------------------

_PLAIN = ("pseudo-inverse", "damped-least-squares", "extended-jacobian")
_UNITS = {
    "robot": "Intervals, ranks and p-values are of platforms, with all of their cells: they say how "
    "the results would vary with robots like these.",
    "cell": "With fewer than ten platforms, intervals, ranks and p-values take their cells as "
    "independent, which those that differ in one magnitude or placement are not quite: they are too "
    "sure where a suite has many that are alike. They say how the results would vary with cells like "
    "these, not with other robots.",
}


def limitations_of(results: Results) -> list[str]:
    """List the limitations of a report on these runs, the weightiest first."""
    runs = results.runs[results.runs.state == DONE]

    def labels(which: pd.Series) -> list[str]:
        return list(dict.fromkeys(runs.label[which]))

    settings = [own for own in runs.settings if "discretization" in own]
    plain = labels(runs.law.isin(_PLAIN))
    uses = runs.law.map(information_of)
    with_z_dot = uses.map(lambda known: known is not None and "z'" in known).astype(bool)
    using, others, unsaid = (
        labels(which) for which in (with_z_dot, ~with_z_dot & uses.notna(), uses.isna())
    )
    without = ((others, "do not"), (unsaid, "do not say whether they do"))
    lines = (
        environment()
        .get_template("limitations.j2")
        .render(
            implicit=any(own["discretization"] == "implicit" for own in settings),
            explicit=runs.explicit.any(),
            tuned=results.tuned,
            plain=plain
            and f"{listing(plain)} are computed-torque laws without integral action, observer or "
            "adaptation: they have nothing against wrong masses by design.",
            exact=using and (runs.acceleration == "exact").any(),
            using=listing(using),
            others=listing([f"{listing(names)} {how}" for names, how in without if names])
            or "all of them have it",
            zero_beta=any(own.get("beta_0") == 0.0 for own in settings),
            youbot=(runs.robot == "youbot").any(),
            sliding=settings,
            one_seed=runs.seed.iloc[0] if runs.seed.nunique() == 1 else None,
            placed=runs.placement.any(),
            units=_UNITS[unit_of(results, results.cells.index)],
        )
    )
    cells, first, *rest = lines.splitlines()
    return [first, cells, *rest]
