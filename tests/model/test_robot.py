"""What a robot offers: flat coordinates, names, shapes."""

from __future__ import annotations

import inspect

import numpy as np
import pinocchio as pin
import pytest

from mobman.errors import ModelError, UsageError


def test_coordinates_are_flat(robot):
    """nq == nv, and adding a velocity to q is Pinocchio's own integration."""
    model = robot.model
    assert model.nq == model.nv == robot.nq
    random = np.random.default_rng(0)
    q, step = random.standard_normal((2, robot.nq))
    assert np.allclose(pin.integrate(model, q, step), q + step, atol=1e-12)


def test_platform_pose_is_three_joints_of_one_degree(driving_robot):
    """One composite joint of three would make Pinocchio's Jacobian rates wrong."""
    model = driving_robot.model
    for name, kind in (("base_x", "PX"), ("base_y", "PY"), ("base_theta", "RZ")):
        assert model.joints[model.getJointId(name)].shortname() == f"JointModel{kind}"
    assert "JointModelComposite" not in {joint.shortname() for joint in model.joints}


def test_joint_names_are_in_the_order_of_q(robot):
    assert len(robot.joint_names) == len(set(robot.joint_names)) == robot.nq
    for i, name in enumerate(robot.joint_names):
        assert robot.model.joints[robot.model.getJointId(name)].idx_q == i


def test_velocity_names_are_alpha_then_the_arm_in_the_order_of_q(robot):
    arm = [robot.joint_names[i] for i in robot.arm_index]
    assert robot.velocity_names == [*robot.platform.velocity_names, *arm]
    assert list(robot.arm_index) == sorted(robot.arm_index)
    assert len(robot.velocity_names) == robot.nz == robot.nq - robot.k


def test_moving_one_velocity_moves_the_coordinate_of_its_name(robot):
    for i, name in enumerate(robot.velocity_names[robot.n_alpha :], start=robot.n_alpha):
        q_dot = robot.velocity_map(robot.q_rest)[:, i]
        moved = {name, *(one.joint for one in robot.followers if one.of == name)}
        assert {robot.joint_names[k] for k in np.flatnonzero(q_dot)} == moved


def test_shapes_of_the_contract(robot):
    q, z = robot.q_rest, np.ones(robot.nz)
    nq, nz = robot.nq, robot.nz
    assert q.shape == (nq,)
    assert robot.constraint_matrix(q).shape == (robot.k, nq)
    assert robot.velocity_map(q).shape == robot.velocity_map_rate(q, z).shape == (nq, nz)
    dynamics = robot.dynamics(q, z)
    assert dynamics.M.shape == dynamics.B.shape == (nz, nz)
    assert dynamics.bias.shape == (nz,)
    assert robot.tip_jacobian(q).shape == (6, nq)
    assert isinstance(robot.tip_pose(q), pin.SE3)


def test_rest_posture_is_within_the_limits(robot):
    assert np.all(robot.q_rest >= robot.model.lowerPositionLimit)
    assert np.all(robot.q_rest <= robot.model.upperPositionLimit)


def test_rest_posture_is_what_the_description_says(robot):
    for name, value in robot.spec.rest.items():
        if name in robot.joint_names:
            assert robot.q_rest[robot.joint_names.index(name)] == value


def test_criterion_weights_are_what_the_description_says(robot):
    given = robot.spec.criterion
    wheels = {wheel.joint: given.wheels for wheel in robot.platform.wheels}
    base = {"base_x": given.platform, "base_y": given.platform, "base_theta": given.heading}
    following = {*robot.platform.following, *(one.joint for one in robot.followers)}
    expected = {**base, **wheels, **dict.fromkeys(following, 1e-9), **given.weights}
    for name, weight in zip(robot.joint_names, robot.criterion_weights, strict=True):
        assert weight == expected.get(name, given.default)


def test_criterion_couplings_are_what_the_description_says(robot):
    """The rest of K_F is the Hessian of the sum of w/2 (dq_joint - ratio dq_to)^2."""
    random = np.random.default_rng(3)
    for _ in range(5):
        change = random.standard_normal(robot.nq)
        moved = dict(zip(robot.joint_names, change, strict=True))
        expected = sum(
            0.5 * wish.weight * (moved[wish.joint] - wish.ratio * moved[wish.to]) ** 2
            for wish in robot.spec.criterion.couplings
        )
        assert np.isclose(0.5 * change @ robot.criterion_couplings @ change, expected)


def test_results_do_not_change_when_the_robot_is_used_again(robot):
    """Pinocchio hands out views on its workspace for some calls."""
    z = np.ones(robot.nz)
    pose, jacobian = robot.tip_pose(robot.q_rest), robot.tip_jacobian(robot.q_rest)
    dynamics, tip = robot.dynamics(robot.q_rest, z), robot.tip_kinematics(robot.q_rest, z)
    kept = [np.array(part) for part in (pose.homogeneous, jacobian, *dynamics, *tip)]
    other = robot.q_rest + 0.3
    robot.tip_pose(other), robot.tip_jacobian(other)
    robot.dynamics(other, 2 * z), robot.tip_kinematics(other, 2 * z)
    for before, now in zip(kept, (pose.homogeneous, jacobian, *dynamics, *tip), strict=True):
        assert np.array_equal(before, now)


def test_repr_says_which_robot(youbot):
    assert repr(youbot) == "MobileManipulator('youbot', nq=8, nz=5, tip='tip')"


def test_model_of_other_joints_is_refused(youbot, tiago):
    with pytest.raises(ModelError, match="other joints"):
        youbot.with_model(tiago.model)


METHODS = {
    "consistent": ("q",),
    "constraint_matrix": ("q",),
    "constraint_matrix_rate": ("q", "q_dot"),
    "constraint_hessian": ("q", "multiplier"),
    "constraint_hessian_rate": ("q", "q_dot", "multiplier"),
    "velocity_map": ("q",),
    "velocity_map_rate": ("q", "z"),
    "velocity": ("q", "z"),
    "actuation": ("q",),
    "reduced_inertia": ("q",),
    "dynamics": ("q", "z"),
    "motor_inertia": ("q",),
    "holding_torque": ("q",),
    "energy": ("q", "z"),
    "tip_pose": ("q",),
    "arm_origin": ("q",),
    "tip_jacobian": ("q",),
    "tip_kinematics": ("q", "z"),
}
LENGTHS = {"q": 8, "q_dot": 8, "z": 5, "multiplier": 3}


def vectors(names):
    return [np.full(LENGTHS[name], 0.1) for name in names]


@pytest.mark.parametrize(("method", "names"), METHODS.items())
def test_methods_take_lists_as_arrays(youbot, method, names):
    def flat(result):
        return np.hstack(
            [
                np.ravel(np.array(part))
                for part in (result if isinstance(result, tuple) else [result])
            ]
        )

    arrays = vectors(names)
    function = getattr(youbot, method)
    expected = flat(function(*arrays))
    assert np.array_equal(flat(function(*(vector.tolist() for vector in arrays))), expected)


@pytest.mark.parametrize(("method", "names"), METHODS.items())
def test_methods_refuse_vectors_that_do_not_fit(youbot, method, names):
    for i, name in enumerate(names):
        n = LENGTHS[name]
        for wrong, reason in (
            (np.zeros(n + 1), rf"^{name} has shape \({n + 1},\); needed: \({n},\)$"),
            (np.zeros((n, 1)), rf"^{name} has shape \({n}, 1\); needed: \({n},\)$"),
            (0.0, rf"^{name} has shape \(\); needed: \({n},\)$"),
            (np.full(n, np.nan), rf"^{name} = \[nan, .*; needed: {n} finite numbers$"),
            ("abc", rf"^{name} = 'abc'; needed: {n} numbers$"),
            (None, rf"^{name} "),
        ):
            arguments = vectors(names)
            arguments[i] = wrong
            with pytest.raises(UsageError, match=reason):
                getattr(youbot, method)(*arguments)


def test_every_method_that_takes_a_vector_is_in_the_list(robot):
    found = {
        name
        for name, item in vars(type(robot)).items()
        if inspect.isfunction(item)
        and not name.startswith("_")
        and {"q", "z"} & set(inspect.signature(item).parameters)
    }
    assert found - {"checked_configuration"} == set(METHODS)
