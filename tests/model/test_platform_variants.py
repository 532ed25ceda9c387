"""One physical robot described with other coordinates behaves as one physical robot."""

from __future__ import annotations

import numpy as np
import pytest
from support.states import random_states
from support.variants import description, youbot_urdf, youbot_with_urdf

import mobman as mm

OFFSET = 0.167
VARIANTS = {
    "axle, wheel-rates": {"platform__alpha": "wheel-rates"},
    "mount, paper": {"platform__reference_offset": OFFSET},
    "mount, wheel-rates": {"platform__reference_offset": OFFSET, "platform__alpha": "wheel-rates"},
}


@pytest.fixture(scope="module", params=VARIANTS)
def variant(request):
    """A youBot in other coordinates than the paper's (axle, alpha of (5))."""
    return mm.load_robot(description(**VARIANTS[request.param]))


def _same_state(youbot, other, q, z):
    """(q, z) of the paper's youBot in the other one's coordinates, and phi' = kappa alpha."""
    q_other, z_other = q.copy(), z.copy()
    theta = q[2]
    q_other[:2] += other.platform.offset * np.array([np.cos(theta), np.sin(theta)])
    z_other[:2] *= youbot.platform.kappa / other.platform.kappa
    return q_other, z_other


def test_tip_pose_and_velocity(youbot, variant):
    for q, z in random_states(youbot, 50):
        q_other, z_other = _same_state(youbot, variant, q, z)
        pose, other = youbot.tip_pose(q), variant.tip_pose(q_other)
        assert np.allclose(pose.homogeneous, other.homogeneous, atol=1e-12)
        twist = youbot.tip_jacobian(q) @ youbot.velocity_map(q) @ z
        moved = variant.tip_jacobian(q_other) @ variant.velocity_map(q_other) @ z_other
        assert np.allclose(twist, moved, atol=1e-11)


def test_energy(youbot, variant):
    for q, z in random_states(youbot, 50):
        q_other, z_other = _same_state(youbot, variant, q, z)
        assert np.isclose(youbot.energy(q, z), variant.energy(q_other, z_other), rtol=1e-12)


def test_acceleration_under_the_same_torques(youbot, variant):
    """The torques are those of the motors whatever alpha is."""
    random = np.random.default_rng(41)
    ratio = np.ones(youbot.nz)
    ratio[:2] = youbot.platform.kappa / variant.platform.kappa
    for q, z in random_states(youbot, 50):
        q_other, z_other = _same_state(youbot, variant, q, z)
        torque = random.standard_normal(youbot.nz)
        accelerations = []
        for robot, state in ((youbot, (q, z)), (variant, (q_other, z_other))):
            m, bias, b = robot.dynamics(*state)
            accelerations.append(np.linalg.solve(m, b @ torque - bias))
        scale = np.abs(accelerations[1]).max()
        assert np.allclose(ratio * accelerations[0], accelerations[1], atol=1e-10 * scale)


def test_wheel_with_its_axis_to_the_right(youbot, tmp_path):
    """The same machine with one wheel's joint about -y: its rate and torque change sign."""
    text = youbot_urdf().replace(
        '<origin xyz="0 -0.158 0.05"/><axis xyz="0 1 0"/>',
        '<origin xyz="0 -0.158 0.05"/><axis xyz="0 -1 0"/>',
    )
    assert text != youbot_urdf()
    other = mm.load_robot(youbot_with_urdf(tmp_path, text))
    flip_q, flip_z = np.ones(youbot.nq), np.ones(youbot.nz)
    flip_q[youbot.joint_names.index("phi_1")] = flip_z[0] = -1.0
    for q, z in random_states(youbot, 20):
        assert np.allclose(
            other.velocity_map(flip_q * q) @ (flip_z * z), flip_q * (youbot.velocity_map(q) @ z)
        )
        m, bias, b = youbot.dynamics(q, z)
        m_other, bias_other, b_other = other.dynamics(flip_q * q, flip_z * z)
        assert np.allclose(m_other, np.outer(flip_z, flip_z) * m, atol=1e-10)
        assert np.allclose(bias_other, flip_z * bias, atol=1e-9)
        assert np.allclose(b_other, b)


def test_effective_track_replaces_the_urdfs(youbot):
    """Half as wide a track turns twice as fast."""
    narrow = mm.load_robot(description(platform__half_track=0.079))
    q = youbot.q_rest
    assert np.isclose(youbot.platform.half_track, 0.158)
    turning = [robot.velocity_map(q)[2, 0] for robot in (youbot, narrow)]
    assert np.isclose(turning[1], 2.0 * turning[0])


def test_wheels_stand_on_the_ground_whatever_the_urdfs_origin(tmp_path, youbot):
    """The root link of this URDF is at the wheels' centres, behind the axle and above the ground."""
    text = youbot_urdf()
    for old, new in (
        ('<origin xyz="0 -0.158 0.05"/><axis', '<origin xyz="0.1 -0.158 0"/><axis'),
        ('<origin xyz="0 0.158 0.05"/><axis', '<origin xyz="0.1 0.158 0"/><axis'),
        ('<origin xyz="0.167 0 0.245"/><axis', '<origin xyz="0.267 0 0.195"/><axis'),
        ('<origin xyz="0 0 0.084"/>\n      <mass', '<origin xyz="0.1 0 0.034"/>\n      <mass'),
    ):
        assert old in text
        text = text.replace(old, new)
    moved = mm.load_robot(youbot_with_urdf(tmp_path, text))
    assert np.allclose(moved.platform.root_offset, [-0.1, 0.0, 0.05])
    for q, z in random_states(youbot, 10):
        assert np.allclose(moved.tip_pose(q).homogeneous, youbot.tip_pose(q).homogeneous)
        assert np.allclose(moved.dynamics(q, z).M, youbot.dynamics(q, z).M)
