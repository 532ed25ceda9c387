"""Scenarios: those with names, and files of one's own."""

from __future__ import annotations

import numpy as np
import pytest
from support.settings import setting

import mobman as mm
from mobman.errors import SpecError, UnknownNameError


def test_named_scenarios_are_listed():
    assert {"nominal", "heavier", "lighter", "disturbed"} <= set(mm.list_scenarios())


@pytest.mark.parametrize("name", mm.list_scenarios())
def test_every_scenario_loads_under_its_name(name):
    scenario = mm.load_scenario(name)
    assert scenario.name == name
    assert scenario.description


def test_values_of_the_named_ones():
    nominal, heavier, lighter = map(mm.load_scenario, ("nominal", "heavier", "lighter"))
    assert (nominal.mass_factor, nominal.inertia_factor, nominal.payload) == (1.0, None, 0.0)
    assert nominal.disturbances == []
    assert (heavier.mass_factor, heavier.inertia_factor, heavier.payload) == (1.3, None, 1.0)
    assert (lighter.mass_factor, lighter.inertia_factor, lighter.payload) == (0.7, None, 0.0)
    kinds = {source.type for source in mm.load_scenario("disturbed").disturbances}
    assert kinds == {"constant", "sinusoid", "steps"}


def test_disturbed_pushes_every_motor(robot):
    torque = mm.load_scenario("disturbed").disturbance(setting(robot))
    values = np.array([torque(t) for t in np.arange(0.0, 10.0, 0.1)])
    assert np.all(np.ptp(values, axis=0) > 0.0)


def test_scenario_of_ones_own(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\nmass_factor = 1.1\nacceleration = "backward-difference"\n', encoding="utf-8"
    )
    scenario = mm.load_scenario(file)
    assert (scenario.name, scenario.mass_factor) == ("mine", 1.1)
    assert scenario.acceleration == "backward-difference"


@pytest.mark.parametrize("name", ["heavy", "heavierr"])
def test_misspelt_scenario_is_answered_with_the_nearest_name(name):
    with pytest.raises(
        UnknownNameError, match=f"unknown scenario '{name}'; did you mean 'heavier'"
    ):
        mm.load_scenario(name)


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("mass = 1.3", ["'mass'", "unknown", "mass_factor", "payload"]),
        ("mass_factor = 0", ["'mass_factor'", "0", "greater than 0"]),
        ("payload = -1", ["'payload'", "-1"]),
        ("payload = inf", ["'payload'", "inf", "finite"]),
        ('acceleration = "measured"', ["'acceleration'", "'measured'", "'exact'"]),
        ("payload = ", ["not valid TOML"]),
    ],
)
def test_broken_scenario_is_refused(tmp_path, line, named):
    file = tmp_path / "mine.toml"
    file.write_text(f'name = "mine"\n{line}\n', encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        mm.load_scenario(file)
    for text in ["mine.toml", *named]:
        assert text in str(caught.value)
