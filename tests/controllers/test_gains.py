"""Gains: the paper's defaults, and what theory refuses, with the reason."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction
from itertools import product

import pytest

import mobman as mm
from mobman.controllers.protocol import controllers
from mobman.errors import GainError, UnknownNameError, UsageError

SLIDING = ["tsm", "tsm-simplified", "tsm-inverse-actuation", "tsm-null-space"]
REDUNDANT = ["pseudo-inverse", "damped-least-squares"]


@pytest.mark.parametrize("law", SLIDING)
def test_defaults_are_the_papers_but_for_the_bounds(law):
    settings = mm.make_controller(law).settings()
    expected = {
        "lambda_0": 1, "lambda_1": 11, "lambda_2": 6, "c": 2, "c_0": 1, "w_1": 1.5, "w_2": 0.001,
        "w_3k": 2, "w_4k": 3, "Lambda_0": 11, "Lambda_1": 6, "alpha_1": "3/5", "C": 2, "C_0": 1,
        "w_3": 3, "w_4": 9, "w_5": 12, "w_6": 0, "w_7": 6, "w_8": 0.011, "w_9": 6, "beta_0": 0,
        "beta_1": 0, "c_F": 1, "a": "auto", "A": "auto", "discretization": "implicit",
        "boundary_layer": 0,
    }  # fmt: skip
    assert {name: settings[name] for name in expected} == expected


@pytest.mark.parametrize("law", ["pseudo-inverse", "damped-least-squares", "extended-jacobian"])
def test_defaults_of_the_baselines(law):
    settings = mm.make_controller(law).settings()
    assert (settings["K_p"], settings["K_v"]) == (25.0, 10.0)


@pytest.mark.parametrize("law", mm.list_controllers())
def test_every_gain_says_what_it_is(law):
    for field in dataclasses.fields(controllers.get(law).Gains):
        assert field.metadata["meaning"]
        assert "unit" in field.metadata


# gain, value, what the message gives as the reason
REFUSED = [
    ("c", 0.99, "at least 1 (Theorem 1)"),
    ("C", 0.99, "at least 1 (Theorem 2)"),
    ("c", -2.0, "at least 1 (Theorem 1)"),
    ("a", 0.0, "0 < a <= lambda_min(J J^T) (22)"),
    ("a", -0.2, "0 < a <= lambda_min(J J^T) (22)"),
    ("a", "automatic", "must be 'auto' or a number above 0"),
    ("A", 0.0, "0 < A <= lambda_min(B B^T) (54)"),
    ("A", "0.2", "must be 'auto' or a number above 0"),
    ("A", [0.2, 0.2], "must be one number"),
    ("c", [2.0, 3.0], "must be one number"),
    ("metric_scale", [1.0, 1.0], "must be one number"),
    ("lambda_0", 0.0, "above 0"),
    ("lambda_1", -11.0, "above 0"),
    ("lambda_2", [6.0, 6.0, 0.0, 6.0, 6.0], "above 0"),
    ("Lambda_0", 0.0, "above 0"),
    ("Lambda_1", [], "finite number"),
    ("c_0", 0.0, "above 0"),
    ("C_0", 0.0, "above 0"),
    ("w_1", 0.0, "above 0"),
    ("w_4k", -1.0, "above 0"),
    ("w_9", -1.0, "not be negative"),
    ("beta_1", -1.0, "not be negative"),
    ("c_F", 0.0, "above 0"),
    ("K_F", [1.0, 0.0], "above 0"),
    ("metric_scale", 0.0, "above 0"),
    ("boundary_layer", -1e-3, "not be negative"),
    ("discretization", "euler", "one of 'implicit', 'explicit'"),
]


@pytest.mark.parametrize("law", SLIDING)
@pytest.mark.parametrize(("name", "value", "reason"), REFUSED)
def test_gain_that_theory_forbids_is_refused_with_the_reason(law, name, value, reason):
    with pytest.raises(GainError) as caught:
        mm.make_controller(law, **{name: value})
    assert str(caught.value).startswith(f"{name} = {value!r}")
    assert reason in str(caught.value)
    assert caught.value.exit_status == 2


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *product(
            ["c", "lambda_2", "Lambda_0", "w_5", "boundary_layer"],
            [math.nan, math.inf, "6", None, True],
        ),
        *product(["lambda_2", "Lambda_0"], [[6.0, math.nan], [6.0, True]]),
    ],
)
def test_what_is_no_finite_number_is_refused(name, value):
    with pytest.raises(GainError, match=rf"^{name} = .*finite number"):
        mm.make_controller("tsm", **{name: value})


@pytest.mark.parametrize("value", [math.nan, math.inf, True])
def test_bounds_are_finite_numbers_too(value):
    with pytest.raises(GainError, match=r"^a = "):
        mm.make_controller("tsm", a=value)


@pytest.mark.parametrize(
    "value",
    [
        0.5,
        "2/3",
        "1/3",
        1 / 3,
        1.0,
        "4/6",
        "3/7",
        "5/3",
        0.0,
        -0.6,
        0.61803398875,
        math.nan,
        "x",
        None,
        "1/0",
    ],
)
def test_alpha_1_must_be_a_ratio_of_odd_numbers(value):
    """(51): n1, n2 odd and n1 < n2 < 2 n1."""
    with pytest.raises(
        GainError, match=r"^alpha_1 = .*n1/n2 with n1 and n2 odd and n1 < n2 < 2 n1"
    ):
        mm.make_controller("tsm", alpha_1=value)


@pytest.mark.parametrize(
    ("value", "ratio"),
    [("3/5", "3/5"), (0.6, "3/5"), (Fraction(5, 7), "5/7"), (7 / 9, "7/9"), ("9/15", "3/5")],
)
def test_alpha_1_may_be_a_text_a_number_or_a_fraction(value, ratio):
    assert mm.make_controller("tsm", alpha_1=value).settings()["alpha_1"] == ratio


@pytest.mark.parametrize(
    "name", ["lambda_0", "lambda_1", "lambda_2", "Lambda_0", "Lambda_1", "K_F"]
)
@pytest.mark.parametrize("law", SLIDING)
def test_diagonal_of_a_wrong_length_is_refused_when_the_robot_is_known(law, name, youbot):
    controller = mm.make_controller(law, **{name: [1.0] * 4})
    needed = {"K_F": youbot.nq, "Lambda_0": youbot.nz, "Lambda_1": youbot.nz}.get(
        name, 3 if law in ("tsm-simplified", "tsm-null-space") else youbot.nz
    )
    with pytest.raises(GainError, match=rf"^{name} has 4 entries; needed: one number, or {needed}"):
        controller.reset(youbot, mm.make_task("paper", youbot), 1e-3)


def test_diagonal_of_the_right_length_is_taken(youbot):
    gains = {"lambda_2": [6.0] * 5, "Lambda_0": [11.0] * 5, "K_F": [0.01] * 8}
    controller = mm.make_controller("tsm", a=0.2, A=0.2, **gains)
    controller.reset(youbot, mm.make_task("paper", youbot), 1e-3)
    assert controller.settings()["lambda_2"] == [6.0] * 5
    assert controller.criterion.hessian(youbot.q_rest).diagonal().tolist() == [0.01] * 8


@pytest.mark.parametrize("law", REDUNDANT)
@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("K_p", 0.0, "above 0"),
        ("K_v", -1.0, "above 0"),
        ("k_0", -1.0, "not be negative"),
        ("k_d", math.nan, "finite"),
        ("c_F", 0.0, "above 0"),
        ("K_F", -1.0, "above 0"),
    ],
)
def test_gains_of_the_baselines(law, name, value, reason):
    with pytest.raises(GainError, match=reason):
        mm.make_controller(law, **{name: value})


def test_damping_must_be_positive():
    with pytest.raises(GainError, match=r"^mu = 0"):
        mm.make_controller("damped-least-squares", mu=0.0)


def test_gains_of_extended_jacobian():
    for name, value in (("K_p", 0.0), ("K_v", 0.0), ("c_F", -1.0), ("K_F", [0.0])):
        with pytest.raises(GainError, match=f"^{name} = "):
            mm.make_controller("extended-jacobian", **{name: value})


@pytest.mark.parametrize(
    ("law", "wrong", "nearest"),
    [
        ("tsm", "lamda_0", "lambda_0"),
        ("pseudo-inverse", "Kpp", "K_p"),
        ("tsm", "metric", "metric_scale"),
    ],
)
def test_misspelt_gain_is_answered_with_the_nearest_names(law, wrong, nearest):
    with pytest.raises(UnknownNameError, match=f"unknown gain of '{law}' '{wrong}'") as caught:
        mm.make_controller(law, **{wrong: 1.0})
    message = str(caught.value)
    assert f"{nearest!r}" in message[message.index("did you mean") : message.index("valid names")]
    assert isinstance(caught.value, UsageError)


@pytest.mark.parametrize(
    ("short", "name"), [("lambda0", "lambda_0"), ("Lambda0", "Lambda_0"), ("w3k", "w_3k")]
)
def test_underscores_may_be_left_out(short, name):
    assert mm.make_controller("tsm", **{short: 7.0}).settings()[name] == 7.0


def test_misspelt_controller_is_answered_with_the_nearest_name():
    with pytest.raises(UnknownNameError, match=r"unknown controller 'tms'; did you mean 'tsm'"):
        mm.make_controller("tms")


def test_named_controllers_are_listed():
    assert {*SLIDING, *REDUNDANT, "extended-jacobian"} <= set(mm.list_controllers())


def test_gains_may_not_change_afterwards():
    with pytest.raises(dataclasses.FrozenInstanceError):
        mm.make_controller("tsm").gains.c = 0.5
