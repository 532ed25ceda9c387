"""Every scenario that comes with the project, on robots of every type of platform."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.errors import SpecError

ROBOTS = [
    "youbot", "tiago_no_hand", "ridgeback_panda", "hunter_ur10", "jackal_z1", "fixed_panda",
    "lekiwi_so101",
]  # fmt: skip
_robots: dict[str, mm.MobileManipulator] = {}


def _run(name, scenario, seed=0, duration=0.01):
    if name not in _robots:
        _robots[name] = mm.load_robot(name)
    return mm.simulate(
        _robots[name], "pseudo-inverse", "circle", duration=duration, scenario=scenario, seed=seed
    )


@pytest.fixture(scope="module", params=ROBOTS)
def nominal(request):
    return request.param, _run(request.param, "nominal")


@pytest.mark.parametrize("scenario", mm.list_scenarios())
def test_scenario_means_something_on_every_robot(nominal, scenario):
    name, expected = nominal
    if scenario == "urdf-friction" and name == "tiago_no_hand":
        # without its hand, joint 7 has 4e-6 kg m^2, and its motor's 1 N m s
        with pytest.raises(SpecError, match="inertia of what it brakes"):
            _run(name, scenario)
        return
    found = _run(name, scenario)
    assert found.ok, found.message
    assert found.scenario == scenario
    same = np.array_equal(found.q, expected.q)
    # the law does not use z', what does not drive does not slip, and 10 ms need not meet a limit
    # nor is there friction where a URDF states none
    model = _robots[name].model
    idle = scenario in ("nominal", "filtered") or (scenario == "slipping" and name == "fixed_panda")
    if scenario == "urdf-friction":
        idle = not np.any(model.damping) and not np.any(model.upperDryFrictionLimit)
    assert same == idle or scenario in ("saturated", "real-limits")
    # on the ground, tyres and friction take energy
    assert found.metrics["energy_residual"] < 1e-6 or scenario == "contact"


@pytest.mark.parametrize("name", ["youbot", "tiago_no_hand"])
def test_seed_decides_bit_for_bit(name):
    one, same, other = (_run(name, "realistic", seed, 0.03) for seed in (1, 1, 2))
    assert np.array_equal(one.q, same.q)
    assert np.array_equal(one.torque, same.torque)
    assert one.metrics["torque_energy"] == same.metrics["torque_energy"]
    assert not np.array_equal(one.q, other.q)
