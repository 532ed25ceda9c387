"""Errors of masses, inertias and centres of mass, link by link, and loads at the tip."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.settings import setting
from support.states import random_states

import mobman as mm
from mobman.errors import SpecError
from mobman.simulation.differences import carried_mass
from mobman.simulation.scenario import Scenario


def _true(robot, *pieces, seed=0, **fields):
    scenario = Scenario(name="s", inertias=list(pieces), **fields)
    return scenario.true_robot(setting(robot, seed))


def _links(**fields):
    return {"type": "links", **fields}


def _bodies(robot):
    """(name of the joint, nominal inertia) of every body with a mass."""
    model = robot.model
    return [
        (i, model.names[i], model.inertias[i])
        for i in range(1, model.njoints)
        if model.inertias[i].mass > 0.0
    ]


def test_factor_of_all_links_is_the_mass_factor(robot):
    by_piece, by_field = _true(robot, _links(mass_factor=1.3)), _true(robot, mass_factor=1.3)
    for q, z in random_states(robot, 3):
        one, other = by_piece.dynamics(q, z), by_field.dynamics(q, z)
        assert np.allclose(one.M, other.M, rtol=1e-12, atol=1e-14)
        assert np.allclose(one.bias, other.bias, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    ("name", "pattern", "joints"),
    [
        ("youbot", "y_2", {"y_2"}),
        ("youbot", "y_?", {"y_1", "y_2", "y_3"}),
        ("youbot", ["phi_1", "y_3"], {"phi_1", "y_3"}),
        ("youbot", "platform", {"base_theta"}),  # the link's name
        ("tiago_no_hand", "arm_[12]_joint", {"arm_1_joint", "arm_2_joint"}),
        ("tiago_no_hand", "arm_3_link", {"arm_3_joint"}),
    ],
)
def test_links_are_chosen_by_name_or_pattern(name, pattern, joints):
    robot = mm.load_robot(name)
    true = _true(robot, _links(links=pattern, mass_factor=2.0))
    changed = {
        joint for i, joint, body in _bodies(robot) if true.model.inertias[i].mass != body.mass
    }
    assert changed == joints


def test_part_chooses_on_any_robot(robot):
    arm = {robot.joint_names[i] for i in robot.arm_index}
    arm |= {one.joint for one in robot.followers if one.of in arm}
    for part, expected in (("arm", lambda n: n in arm), ("platform", lambda n: n not in arm)):
        true = _true(robot, _links(part=part, mass_factor=2.0))
        for i, joint, body in _bodies(robot):
            factor = 2.0 if expected(joint) else 1.0
            assert np.isclose(true.model.inertias[i].mass, factor * body.mass)


def test_name_of_no_link_is_told(youbot):
    with pytest.raises(SpecError, match=r"'y_9' fits no link that has a mass.*y_3"):
        _true(youbot, _links(links=["y_1", "y_9"]))


def test_spread_is_uniform_for_each_body_and_physical(robot):
    masses, turnings = [], []
    for seed in range(30):
        piece = _links(mass_spread=0.3, inertia_spread=0.2, centre_spread=0.5)
        model = _true(robot, piece, seed=seed).model
        for i, _, body in _bodies(robot):
            true = model.inertias[i]
            masses.append(true.mass / body.mass)
            if np.trace(body.inertia) > 0.0:
                turnings.append(np.trace(true.inertia) / np.trace(body.inertia) / masses[-1])
                moments = np.linalg.eigvalsh(true.inertia)
                own = np.linalg.eigvalsh(body.inertia)
                excess = moments[2] - moments[0] - moments[1]
                assert moments[0] >= 0.0 or own[0] < 0.0
                assert excess <= 1e-9 * moments[2] or own[2] > own[0] + own[1]
                gyration = np.sqrt(np.trace(body.inertia) / 2.0 / body.mass)
                assert np.abs(true.lever - body.lever).max() <= 0.5 * gyration + 1e-12
    for values, spread in ((masses, 0.3), (turnings, 0.2)):
        assert 1.0 - spread - 1e-9 <= min(values) < 1.0 - 0.8 * spread
        assert 1.0 + 0.8 * spread < max(values) <= 1.0 + spread + 1e-9


def test_each_body_has_a_factor_of_its_own(tiago):
    model = _true(tiago, _links(mass_spread=0.2)).model
    factors = {round(model.inertias[i].mass / body.mass, 9) for i, _, body in _bodies(tiago)}
    assert len(factors) == len(_bodies(tiago))


def test_choice_of_links_leaves_the_others_factors_as_they_are(tiago):
    some, every = (
        _true(tiago, _links(links=links, mass_spread=0.2)).model for links in ("arm_*", "*")
    )
    i = tiago.model.getJointId("arm_3_joint")
    assert some.inertias[i].mass == every.inertias[i].mass


def test_true_inertia_stays_positive_definite(robot):
    true = _true(robot, _links(mass_spread=0.9, inertia_spread=0.9, centre_spread=1.0))
    for q, z in random_states(robot, 5):
        assert np.linalg.eigvalsh(true.dynamics(q, z).M)[0] > 0.0


def test_centre_of_mass_is_moved(youbot):
    offset = np.array([0.01, -0.02, 0.03])
    true = _true(youbot, _links(links="y_2", centre_offset=offset.tolist()))
    i = youbot.model.getJointId("y_2")
    assert np.allclose(true.model.inertias[i].lever - youbot.model.inertias[i].lever, offset)
    # potential energy by the mass times the height that the centre gains
    data = youbot.model.createData()
    for q, _ in random_states(youbot, 3):
        pin.forwardKinematics(youbot.model, data, q)
        lifted = youbot.model.inertias[i].mass * 9.81 * (data.oMi[i].rotation @ offset)[2]
        gained = true.energy(q, np.zeros(5)) - youbot.energy(q, np.zeros(5))
        assert np.isclose(gained, lifted, atol=1e-10)


@pytest.mark.parametrize("inertia", [[0.02, 0.03, 0.04], [0.03, 0.001, -0.002, 0.02, 0.003, 0.04]])
def test_payload_is_a_body_fixed_to_the_tip(robot, inertia):
    """Kinetic energy of a body that moves with the tip's frame."""
    offset = np.array([0.03, -0.01, 0.05])
    piece = {"type": "payload", "mass": 1.7, "offset": offset.tolist(), "inertia": inertia}
    true = _true(robot, piece)
    if len(inertia) == 3:
        tensor = np.diag(inertia)
    else:
        xx, xy, xz, yy, yz, zz = inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    for q, z in random_states(robot, 5):
        jacobian = robot.tip_jacobian(q) @ robot.velocity_map(q)
        rotation = robot.tip_pose(q).rotation
        v, w = (jacobian @ z)[:3], (jacobian @ z)[3:]
        centre = v + np.cross(w, rotation @ offset)
        turning = w @ rotation @ tensor @ rotation.T @ w
        expected = 0.5 * 1.7 * centre @ centre + 0.5 * turning
        gained = 0.5 * z @ (true.dynamics(q, z).M - robot.dynamics(q, z).M) @ z
        assert np.isclose(gained, expected, rtol=1e-8, atol=1e-10)


def test_payload_of_the_piece_is_that_of_the_field_and_pinocchios(youbot):
    by_piece = _true(youbot, {"type": "payload", "mass": 1.7})
    by_field = _true(youbot, payload=1.7)
    model = youbot.model.copy()
    tip = model.frames[youbot.tip_frame]
    point = pin.Inertia(1.7, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(tip.parentJoint, point, tip.placement)
    for true in (by_piece.model, by_field.model):
        assert all(a == b for a, b in zip(true.inertias, model.inertias, strict=True))


def test_share_is_of_the_links_from_the_platform_to_the_tip(tiago, youbot):
    # 2.496 kg are links 3 to 5 and the gripper, see the paper
    own = {name: body.mass for _, name, body in _bodies(youbot)}
    assert np.isclose(carried_mass(youbot), own["y_1"] + own["y_2"] + own["y_3"])
    assert 10.0 < carried_mass(tiago) < 25.0  # torso and arm, not the base
    true = _true(youbot, {"type": "payload", "share": 0.1})
    total = pin.computeTotalMass(true.model) - pin.computeTotalMass(youbot.model)
    assert np.isclose(total, 0.1 * carried_mass(youbot))


def test_pieces_act_one_after_the_other_and_before_the_payload_field(youbot):
    true = _true(
        youbot, _links(links="y_3", mass_factor=2.0), _links(mass_factor=1.5),
        mass_factor=1.1, payload=1.0,
    )  # fmt: skip
    i = youbot.model.getJointId("y_3")
    expected = 2.0 * 1.5 * 1.1 * youbot.model.inertias[i].mass + 1.0
    assert np.isclose(true.model.inertias[i].mass, expected)


def test_nothing_changed_is_the_same_robot(youbot):
    assert Scenario(name="s").true_robot(setting(youbot)) is youbot


def test_plant_may_be_a_scenario_with_random_links(youbot):
    """From the run's seed, as if it were the run's own scenario."""
    options = {"duration": 0.01, "seed": 3}
    found = mm.simulate(youbot, "pseudo-inverse", "circle", plant="uncertain", **options)
    expected = mm.simulate(youbot, "pseudo-inverse", "circle", scenario="uncertain", **options)
    assert np.array_equal(found.q, expected.q)
