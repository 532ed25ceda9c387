"""Whole runs of the computed-torque laws: every platform type, three scenarios."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.goldens import (
    a_last_place_away,
    differences,
    metric_differences,
    metrics_apart,
    read,
    relative_difference,
    steady_metrics,
    write,
)

import mobman as mm

FILE = "computed_torque.h5"
LAWS = ("pseudo-inverse", "damped-least-squares", "extended-jacobian")
SCENARIOS = ("nominal", "heavier", "disturbed")
ROBOTS = (
    *("youbot", "tiago_no_hand", "tiago_dual"),  # differential
    *("husky_ur5", "jackal_z1"),  # skid-steer
    *("ridgeback_panda", "youbot_mecanum", "ridgeback_ur10", "tiago_pro"),  # omnidirectional
    *("hunter_ur10", "fixed_panda"),  # car-like, fixed
)
IN_CI = ("youbot", "tiago_no_hand", "ridgeback_panda", "hunter_ur10", "fixed_panda")
DURATION, DT, INSTANTS, SEED = 0.5, 1e-3, 10, 5
SAMPLES = ("q", "z", "torque", "task_error", "auxiliary_error")
TOLERANCE = 1e-9


def run(robot: mm.MobileManipulator, law: str, scenario: str, q0=None) -> mm.Record:
    """The run of a case."""
    return mm.simulate(
        *(robot, law, "circle"), duration=DURATION, dt=DT, q0=q0, scenario=scenario, seed=SEED
    )


def measured(record: mm.Record) -> dict:
    """Samples, end and metrics of a run, as stored."""
    rows = np.linspace(0, len(record.t) - 1, INSTANTS + 1).round().astype(int)[1:]
    found = {name: getattr(record, name)[rows] for name in SAMPLES}
    end = {"status": record.status, "samples": len(record.t)}
    return {**found, "end": json.dumps(end), "metrics": json.dumps(steady_metrics(record.metrics))}


def deviations(found: dict, stored: dict):
    """List the deviations of a run from the stored one."""
    found, stored = dict(found), dict(stored)
    yield from metric_differences(
        json.loads(found.pop("metrics")), json.loads(stored.pop("metrics")), TOLERANCE
    )
    yield from differences(found, stored, TOLERANCE)


@pytest.mark.parametrize(
    "name", [n if n in IN_CI else pytest.param(n, marks=pytest.mark.slow) for n in ROBOTS]
)
def test_runs_of_the_computed_torque_laws_are_those_stored(name):
    robot, stored = mm.load_robot(name), read(FILE)[name]
    problems = [
        f"{law}, {scenario}: {problem}"
        for law in LAWS
        for scenario in SCENARIOS
        for problem in deviations(measured(run(robot, law, scenario)), stored[f"{law}, {scenario}"])
    ]
    assert not problems, "\n".join(problems)


def test_a_gain_that_is_a_millionth_off_is_noticed():
    stored = read(FILE)["youbot"]["pseudo-inverse, nominal"]
    law = mm.make_controller("pseudo-inverse", K_p=25.0 * (1 + 1e-6))
    found = measured(run(mm.load_robot("youbot"), law, "nominal"))
    assert {"q", "z", "torque"} <= {item.partition(":")[0] for item in deviations(found, stored)}


# Making the file ----------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store the runs; say where rounding would show."""
    generator, content = np.random.default_rng(0), {}
    for name in ROBOTS:
        robot, own = mm.load_robot(name), {}
        for law in LAWS:
            for scenario in SCENARIOS:
                record = run(robot, law, scenario)
                found = own[f"{law}, {scenario}"] = measured(record)
                moved = run(robot, law, scenario, a_last_place_away(robot.q_rest, generator))
                _report_rounding(f"{name}, {law}, {scenario}", found, measured(moved), report)
        content[name] = own
    write(FILE, content)


def _report_rounding(case: str, found: dict, moved: dict, report) -> None:
    if moved["end"] != found["end"]:
        report(f"{case}: ends otherwise with the last place of q0")
        return
    shares = {name: relative_difference(moved[name], found[name]) for name in SAMPLES}
    (one, residuals), (other, others) = (
        metrics_apart(json.loads(some["metrics"])) for some in (found, moved)
    )
    shares |= {name: relative_difference(other[name], one[name]) for name in one}
    shares |= {name: 1e3 * abs(others[name] - residuals[name]) for name in residuals}
    for name, share in shares.items():
        if share > TOLERANCE / 10:
            report(f"{case}: {name} moves by {share:.0e} with the last place of q0")
