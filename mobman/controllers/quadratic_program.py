"""Quadratic programs with hard and soft bounds, by DAQP, which extras bring."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing

from mobman.arrays import Array
from mobman.errors import MobmanError, SingularityError

_SOFT, _HARD = 8, 0  # DAQP's kinds of constraints
_SOLVED = (1, 2)  # its exit flags: optimal; optimal with soft bounds that do not hold
_LIMIT = 1000  # iterations
_TOLERANCE = 1e-9  # of the bounds
Flags = np.typing.NDArray[np.bool_]
Solve = Callable[[Array, Array, Array, Array, Array, Flags], Array]


def solver(law: str, extra: str) -> Solve:
    """A function of (H, f, A, lower, upper, soft) that gives the x with the least x^T H x/2 + f^T x.

    lower <= A x <= upper holds where ``soft`` is False, shape (rows,); elsewhere as far as it can, a
    violation costing half a million times its square. H is positive definite, and bounds may be inf.
    The function raises SingularityError where no solution is found: the hard bounds have none, or
    numbers are not finite.

    Args:
        law: Name of the law that needs it, for the message.
        extra: What to install for it.

    Raises:
        MobmanError: If DAQP is not installed.
    """
    try:
        import daqp
    except ImportError as error:
        raise MobmanError(
            f"controller {law!r} needs daqp, which is not installed; install it with: "
            f"pip install 'mobman[{extra}]'"
        ) from error

    def solve(H: Array, f: Array, A: Array, lower: Array, upper: Array, soft: Flags) -> Array:
        kind = np.where(soft, _SOFT, _HARD).astype(np.int32)
        given: tuple[Any, ...] = (H, f, A, upper, lower, kind)
        x, _, flag, _ = daqp.solve(*given, iter_limit=_LIMIT, primal_tol=_TOLERANCE)
        if flag not in _SOLVED or not np.isfinite(x).all():
            raise SingularityError(
                f"the quadratic program of {law!r} has no finite solution (DAQP's exit flag: {flag})"
            )
        return np.array(x)

    return solve
