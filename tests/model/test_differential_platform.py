"""The differential platform against the paper's matrices, typed here again: (2), (5), (6), (7)."""

from __future__ import annotations

from math import cos, sin
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from support.differences import derivative, jacobian, relative

from mobman.model.platforms.differential import Differential
from mobman.model.platforms.platform import platforms
from mobman.model.platforms.wheels import Site

R, W = 0.05, 0.158  # the paper's
OFFSETS = {"axle": 0.0, "arm mount": 0.167}
ALPHAS = {"paper": 2.0 / R, "wheel-rates": 1.0}


def _platform(offset=0.0, alpha="wheel-rates", signs=(1.0, 1.0)):
    """The paper's, on wheels about y, or -y where the sign is -1."""
    parts = ['<robot name="r"><link name="base"/>']
    for name, y, sign in zip("rl", (-W, W), signs, strict=True):
        parts.append(
            f'<link name="{name}_link"/><joint name="{name}" type="continuous"><parent link="base"/>'
            f'<child link="{name}_link"/><origin xyz="0 {y} {R}"/><axis xyz="0 {sign} 0"/></joint>'
        )
    tree = pin.buildModelFromXML("".join([*parts, "</robot>"]))
    fields = {"right_wheel": "r", "left_wheel": "l", "wheel_radius": R, "half_track": W}
    fields |= {"reference_offset": offset, "alpha": alpha}
    return Differential.build(Site(fields, tree, "test", Path()))


@pytest.fixture(params=[(o, a) for o in OFFSETS for a in ALPHAS], ids=lambda p: f"{p[0]}, {p[1]}")
def case(request):
    """Reference point and choice of alpha, all four combinations."""
    offset, alpha = request.param
    platform = _platform(OFFSETS[offset], alpha)
    return platform, OFFSETS[offset], ALPHAS[alpha]


def _states(count=200):
    random = np.random.default_rng(30)
    for _ in range(count):
        x, x_dot, multiplier = random.uniform(-4.0, 4.0, (3, 5))
        yield x, x_dot, multiplier[:3]


def equation_2(theta):
    return [
        [sin(theta), -cos(theta), 0, 0, 0],
        [cos(theta), sin(theta), W, -R, 0],
        [cos(theta), sin(theta), -W, 0, -R],
    ]


def equation_5(theta):
    return [
        [cos(theta), cos(theta)],
        [sin(theta), sin(theta)],
        [1 / W, -1 / W],
        [2 / R, 0],
        [0, 2 / R],
    ]


def equation_6(theta, a):
    return [
        [sin(theta), -cos(theta), a, 0, 0],
        [cos(theta), sin(theta), W, -R, 0],
        [cos(theta), sin(theta), -W, 0, -R],
    ]


def equation_7(theta, a):
    y = R / (2 * W)
    return [
        [y * (W * cos(theta) - a * sin(theta)), y * (W * cos(theta) + a * sin(theta))],
        [y * (W * sin(theta) + a * cos(theta)), y * (W * sin(theta) - a * cos(theta))],
        [y, -y],
        [1, 0],
        [0, 1],
    ]


def test_constraints_on_the_axle_are_equation_2():
    platform = _platform()
    for x, _, _ in _states():
        assert relative(platform.constraint_matrix(x), equation_2(x[2])) < 1e-15


def test_velocity_map_on_the_axle_with_the_papers_alpha_is_equation_5():
    platform = _platform(alpha="paper")
    for x, _, _ in _states():
        assert relative(platform.velocity_map(x), equation_5(x[2])) < 1e-14


def test_constraints_at_any_reference_point_are_equation_6(case):
    platform, offset, _ = case
    for x, _, _ in _states():
        assert relative(platform.constraint_matrix(x), equation_6(x[2], offset)) < 1e-15


def test_velocity_map_at_any_reference_point_is_equation_7_scaled(case):
    """phi' = kappa alpha: 1 in (7), 2/R in (5)."""
    platform, offset, kappa = case
    for x, _, _ in _states():
        expected = kappa * np.array(equation_7(x[2], offset))
        assert relative(platform.velocity_map(x), expected) < 1e-14


def test_velocity_map_is_the_kernel_of_the_constraints(case):
    platform, _, kappa = case
    for x, _, _ in _states():
        product = platform.constraint_matrix(x) @ platform.velocity_map(x)
        assert np.abs(product).max() < 1e-12 * kappa


def test_rates(case):
    platform = case[0]
    for x, x_dot, _ in _states():
        for value, rate in (
            (platform.constraint_matrix, platform.constraint_matrix_rate),
            (platform.velocity_map, platform.velocity_map_rate),
        ):
            expected = derivative(lambda s, x=x, d=x_dot, f=value: f(x + s * d))
            assert relative(rate(x, x_dot), expected) < 1e-9


def test_hessian_and_its_rate(case):
    platform = case[0]
    for x, x_dot, multiplier in _states(40):
        hessian = platform.constraint_hessian(x, multiplier)
        expected = jacobian(lambda p, lam=multiplier: platform.constraint_matrix(p).T @ lam, x)
        assert relative(hessian, expected) < 1e-9
        rate = derivative(
            lambda s, x=x, d=x_dot, lam=multiplier: platform.constraint_hessian(x + s * d, lam)
        )
        assert relative(platform.constraint_hessian_rate(x, x_dot, multiplier), rate) < 1e-9


def test_offset_reference_point_moves_as_the_rigid_body_says():
    """d/dt (x_axle + a (cos theta, sin theta)) for the motion of (5)."""
    a = OFFSETS["arm mount"]
    axle = _platform(alpha="paper")
    ahead = _platform(a, "paper")
    for x, x_dot, _ in _states(50):
        alpha, theta = x_dot[:2], x[2]
        on_axle, moved = axle.velocity_map(x) @ alpha, ahead.velocity_map(x) @ alpha
        turning = a * on_axle[2] * np.array([-sin(theta), cos(theta)])
        assert np.allclose(moved[:2], on_axle[:2] + turning, atol=1e-12)
        assert np.allclose(moved[2:], on_axle[2:], atol=1e-12)


@pytest.mark.parametrize("signs", [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_wheel_that_turns_the_other_way(signs):
    """A wheel about -y rolls forward at a negative rate; alpha stays the wheel's own rate."""
    platform = _platform(0.1, signs=signs)
    usual = _platform(0.1)
    flip = np.diag([1.0, 1.0, 1.0, *signs])
    for x, x_dot, multiplier in _states(40):
        assert np.allclose(platform.constraint_matrix(x), usual.constraint_matrix(x) @ flip)
        assert np.allclose(
            platform.velocity_map(x), flip @ usual.velocity_map(x) @ np.diag(signs), atol=1e-15
        )
        assert np.abs(platform.constraint_matrix(x) @ platform.velocity_map(x)).max() < 1e-14
        rate = derivative(lambda s, x=x, d=x_dot: platform.velocity_map(x + s * d))
        assert relative(platform.velocity_map_rate(x, x_dot), rate) < 1e-9
        hessian = jacobian(lambda p, lam=multiplier: platform.constraint_matrix(p).T @ lam, x)
        assert relative(platform.constraint_hessian(x, multiplier), hessian) < 1e-9


def test_equal_positive_alphas_drive_forward_and_a_larger_right_one_turns_left(case):
    platform = case[0]
    ahead = platform.velocity_map(np.zeros(5)) @ [1.0, 1.0]
    assert ahead[0] > 0.0
    assert np.allclose(ahead[1:3], 0.0)
    assert (platform.velocity_map(np.zeros(5)) @ [1.0, 0.0])[2] > 0.0


def test_motors_drive_the_wheels(case):
    for x, *_ in _states(5):
        assert case[0].actuation(x).tolist() == [[0, 0], [0, 0], [0, 0], [1, 0], [0, 1]]


def test_platform_types_are_found_by_name():
    assert platforms.get("differential") is Differential
