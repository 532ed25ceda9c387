"""Findings in sentences made from the numbers alone, and the limitations of the numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from mobman.benchmark.report.data import DONE, NOMINAL, NOT_RUN, Results
from mobman.benchmark.report.format import count, interval_range, listing, metric_value, number
from mobman.benchmark.report.standings import Board, Standing, unit_of
from mobman.controllers.protocol import information_of

_SPACE = "\u00a0"  # holds a number and its unit together
_ENDINGS = {"diverged": "diverged", "singular": "ended at a singularity"}
_PRICES = {
    "compute_time_median": "median control step",
    "torque_energy": "integral of |v|²",
    "torque_peak": "largest torque",
}
_MOST_LINES = 10
"""Lines of a summary, whatever the suite's size."""
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
    for group in results.groups:
        cells = results.cells[results.cells.group == group]
        first = cells.index[0] if cells.scenario.iloc[0] == NOMINAL else None
        if first is not None:
            errors = _errors(results, first)
            nominal += [f"{cells.name[first]}: {_extremes(errors)}."] if len(errors) > 1 else []
            prices += _price(results, first)
        worst += _over_scenarios(results, cells)
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
    compared = (
        f"only the {count(len(board.cells), 'cell')} in which all were tried are compared, and these "
        "need not be like the others"
    )
    if not len(board.cells):
        compared = "there is no cell yet in which all were tried, so nothing is compared"
    verb = "was" if pending == 1 else "were"
    return [f"Preliminary: {count(pending, 'run')} {verb} not done yet; {compared}."]


def _leader(results: Results, board: Board) -> list[str]:
    """Name the leader, its lead, and the cells in which others are better."""
    ahead = board.ranked
    if not board.compares:
        return []
    first, n = ahead[0], count(len(board.cells), "cell")
    over = f"the {n} that all controllers ran in"
    if board.pending:
        over = f"the {n} that are done"
    if len(board.cells) == board.asked:
        over = f"all {n}"
    if not math.isfinite(first.error.estimate):
        return [f"Over {over}, no controller completes the middle half of the cells."]
    # to the digits shown, several may be equal
    leaders = [s for s in ahead if number(s.error.estimate) == number(first.error.estimate)]
    rest = [s for s in ahead if s not in leaders]
    verb = "has" if len(leaders) == 1 else "have"
    line = (
        f"Over {over}, {_listed([s.label for s in leaders])} {verb} the smallest steady |e^e| "
        f"(geometric interquartile mean): {_metres(first)}"
    )
    if rest:
        line += f"; then {rest[0].label}: {_metres(rest[0])}{_times(first, rest[0])}"
    return [
        f"{line}. {_shared(first, ahead)}",
        *_weak(results, first, board),
        *_solved(first, ahead),
    ]


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


def _weak(results: Results, first: Standing, board: Board) -> list[str]:
    """Count the cells in which the first is not the best, or fails."""
    better: Counter[str] = Counter()
    factors = []
    for _, errors in results.errors.loc[board.cells, board.labels].iterrows():
        own, best = float(errors[first.label]), float(errors.min())
        if number(best) == number(own):  # equal to the digits shown
            continue
        better.update(str(k) for k, value in errors.items() if number(value) == number(best))
        factors.append(own / best)
    if not factors:
        return [f"In no cell has another controller a smaller error than {first.label}."]
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
    return [line]


def _solved(first: Standing, ahead: Sequence[Standing]) -> list[str]:
    """Name those that solve most cells: the mean does not see a quarter that fails."""
    if first.solved == first.cells:
        return []
    most = max(standing.solved for standing in ahead)
    line = (
        f"{first.label} solves {first.solved} of {first.cells} cells (no run fails, and all settle "
        "below 1e-4 m)"
    )
    if most > first.solved:
        names = [s.label for s in ahead if s.solved == most]
        line += f"; most are solved by {_listed(names)}: {most}"
    return [f"{line}."]


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
    score = tried.groupby("label").succeeded.agg(["sum", "size"])
    by_score: dict[tuple[int, int], list[str]] = {}
    for label in (label for label in results.labels if label in score.index):
        by_score.setdefault((int(score["sum"][label]), int(score["size"][label])), []).append(label)
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
        by_label = [
            f"{label} ({n})" for label, n in ended.groupby("label", sort=False).size().items()
        ]
        how = _ENDINGS.get(str(status), f"ended early ({status})")
        lines.append(f"{count(len(ended), 'run')} {how}: {_listed(by_label)}.")
    lost = int((results.lost.state != NOT_RUN).sum())
    if lost:
        verb = "is" if lost == 1 else "are"
        lines.append(
            f"{count(lost, 'run')} gave no result by a fault of the software or the machine, and {verb} "
            "counted as failed."
        )
    return lines


def _over_scenarios(results: Results, cells: pd.DataFrame) -> list[str]:
    """Best and worst of the worst cases."""
    if len(cells) < 2:
        return []
    errors = results.errors.mask(results.pending).loc[cells.index]
    asked = [
        label for label in results.labels if results.errors[label].loc[cells.index].notna().any()
    ]
    # one that did not run everywhere has no worst yet
    whole = [label for label in asked if errors[label].notna().all()]
    if len(whole) < 2:
        return []
    worst = {label: float(errors[label].max()) for label in whole}
    notes = {label: f", {cells.variant[errors[label].idxmax()]}" for label in whole}
    group = cells.group.iloc[0]
    if any(math.isfinite(value) for value in worst.values()):
        return [f"{group}, worst of {len(cells)} scenarios: {_extremes(worst, notes)}."]
    who = "no controller completes every scenario"
    if len(whole) < len(asked):
        who = f"of {listing(whole)}, which alone ran in every cell, none completes all"
    return [f"{group}: {who}."]


def _errors(results: Results, cell: int) -> dict[str, float]:
    found = results.errors.mask(results.pending).loc[cell].dropna()
    return {str(label): float(value) for label, value in found.items()}


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
        if len(finite) > 1 and number(high) != number(low):
            parts[-1] += f", largest with {best(high)}"
    lost = [label for label in errors if label not in finite]
    if lost:
        parts.append(f"{listing(lost)} {'does' if len(lost) == 1 else 'do'} not finish")
    return "; ".join(parts)


def _price(results: Results, cell: int) -> list[str]:
    """Give the cost of success in computing time and torque."""
    runs = results.runs[results.runs.cell == cell]
    won = runs[(runs.seed == runs.seed.iloc[0]) & runs.succeeded]
    parts = []
    for name, what in _PRICES.items():
        values = results.metrics.get(name, pd.Series(math.nan, results.metrics.index)).loc[
            won.index
        ]
        if len(won) < 2 or not np.isfinite(values.min()):
            continue
        unit = _SPACE + "µs" if name == "compute_time_median" else ""
        ends = [
            (metric_value(name, values[i]) + unit, won.label[i])
            for i in (values.idxmin(), values.idxmax())
        ]
        (low, a), (high, b) = ends
        parts.append(
            f"{what} {low} for all" if low == high else f"{what} {low} ({a}) to {high} ({b})"
        )
    return [f"{results.cells.name[cell]}, cost of success: {'; '.join(parts)}."] if parts else []


# Limitations ---------------------------------------------------------------------------------------

_IMPLICIT = (
    "The implicit form of the sliding laws is this framework's, not the published one. Inside the "
    "unit ball its unit vector is the equivalent control: a linear solve at every tick with J and "
    "the nominal inertia M, bounded by the ball. The published continuous law needs only the "
    "transposes of J and B and bounds of norms. So the figures show what the published law does "
    "when it is sampled this way, and not that transposes and bounds are enough for a sampled "
    "controller."
)
_EXPLICIT = (
    "The explicit discretisation is the law as printed, sampled at the same period. It chatters or "
    "diverges, and is shown for comparison: it is not a fair picture of the continuous law."
)
_ZERO_BETA = (
    "The sliding laws' gains claim that there are no disturbances (beta_0 = beta_1 = 0), and "
    "their constants w_i are the rough values published for the youBot, on other robots too. "
    "Runs under disturbances or with other masses are outside of what these bounds cover."
)
_LAWS = (
    "{} are computed-torque laws without integral action, observer or adaptation: they have nothing "
    "against wrong masses by design."
)
_PLAIN = ("pseudo-inverse", "damped-least-squares", "extended-jacobian")
_UNTUNED = (
    "No controller was tuned for this comparison. The baselines' gains are fixed, and so are "
    "the sliding laws', but the effort that went into choosing them was not equal. The comparison is "
    "one of these laws with these gains, not of the best that each can do. It matters: in the study of "
    "docs/tuning.md most of the baselines' error with wrong masses (scenario heavier) came from "
    "their default gains, 0.4 to 0.5 m that tuned ones reduced to about 2 mm where they held. "
)
_PARTLY_TUNED = (
    "Tuned gains are the best of a number of trials, on scenarios that are not the reported ones; more "
    "trials, other ranges or another objective may give others. What is not tuned has its default or "
    "given gains: compare tuned with tuned. "
)
_EXACT = (
    "Where a scenario does not say otherwise, the acceleration z' is measured without error, as if from "
    "a perfect sensor, which a real robot does not have. {} use it; {}. What part of a difference "
    "comes from it, docs/suites.md says for the scenario heavier."
)
_IDEAL = (
    "All of this is simulation. But for what a scenario changes, measurements are exact, motors give "
    "the torque that they are told, at once and without limit, and joints have no friction; links and "
    "tyres are rigid throughout. Errors of 1e-9 m are statements on the law and on the simulation, "
    "not on any robot."
)
_LIMITS = (
    "Unless a scenario says otherwise, limits of joints, speeds and torques are not enforced, and "
    "nothing looks for collisions: a run may succeed by a motion that the robot could not make. Runs "
    "beyond the robot's own limits are counted and marked."
)
_CELLS = (
    "Cells are chosen, not sampled from any population of robots, tasks and faults, and the magnitudes "
    "of the scenarios are chosen too: other ones would move every average and may change ranks. Each "
    "cell counts the same, so a scenario family with more magnitudes, and a scenario at more sampling "
    "periods, weighs more; look at the families one by one."
)
_WHEELS = (
    "Wheels roll without slip on a plane. The reduced model satisfies A(x) x' = 0 by construction, so "
    "that a small constraint residual is no evidence of grip."
)
_YOUBOT = (
    "The youBot's masses and kinematics are the published ones; inertias that were not printed are "
    "partly approximate. Expect the published picture, not its digits."
)
_AUTO = (
    'Where a gain is "auto" (a, A), it is a bound found by sampling configurations near the task, '
    "with a margin: likely, but not proven."
)
_START = (
    "Each robot starts from one configuration, at rest, and follows one path: nothing here says "
    "how large the set of good starts is."
)
_PLACED = (
    "Starts and circles at placements are drawn near the robot's rest, where the motion can be followed "
    "without a singularity: nothing here says how large the set of good starts is."
)
_SEEDS = (
    "Several seeds of a cell are not independent evidence: they count once, by the worst of them. "
    "Robots on the same platform count as one. "
)
_UNITS = {
    "robot": "Intervals, ranks and p-values are of platforms, with all of their cells: they say how "
    "the results would vary with robots like these.",
    "cell": "With fewer than ten platforms, intervals, ranks and p-values take their cells as "
    "independent, which those that differ in one magnitude or placement are not quite: they are too "
    "sure where a suite has many that are alike. They say how the results would vary with cells like "
    "these, not with other robots.",
}
_STEADY = (
    "The steady part is the last 30 % of a run. A law that is still converging there is judged "
    "by where it has come to."
)


def limitations_of(results: Results) -> list[str]:
    """List the limitations of a report on these runs, the weightiest first."""
    runs = results.runs[results.runs.state == DONE]
    sliding = runs[runs.settings.map(lambda settings: "discretization" in settings).astype(bool)]
    settings = list(sliding.settings)
    implicit = any(own["discretization"] == "implicit" for own in settings)
    found = [_IMPLICIT] if implicit else []
    found += [_EXPLICIT] if runs.explicit.any() else []
    plain = list(dict.fromkeys(runs.label[runs.law.isin(_PLAIN)]))
    found.append(
        (_PARTLY_TUNED if results.tuned else _UNTUNED)
        + (_LAWS.format(listing(plain)) if plain else "")
    )
    with_z_dot = runs.law.map(lambda law: "z'" in (information_of(law) or ()))
    using, others = (list(dict.fromkeys(runs.label[w])) for w in (with_z_dot, ~with_z_dot))
    if using and (runs.acceleration == "exact").any():
        rest = f"{listing(others)} do not" if others else "all of them have it"
        found.append(_EXACT.format(listing(using), rest))
    found += [_ZERO_BETA] if any(own.get("beta_0") == 0.0 for own in settings) else []
    found += [_IDEAL, _LIMITS, _WHEELS]
    found += [_YOUBOT] if (runs.robot == "youbot").any() else []
    found += [_AUTO] if settings else []
    if runs.seed.nunique() == 1:
        found.append(
            f"One seed ({runs.seed.iloc[0]}): where a scenario has randomness, this is one draw of it, "
            "and there is no statement on spread."
        )
    start = _PLACED if runs.placement.any() else _START
    seeds = _SEEDS + _UNITS[unit_of(results, results.cells.index)]
    return [*found[:1], _CELLS, *found[1:], start, seeds, _STEADY]
