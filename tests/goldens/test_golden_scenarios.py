"""Effects of every scenario on plant, torque and measurements, in short runs."""

from __future__ import annotations

import numpy as np
import pytest
from support.goldens import a_last_place_away, differences, read, write

import mobman as mm

FILE = "scenarios.h5"
TOLERANCE = 1e-9
ROBOTS = ("youbot", "ridgeback_panda")
DURATION, DT, SEED = 0.05, 1e-3, 7
EVERY = 5
OWN = {
    # pieces that no named scenario has, or that act later there
    "backward difference": {"acceleration": "backward-difference"},
    "random steps": {"disturbances": [{"type": "steps", "acceleration": 2.0, "interval": 0.01}]},
    "inertia alone": {"mass_factor": 1.2, "inertia_factor": 0.7, "payload": 0.3},
    "delay and saturation": {
        "actuation": [
            {"type": "delay", "delay": 0.0035},
            {"type": "saturation", "factor": 0.05, "acceleration": 5.0},
        ]
    },
    "all sensors": {
        "sensors": [
            {"type": "noise", "position": 1e-4, "pose": 1e-3, "velocity": 1e-2},
            {"type": "quantisation", "resolution": 1e-3, "velocity": "difference"},
        ],
        "acceleration": {"type": "robust-differentiator", "lipschitz": 100.0},
    },
}


class Measuring:
    """Law that records its measurements."""

    name = "measuring"

    def __init__(self):
        self._law = mm.make_controller("extended-jacobian")

    def reset(self, robot, task, dt):
        self._law.reset(robot, task, dt)
        self._measured = {"measured/q": robot.q_rest, "measured/z": np.zeros(robot.nz)}
        self._measured["measured/z_dot"] = np.zeros(robot.nz)

    def step(self, t, q, z, z_dot):
        self._measured = {"measured/q": q, "measured/z": z, "measured/z_dot": z_dot}
        return self._law.step(t, q, z, z_dot)

    def signals(self):
        return self._measured


def measured(robot: mm.MobileManipulator, name: str, q0=None, seed=SEED) -> dict:
    """Samples of a run under a scenario, and all that its record has as signals."""
    fields = OWN.get(name)
    scenario = name if fields is None else mm.Scenario(name=name.replace(" ", "-"), **fields)
    record = mm.simulate(
        robot, Measuring(), "circle", duration=DURATION, dt=DT, q0=q0, scenario=scenario, seed=seed
    )
    samples = {"q": record.q, "z": record.z, "torque": record.torque}
    samples |= {key.replace("/", " "): value for key, value in record.signals.items()}
    return {"status": record.status, **{key: value[::EVERY] for key, value in samples.items()}}


@pytest.mark.parametrize("name", ROBOTS)
def test_effects_of_scenarios_are_those_stored(name):
    robot = mm.load_robot(name)
    problems = [
        f"{scenario}: {problem}"
        for scenario, stored in read(FILE)[name].items()
        for problem in differences(measured(robot, scenario), stored, TOLERANCE)
    ]
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("scenario", ["noisy", "disturbed", "uncertain"])
def test_another_seed_is_noticed(scenario):
    found = measured(mm.load_robot("youbot"), scenario, seed=SEED + 1)
    assert list(differences(found, read(FILE)["youbot"][scenario], TOLERANCE))


# Making the file ----------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store the runs; say where rounding would show, and which scenarios do nothing."""
    content, generator = {}, np.random.default_rng(0)
    for name in ROBOTS:
        robot = mm.load_robot(name)
        found = {scenario: measured(robot, scenario) for scenario in (*mm.list_scenarios(), *OWN)}
        for scenario, samples in found.items():
            moved = measured(robot, scenario, a_last_place_away(robot.q_rest, generator))
            for problem in differences(moved, samples, TOLERANCE / 10):
                report(f"{name}, {scenario}, with the last place of q0: {problem}")
            if scenario != "nominal" and not any(differences(samples, found["nominal"], 1e-7)):
                report(f"{name}, {scenario}: nothing differs from nominal")
        content[name] = found
    write(FILE, content)
