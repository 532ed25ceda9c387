"""What the extended Jacobian asks of a criterion F(q)."""

from __future__ import annotations

from typing import Protocol

from mobman.arrays import Array


class Criterion(Protocol):
    """An objective F(q) that the redundant degrees of freedom minimise, (10)-(12)."""

    def value(self, q: Array) -> float:
        """F(q)."""
        ...

    def gradient(self, q: Array) -> Array:
        """g = dF/dq, shape (nq,)."""
        ...

    def hessian(self, q: Array) -> Array:
        """H = d2F/dq2, shape (nq, nq)."""
        ...

    def hessian_rate(self, q: Array, q_dot: Array) -> Array:
        """dH/dt along q', shape (nq, nq)."""
        ...
