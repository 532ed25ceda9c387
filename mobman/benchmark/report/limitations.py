"""What the numbers of a report do not say."""

from __future__ import annotations

from collections.abc import Sequence

from mobman.benchmark.report.cells import unique
from mobman.benchmark.report.content import ReportedRun

_IMPLICIT = (
    "The implicit form of the sliding laws is this framework's, not the paper's. Inside the unit ball "
    "its unit vector is the equivalent control: a linear solve at every tick with J and the nominal "
    "inertia M, bounded by the ball. The paper's continuous law needs only the transposes of J and B "
    "and bounds of norms. So the figures show what the paper's law does when it is sampled this way, "
    "and not that transposes and bounds are enough for a sampled controller."
)
_EXPLICIT = (
    "The explicit discretisation is the law as printed, sampled at the same period. It chatters or "
    "diverges, and is shown for comparison: it is not a fair picture of the continuous law."
)
_ZERO_BETA = (
    "The sliding laws' gains claim that there are no disturbances (beta_0 = beta_1 = 0, as in the "
    "paper), and their constants w_i are the paper's rough values for its youBot, on other robots too. "
    "Runs under disturbances or with other masses are outside of what these bounds cover."
)
_LAWS = (
    "The baselines are computed-torque laws without integral action or adaptation: they are told "
    "nothing of the wrong masses either, and have nothing against them by design."
)
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
    "a perfect sensor. The sliding laws use it, the baselines do not; this is an advantage that a "
    "real robot would not give."
)
_IDEAL = (
    "All of this is simulation. But for what a scenario changes, measurements are exact, motors give "
    "the torque that they are told, at once and without limit, and joints have no friction; links and "
    "tyres are rigid throughout. Errors of 1e-9 m are statements on the law and on the simulation, "
    "not on any robot."
)
_LIMITS = (
    "Joint limits, collisions and limits of joint speeds are not enforced, and the laws do not know "
    "them: a run may succeed by a motion that the robot could not make."
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
    "The youBot's masses and kinematics are the paper's; inertias that the paper does not "
    "print are partly approximate. Expect the paper's picture, not its digits."
)
_AUTO = (
    'Where a gain is "auto" (a, A), it is a bound found by sampling configurations near the task, '
    "with a margin: likely, but not proven."
)
_START = (
    "Each robot starts from one configuration, at rest, and follows one path: nothing here says "
    "how large the set of good starts is."
)
_SEEDS = (
    "Several seeds of a cell are not independent evidence: they count once, by the worst of them. "
    "Nor are cells that differ in one magnitude or period only, but intervals and p-values take cells "
    "as independent within a robot and task: they are too sure where a suite has many that are alike. "
    "They say how the results would vary with cells like these, not with any robot and task."
)
_STEADY = (
    "The steady part is the last 30 % of a run. A law that is still converging there is judged "
    "by where it has come to."
)


def limitations_of(runs: Sequence[ReportedRun], *, tuned: bool = False) -> list[str]:
    """The limitations of a report on these runs, the weightiest first.

    Args:
        runs: The runs.
        tuned: Whether some of the controllers were tuned.
    """
    implicit = any(run.settings.get("discretization") == "implicit" for run in runs)
    sliding = [run for run in runs if "discretization" in run.settings]
    found = [_IMPLICIT] if implicit else []
    found += [_EXPLICIT] if any(run.explicit for run in runs) else []
    found.append((_PARTLY_TUNED if tuned else _UNTUNED) + _LAWS)
    found += [_EXACT] if any(run.acceleration == "exact" for run in sliding) else []
    if any(run.settings.get("beta_0") == 0.0 for run in sliding):
        found.append(_ZERO_BETA)
    found += [_IDEAL, _LIMITS, _WHEELS]
    found += [_YOUBOT] if any(run.cell.robot == "youbot" for run in runs) else []
    found += [_AUTO] if sliding else []
    seeds = unique([run.seed for run in runs])
    if len(seeds) == 1:
        found.append(
            f"One seed ({seeds[0]}): where a scenario has randomness, this is one draw of it, and "
            "there is no statement on spread."
        )
    return [*found[:1], _CELLS, *found[1:], _START, _SEEDS, _STEADY]
