"""The cascade without the terminal powers: the error decays as the linear law's poles say."""

from __future__ import annotations

import numpy as np
from support.errors import size_at

import mobman as mm
from mobman.controllers.linear_cascade import LinearCascade
from mobman.controllers.tsm import TerminalSlidingMode


def test_error_decays_at_the_slowest_pole():
    """(s + 2)(s + 10)(s + 12): |e| at the rate of 2 /s once the others are gone."""
    c_0, c_1, c_2 = np.poly([-2.0, -10.0, -12.0])[:0:-1]
    law = mm.make_controller("linear-cascade", lambda_0=c_0 / c_1, lambda_1=c_1 / c_2, lambda_2=c_2)
    record = mm.simulate("tiago_no_hand", law, "circle", duration=4.0, dt=2e-3)
    assert record.ok, record.message
    rate = np.log(size_at(record, 2.0) / size_at(record, 4.0)) / 2.0
    assert np.isclose(rate, 2.0, rtol=0.01)


def test_terminal_powers_are_there_in_a_finite_time():
    """The same law with the powers of the paper, slower at first, is at its floor when the linear one
    still decays."""
    linear = mm.make_controller("linear-cascade", lambda_0=1.0, lambda_1=11.0, lambda_2=6.0)
    runs = [
        mm.simulate("tiago_no_hand", law, "circle", duration=7.0, dt=2e-3)
        for law in (linear, "tsm")
    ]
    assert size_at(runs[1], 7.0) < 1e-3 * size_at(runs[0], 7.0)


def test_everything_else_is_that_of_tsm():
    assert issubclass(LinearCascade, TerminalSlidingMode)
    assert LinearCascade.uses == TerminalSlidingMode.uses
