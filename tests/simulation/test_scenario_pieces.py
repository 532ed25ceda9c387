"""What scenarios are composed of: validation, storing, composing, and streams of randomness."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.settings import setting

import mobman as mm
from mobman.errors import SpecError
from mobman.simulation.scenario import GROUPS as REGISTRIES
from mobman.simulation.scenario import Scenario

UNEVEN = 0.1 + 0.2  # a float whose digits are needed in full

ALL = {
    "inertias": [
        {"type": "links", "links": ["*"], "mass_spread": UNEVEN},
        {"type": "payload", "mass": 1.0, "inertia": [0.1, 0.1, 0.1]},
    ],
    "friction": [
        {"type": "viscous", "acceleration": UNEVEN},
        {"type": "coulomb", "torque": 0.1, "velocity": 0.1},
        {"type": "urdf", "factor": 0.5},
    ],
    "disturbances": [
        {"type": "constant", "torque": 1},
        {"type": "sinusoid", "torque": 1.0, "frequency": 2.0},
        {"type": "steps", "torque": 1.0, "interval": 0.1},
        {"type": "noise", "torque": 1.0, "band": [1, 2.5]},
        {"type": "growing", "torque": 1.0, "time": 3.0},
    ],
    "actuation": [
        {"type": "saturation", "factor": 1.0},
        {"type": "rate-limit", "torque": 10.0, "rise_time": 0.01},
        {"type": "delay", "delay": UNEVEN},
        {"type": "gain", "spread": 0.1},
    ],
    "kinematics": [
        {"type": "links", "spread": UNEVEN},
        {"type": "tool", "offset": [0, 0, 0.01]},
        {"type": "wheels", "radius": 1.1},
        {"type": "zeros", "spread": 0.01},
    ],
    "sensors": [
        {"type": "noise", "velocity": 1e-3},
        {"type": "quantisation", "resolution": 1e-4, "velocity": "difference"},
    ],
    "acceleration": {"type": "filtered-difference", "cutoff": 20.0},
    "slip": [
        {"type": "longitudinal", "ratio": 0.02},
        {"type": "lateral", "angle": 0.01},
    ],
}
GROUPS = [name for name, value in ALL.items() if isinstance(value, list)]


@pytest.mark.parametrize("name", mm.list_scenarios())
def test_what_is_stored_is_the_scenario(name):
    scenario = mm.load_scenario(name)
    stored = json.loads(json.dumps(scenario.model_dump(mode="json")))
    again = Scenario.model_validate(stored)
    assert again == scenario
    assert again.model_dump(mode="json") == stored


def test_every_kind_is_stored_with_all_digits_and_defaults():
    scenario = Scenario(name="all", **ALL)
    stored = json.loads(json.dumps(scenario.model_dump(mode="json")))
    assert Scenario.model_validate(stored) == scenario
    assert stored["inertias"][0]["mass_spread"] == UNEVEN
    assert stored["inertias"][0]["inertia_factor"] == 1.0  # not given: its default is there
    assert stored["actuation"][2] == {"type": "delay", "delay": UNEVEN}
    for group in GROUPS:  # and the list above is of every kind that there is
        kinds = REGISTRIES[group][1].names()
        assert {piece["type"] for piece in ALL[group]} == set(kinds)


@pytest.mark.parametrize(
    ("given", "stored"),
    [
        ("exact", "exact"),
        ({"type": "backward-difference"}, "backward-difference"),
        (
            {"type": "robust-differentiator", "lipschitz": 5},
            {"type": "robust-differentiator", "lipschitz": 5.0},
        ),
    ],
)
def test_acceleration_is_a_name_or_a_table(given, stored):
    scenario = Scenario(name="a", acceleration=given)
    assert scenario.model_dump(mode="json")["acceleration"] == stored


@pytest.mark.parametrize(
    ("acceleration", "named"),
    [
        ("filtered-difference", "'filtered-difference': field 'cutoff' is missing"),
        ({"type": "levant"}, "must be one of .*'robust-differentiator'"),
        ({"lipschitz": 1.0}, "table with such a 'type'"),
        (None, "must be one of"),
        ({"type": "robust-differentiator", "lipschitz": []}, "at least 1"),
        ({"type": "robust-differentiator", "lipschitz": [1.0, 0.0]}, "above 0"),
        ({"type": "exact", "cutoff": 1.0}, "'cutoff' is unknown"),
    ],
)
def test_wrong_acceleration_is_refused(acceleration, named):
    with pytest.raises(SpecError, match=f"field 'acceleration' .*{named}"):
        Scenario(name="a", acceleration=acceleration)


@pytest.mark.parametrize("group", [*GROUPS, "acceleration"])
def test_every_kind_and_field_is_documented(group):
    page = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    kinds = REGISTRIES[group][1]
    for name in kinds.names():
        assert f"| `{name}` |" in page
        for field in kinds.get(name).model_fields:
            assert f"`{field}`" in page


def test_every_error_is_told_at_once():
    with pytest.raises(SpecError) as caught:
        Scenario(
            name="wrong",
            payload=-1.0,
            friction=[{"type": "viscous", "torque": -1.0}, {"type": "stiction"}],
            actuation=[{"type": "delay", "delay": "long"}],
            sensors=[{"type": "noise", "speed": 1.0}],
            acceleration={"type": "filtered-difference"},
            slip=[{"ratio": 0.1}],
            extends=["heavierr"],
        )
    for text in (
        "'payload'", "must not be negative", "unknown friction type 'stiction'", "'long'",
        "'speed' is unknown", "'cutoff' is missing", "'slip.0'", "field 'type' is missing",
        "'longitudinal'", "'heavier'",
    ):  # fmt: skip
        assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("group", "piece", "named"),
    [
        ("inertias", {"type": "links", "mass_factor": 0.0}, "greater than 0"),
        ("inertias", {"type": "links", "mass_spread": 1.0}, "less than 1"),
        ("inertias", {"type": "links", "centre_offset": [1.0]}, "at least 3"),
        ("inertias", {"type": "payload"}, "exactly one of 'mass' or 'share'"),
        ("inertias", {"type": "payload", "mass": 1.0, "share": 0.1}, "exactly one of"),
        ("inertias", {"type": "payload", "mass": 1.0, "inertia": [1.0, 1.0, 2.1]}, "no body"),
        ("inertias", {"type": "payload", "mass": 1.0, "inertia": [1, 0, 0, 1, 0]}, "3 entries"),
        ("friction", {"type": "coulomb", "torque": 1.0, "velocity": 0.0}, "greater than 0"),
        ("friction", {"type": "viscous"}, "exactly one of 'torque' or 'acceleration'"),
        ("disturbances", {"type": "noise", "torque": 1.0, "band": [3.0, 2.0]}, "low < high"),
        ("disturbances", {"type": "growing", "torque": 1.0, "time": 0.0}, "greater than 0"),
        ("disturbances", {"type": "growing", "torque": 1.0, "time": 1.0, "power": 0.5}, "power"),
        ("actuation", {"type": "delay", "delay": -1e-3}, "greater than or equal to 0"),
        ("actuation", {"type": "delay", "delay": float("nan")}, "finite"),
        ("actuation", {"type": "delay", "delay": True}, "valid number"),
        ("actuation", {"type": "saturation"}, "at least one of"),
        ("actuation", {"type": "saturation", "torque": 0.0}, "above 0"),
        ("actuation", {"type": "saturation", "torque": 1.0, "factor": 1.0}, "'torque' alone"),
        ("actuation", {"type": "rate-limit", "factor": 1.0}, "'rise_time' is missing"),
        ("sensors", {"type": "noise", "position": -1.0}, "must not be negative"),
        ("sensors", {"type": "noise", "velocity": "1e-3"}, "valid number"),
        ("sensors", {"type": "quantisation"}, "'resolution' is missing"),
        ("slip", {"type": "longitudinal", "ratio": 1.0}, "less than 1"),
        ("slip", {"type": "lateral"}, "at least one of 'angle' or 'velocity'"),
        ("slip", "lateral", "'slip.0' is 'lateral': must be a table$"),
    ],
)
def test_nonsense_is_refused(group, piece, named):
    with pytest.raises(SpecError, match=named) as caught:
        Scenario(name="wrong", **{group: [piece]})
    assert f"'{group}.0" in str(caught.value)


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"friction": [{"type": "viscous", "torque": [1.0, 2.0]}]}, "2 entries.*5 motors"),
        ({"actuation": [{"type": "saturation", "torque": [1.0]}]}, "1 entries.*5 motors"),
        ({"sensors": [{"type": "noise", "position": [1.0]}]}, "1 entries.*8 coordinates.*base_x"),
        ({"sensors": [{"type": "noise", "pose": [1.0]}]}, "1 entries.*3 coordinates of a pose"),
        (
            {"acceleration": {"type": "robust-differentiator", "lipschitz": [1.0, 2.0]}},
            "2 entries.*5 velocities",
        ),
        ({"inertias": [{"type": "links", "links": "elbow*"}]}, "'elbow.' fits no link.*y_1"),
    ],
)
def test_what_does_not_fit_the_robot_is_told(youbot, fields, named):
    with pytest.raises(SpecError, match=named) as caught:
        mm.simulate(
            youbot, "pseudo-inverse", "circle", duration=0.01, scenario=Scenario(name="s", **fields)
        )
    assert "scenario 's'" in str(caught.value)


# A new file --------------------------------------------------------------------------------------

NEW_FILE = """
from mobman.simulation.disturbances import Amplitude
from mobman.simulation.metrics import metric
from mobman.simulation.sensors import Sensor, sensors
from mobman.simulation.pieces import Piece


class Dead(Piece):
    def start(self, setting):
        return Sensor(state=lambda q, z: z.fill(0.0))


sensors.register("{name}", Dead)


@metric("dead_ticks", "1", "number of ticks")
def dead_ticks(run):
    return len(run.t)
"""


@pytest.mark.parametrize(
    ("file", "name"),
    [pytest.param("dead_sensor", "dead-sensor", marks=pytest.mark.slow), ("mine", "dead")],
)
def test_a_new_file_is_all_that_a_piece_and_a_metric_need(tmp_path, file, name):
    """In the folder of the package, whatever it is called."""
    (tmp_path / f"{file}.py").write_text(NEW_FILE.format(name=name), encoding="utf-8")
    code = (
        f"import mobman.simulation; mobman.simulation.__path__.append({str(tmp_path)!r})\n"
        "import mobman as mm\n"
        f"scenario = mm.Scenario(name='s', sensors=[{{'type': {name!r}}}])\n"
        "record = mm.simulate('youbot', 'pseudo-inverse', 'circle', duration=0.01, scenario=scenario)\n"
        "assert record.metrics['dead_ticks'] == 11\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


# Composing -------------------------------------------------------------------------------------


def test_scenario_begins_with_others():
    mixed = Scenario(
        name="mixed", extends=["heavier", "noisy", "disturbed"], payload=0.25,
        disturbances=[{"type": "constant", "torque": 1.0}],
    )  # fmt: skip
    heavier, noisy, disturbed = map(mm.load_scenario, ("heavier", "noisy", "disturbed"))
    assert (mixed.mass_factor, mixed.payload) == (heavier.mass_factor, 0.25)
    assert (mixed.sensors, mixed.acceleration) == (noisy.sensors, noisy.acceleration)
    assert mixed.disturbances[:-1] == disturbed.disturbances
    assert mixed.disturbances[-1].type == "constant"
    assert (mixed.name, mixed.description, mixed.extends) == ("mixed", "", [])


def test_of_a_single_value_the_last_one_given_counts():
    # lighter says nothing of a payload, so that of heavier stays
    assert Scenario(name="m", extends=["heavier", "lighter"]).mass_factor == 0.7
    assert Scenario(name="m", extends=["heavier", "lighter"]).payload == 1.0
    assert Scenario(name="m", extends=["lighter", "heavier"]).mass_factor == 1.3
    assert Scenario(name="m", extends=["heavier"], mass_factor=1.0).mass_factor == 1.0


def test_files_are_found_from_the_file_that_extends_them(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a.toml").write_text('name = "a"\npayload = 0.5\n', encoding="utf-8")
    (tmp_path / "parts" / "b.toml").write_text(
        'name = "b"\nextends = ["a.toml"]\nmass_factor = 1.1\n', encoding="utf-8"
    )
    top = tmp_path / "c.toml"
    top.write_text('name = "c"\nextends = ["parts/b.toml", "delayed"]\n', encoding="utf-8")
    scenario = mm.load_scenario(top)
    assert (scenario.payload, scenario.mass_factor) == (0.5, 1.1)
    assert [piece.type for piece in scenario.actuation] == ["delay"]


def test_circle_is_told(tmp_path):
    for name, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{name}.toml").write_text(
            f'name = "{name}"\nextends = ["{other}.toml"]\n', encoding="utf-8"
        )
    with pytest.raises(SpecError, match=r"comes back to the file itself: a.toml -> b.toml"):
        mm.load_scenario(tmp_path / "a.toml")


# Randomness ------------------------------------------------------------------------------------


def _signals(scenario, robot, seed=0):
    """Something of everything that is random."""
    scenario = Scenario(name="s", **scenario)
    masses = [link.mass for link in scenario.true_robot(setting(robot, seed)).model.inertias]
    push = scenario.disturbance(setting(robot, seed))
    measured = scenario.measurement(setting(robot, seed), robot)(
        robot.q_rest, np.zeros(robot.nz), np.zeros(robot.nz)
    )
    return [np.array(masses), *([] if push is None else [push(0.7)]), *measured]


RANDOM = {
    "inertias": [{"type": "links", "mass_spread": 0.2}],
    "disturbances": [{"type": "noise", "torque": 1.0, "band": [1.0, 5.0]}],
    "sensors": [{"type": "noise", "position": 1e-3, "velocity": 1e-3, "acceleration": 1e-3}],
}


def test_seed_decides(youbot):
    one, same, other = (_signals(RANDOM, youbot, seed) for seed in (1, 1, 2))
    assert all(map(np.array_equal, one, same))
    assert not any(map(np.array_equal, one, other))


@pytest.mark.parametrize("group", ["inertias", "disturbances", "sensors"])
def test_another_piece_changes_no_stream(youbot, group):
    """Not even one that comes before, of the same group."""
    silent = {
        "inertias": {"type": "payload", "mass": 0.0},
        "disturbances": {"type": "steps", "torque": 0.0, "interval": 0.1},
        "sensors": {"type": "quantisation", "resolution": 0.0},
    }[group]
    more = {**RANDOM, group: [silent, *RANDOM[group]]}
    assert all(map(np.array_equal, _signals(RANDOM, youbot), _signals(more, youbot)))


def test_two_of_a_kind_have_streams_of_their_own(youbot):
    first, second = RANDOM["disturbances"][0], {"type": "noise", "torque": 1.0, "band": [1.0, 5.0]}
    once, twice = (
        Scenario(name="s", disturbances=some).disturbance(setting(youbot))(0.7)
        for some in ([first], [first, second])
    )
    assert not np.allclose(twice, 2.0 * once, atol=1e-2)


def test_noise_of_one_quantity_does_not_depend_on_that_of_another(youbot):
    sensors = [{"type": "noise", "velocity": 1e-3}]
    alone = _signals({**RANDOM, "sensors": sensors}, youbot)
    assert np.array_equal(alone[-2], _signals(RANDOM, youbot)[-2])  # z
    assert np.array_equal(alone[-3], youbot.q_rest)


def test_a_piece_does_not_name_its_group():
    with pytest.raises(SpecError, match=r"friction\.0.*field 'group' is unknown"):
        Scenario(name="x", friction=[{"type": "viscous", "torque": 0.1, "group": "sensors"}])
