"""What the extended Jacobian asks of a criterion F(q)."""

from __future__ import annotations

from typing import Protocol

from mobman.arrays import Array
from mobman.kernels.program import Call, call


class Criterion(Protocol):
    """An objective F(q) that the redundant degrees of freedom minimise, (10)-(12).

    Optional: ``steps(q, q_dot, gradient, hessian, hessian_rate) -> list[Call]``, kernels that write the
    same values into arrays (:mod:`mobman.kernels`); the methods below are called otherwise.
    """

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


def criterion_steps(
    criterion: Criterion,
    q: Array,
    q_dot: Array,
    gradient: Array,
    hessian: Array,
    hessian_rate: Array,
) -> list[Call]:
    """Steps of a program that write g, H and H' at (q, q') into arrays."""
    steps = getattr(criterion, "steps", None)
    if steps is not None:
        own: list[Call] = steps(q, q_dot, gradient, hessian, hessian_rate)
        return own

    def evaluate() -> None:
        gradient[:] = criterion.gradient(q.copy())
        hessian[:] = criterion.hessian(q.copy())
        hessian_rate[:] = criterion.hessian_rate(q.copy(), q_dot.copy())

    return [call(evaluate)]
