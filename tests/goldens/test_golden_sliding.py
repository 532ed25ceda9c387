"""Whole runs of the sliding laws, within the spread that rounding makes.

x^(1/3) and x^(3/5) at 0 amplify rounding without bound, so that no rewriting gives the same digits. What
rounding may do is measured: five more runs whose q0 differs by a unit in the last place.
"""

from __future__ import annotations

import numpy as np
import pytest
from support.goldens import a_last_place_away, read, write

import mobman as mm

FILE = "sliding.h5"
LAWS = ("tsm", "tsm-simplified", "tsm-inverse-actuation")
RUNS = {
    # robot, task: duration (s)
    ("youbot", "paper"): 6.0,
    ("youbot", "circle"): 4.0,
    ("tiago_no_hand", "circle"): 4.0,
    ("husky_ur5", "circle"): 4.0,
    ("ridgeback_panda", "circle"): 4.0,
    ("fixed_panda", "circle"): 4.0,
}
DT, INSTANTS, MOVED = 1e-3, 24, 5
FACTOR, FLOOR = 10.0, 1e-9
"""Allowed: so many times the spread, and so much of the largest."""
TICKS = 2
"""Settling times may differ by so many ticks."""
OF_FLOOR = 3.0
"""The largest |e| of the last twentieth of a run may differ by this factor."""
SETTLING = ("settling_time_1e-2", "settling_time_1e-4", "settling_time_1e-6")
IN_CI = ("youbot", "paper"), ("tiago_no_hand", "circle"), ("ridgeback_panda", "circle")
CASES = [(*run, law) for run in RUNS for law in LAWS]


def run(robot: mm.MobileManipulator, law, task: str, duration: float, q0=None) -> mm.Record:
    """The run of a case: as the paper has it, with the whole M in the metric."""
    if isinstance(law, str):
        law = mm.make_controller(law, metric_scale=1.0)
    return mm.simulate(robot, law, task, duration=duration, dt=DT, q0=q0)


def measured(record: mm.Record, duration: float) -> dict:
    """Samples at equal intervals up to the end of the run, and its status and metrics."""
    size = np.linalg.norm(record.task_error, axis=1)
    ticks = round(duration / DT)
    rows = np.linspace(0, ticks, INSTANTS + 1).round().astype(int)[1:]
    rows = rows[rows < len(record.t)]
    return {
        "e": size[rows],
        "q": record.q[rows],
        "status": record.status,
        "end": float(record.t[-1]),
        "settling": np.array([record.metrics[name] for name in SETTLING]),
        "floor": float(size[record.t >= 0.95 * record.t[-1]].max()),
    }


def spread(center: dict, others: list[dict]) -> dict:
    """Stored form of a case: a run, and the largest deviations of the moved ones from it."""
    every = [center, *others]
    n = min(len(some["e"]) for some in every)
    stored = {"status": center["status"]}
    for name in ("e", "q"):
        stored[name] = center[name][:n]
        apart = [np.abs(other[name][:n] - center[name][:n]) for other in others]
        stored[f"{name} spread"] = np.maximum.reduce(apart)
    for name in ("end", "settling", "floor"):
        values = np.array([some[name] for some in every])
        stored[name] = np.array([values.min(axis=0), values.max(axis=0)])
    return stored


def deviations(found: dict, stored: dict):
    """List the deviations of a run beyond what the stored spread allows."""
    if found["status"] != stored["status"]:
        yield f"ends {found['status']}; stored: {stored['status']}"
    slack = TICKS * DT + 1e-9
    for name in ("end", "settling"):
        low, high = stored[name]
        # inf, for what was not reached, is equal to itself alone
        within = (found[name] >= low - slack) & (found[name] <= high + slack)
        if not np.all(within):
            yield f"{name}: {found[name]}; stored: {low} to {high}"
    low, high = stored["floor"]
    if not low / OF_FLOOR <= found["floor"] <= high * OF_FLOOR:
        yield f"floor: {found['floor']:.2e}; stored: {low:.2e} to {high:.2e}"
    for name in ("e", "q"):
        n = len(stored[name])
        if len(found[name]) < n:
            yield f"{name}: {len(found[name])} instants; stored: {n}"
            continue
        allowed = FACTOR * stored[f"{name} spread"] + FLOOR * np.abs(stored[name]).max()
        beyond = np.abs(found[name][:n] - stored[name]) / allowed
        if not beyond.max() <= 1.0:
            first = np.flatnonzero(beyond.reshape(n, -1).max(axis=1) > 1.0)[0]
            yield f"{name}: {beyond.max():.1e} times what is allowed, from instant {first} on"


@pytest.mark.parametrize(
    ("name", "task", "law"),
    [case if case[:2] in IN_CI else pytest.param(*case, marks=pytest.mark.slow) for case in CASES],
)
def test_runs_of_the_sliding_laws_are_within_the_stored_spread(name, task, law):
    duration = RUNS[name, task]
    found = measured(run(mm.load_robot(name), law, task, duration), duration)
    problems = list(deviations(found, read(FILE)[f"{name}, {task}, {law}"]))
    assert not problems, "\n".join(problems)


def test_a_gain_that_is_a_millionth_off_is_noticed():
    law = mm.make_controller("tsm", metric_scale=1.0, lambda_1=11.0 * (1 + 1e-6))
    found = measured(run(mm.load_robot("youbot"), law, "circle", 4.0), 4.0)
    problems = list(deviations(found, read(FILE)["youbot, circle, tsm"]))
    assert [problem.partition(":")[0] for problem in problems] == ["e", "q"]


# Making the file ----------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store the runs and their spread; say how large it is, and whether other runs keep within."""
    content = {}
    for name, task, law in CASES:
        robot, duration = mm.load_robot(name), RUNS[name, task]
        generator = np.random.default_rng(0)

        def moved(robot=robot, law=law, task=task, duration=duration, generator=generator):
            q0 = a_last_place_away(robot.q_rest, generator)
            return measured(run(robot, law, task, duration, q0), duration)

        center = measured(run(robot, law, task, duration), duration)
        stored = spread(center, [moved() for _ in range(MOVED)])
        content[f"{name}, {task}, {law}"] = stored
        text = ", ".join(f"{key} {stored[f'{key} spread'].max():.0e}" for key in ("e", "q"))
        low, high = stored["floor"]
        report(
            f"{name}, {task}, {law}: {stored['status']} until {stored['end'].max():g} s; "
            f"spread {text}; floor {low:.1e} to {high:.1e}; settled {stored['settling'][1]}"
        )
        for _ in range(3):
            for problem in deviations(moved(), stored):
                report(f"{name}, {task}, {law}: another run: {problem}")
    write(FILE, content)
