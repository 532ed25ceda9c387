"""The cascade of ``tsm`` with linear laws in the place of the terminal ones, ``linear-cascade``."""

from __future__ import annotations

from dataclasses import dataclass

from mobman.controllers.gains import Diagonal, gain
from mobman.controllers.protocol import controllers
from mobman.controllers.tsm import CascadeGains, TerminalSlidingMode


@dataclass(frozen=True, kw_only=True)
class LinearGains(CascadeGains):
    """Gains of the linear laws; by default three poles at -5 /s, and two at -20 /s."""

    Lambda_0: Diagonal = gain(400.0, "s^-2", "Lambda_0 of E'' + Lambda_1 E' + Lambda_0 E = 0")
    Lambda_1: Diagonal = gain(40.0, "s^-1", "Lambda_1 of the same")
    lambda_0: Diagonal = gain(
        5.0 / 3.0, "s^-1", "lambda_0 of e''' + lambda_2 (e'' + lambda_1 (e' + lambda_0 e)) = 0"
    )
    lambda_1: Diagonal = gain(5.0, "s^-1", "lambda_1 of the same")
    lambda_2: Diagonal = gain(15.0, "s^-1", "lambda_2 of the same")


@controllers.register("linear-cascade")
class LinearCascade(TerminalSlidingMode):
    r"""Law ``tsm`` with its terminal powers replaced by 1 in (31) and (51):

    .. math:: g = \lambda_2(\ddot e + \lambda_1(\dot e + \lambda_0 e)), \quad
        G = \Lambda_0 E + \Lambda_1 \dot E.

    All else is that of ``tsm``: both stages, the measured acceleration, the unit vectors and their
    discretisation. What is left between the two laws is what the terminal powers give: on s = 0 the
    error decays exponentially here, and is 0 after a finite time there.
    """

    name = "linear-cascade"
    Gains = LinearGains
