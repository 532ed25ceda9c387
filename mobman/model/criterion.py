"""Criteria F(q) that resolve the redundancy: their interface, and the posture criterion (12)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Matrix, Vector
from mobman.compiled import bind, kernel
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry
from mobman.toml_model import Strict

_STEP = 1e-30  # of the complex step: its square is below the rounding of anything


class Criterion(Protocol):
    """An objective F(q) that the redundant degrees of freedom minimise, (10)-(12).

    Optional: ``entry(q, q_dot, gradient, hessian, hessian_rate)``, which gives a function without
    arguments that writes the same values into these arrays, for speed (:mod:`mobman.compiled`); the
    methods below are called otherwise.
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


class Term(Strict):
    """Base of what may be added to the posture criterion: its fields are its parameters."""

    weight: float = Field(gt=0)  # factor; a term says what has this for its unit

    def on(self, robot: MobileManipulator) -> Criterion:
        """The term for a robot.

        Raises:
            UsageError: If it means nothing for this robot.
        """
        raise NotImplementedError


criteria: Registry[type[Term]] = Registry("criterion", "mobman.model", "mobman.criteria")
"""Terms by name; each a module of this folder that registers it."""


def criterion_entry(
    criterion: Criterion, q: Array, q_dot: Array, *into: Array
) -> Callable[[], None]:
    """A function that writes g, H and H' at (q, q') into three arrays."""
    entry = getattr(criterion, "entry", None)
    if entry is not None:
        own: Callable[[], None] = entry(q, q_dot, *into)
        return own
    gradient, hessian, hessian_rate = into

    def evaluate() -> None:
        gradient[:] = criterion.gradient(q.copy())
        hessian[:] = criterion.hessian(q.copy())
        hessian_rate[:] = criterion.hessian_rate(q.copy(), q_dot.copy())

    return evaluate


class ByComplexStep:
    """Base of a criterion whose g and H can be computed from a complex q.

    H' is the imaginary part of H at q + i h q' over h, which has no error of differences.
    """

    def derivatives(self, q: Array, along: Array) -> tuple[Array, Array]:
        """dF/dq and d2F/dq2 at ``along``, which is q with or without the step, shape (nq,)."""
        raise NotImplementedError

    def gradient(self, q: Array) -> Array:
        """dF/dq, shape (nq,)."""
        return self.derivatives(q, q)[0]

    def hessian(self, q: Array) -> Array:
        """d2F/dq2, shape (nq, nq)."""
        return self.derivatives(q, q)[1]

    def hessian_rate(self, q: Array, q_dot: Array) -> Array:
        """dH/dt along q', shape (nq, nq)."""
        _, hessian = self.derivatives(q, q + 1j * _STEP * q_dot)
        rate: Array = np.imag(hessian) / _STEP
        return rate

    def entry(self, q: Array, q_dot: Array, *into: Array) -> Callable[[], None]:
        """See :class:`Criterion`; one evaluation has all three."""
        gradient, hessian, hessian_rate = into

        def evaluate() -> None:
            g, H = self.derivatives(q, q + 1j * _STEP * q_dot)
            gradient[:], hessian[:], hessian_rate[:] = g.real, H.real, np.imag(H) / _STEP

        return evaluate


class Posture:
    r"""Distance from a preferred posture,
    :math:`F = \tfrac{c_F}{2}\langle q - q_{rest}, K_F (q - q_{rest})\rangle` (12).

    Args:
        weights: Diagonal of K_F, shape (nq,), each above 0.
        q_rest: Preferred posture, shape (nq,).
        scale: c_F, above 0.
        couplings: Off-diagonal part of K_F, symmetric and positive semi-definite, shape (nq, nq); see
            :class:`mobman.robots.spec.Coupling`.

    Raises:
        UsageError: If a weight is not positive or the lengths differ.
    """

    def __init__(
        self, weights: Array, q_rest: Array, scale: float = 1.0, couplings: Array | None = None
    ) -> None:
        self.weights = np.asarray(weights, dtype=float)
        self.q_rest = np.asarray(q_rest, dtype=float)
        self.scale = float(scale)
        if self.weights.shape != self.q_rest.shape:
            raise UsageError(
                f"posture criterion: K_F has {self.weights.size} weights, the rest posture "
                f"{self.q_rest.size} coordinates"
            )
        if not (np.all(self.weights > 0) and self.scale > 0):
            raise UsageError("posture criterion: c_F and every weight of K_F must be above 0")
        self._diagonal = self.scale * self.weights
        self._hessian = np.diag(self._diagonal)
        self._coupled = couplings is not None and bool(np.any(couplings))
        if couplings is not None:
            self._hessian += self.scale * couplings

    @classmethod
    def of(cls, robot: MobileManipulator, scale: float = 1.0) -> Posture:
        """The criterion with the weights and the rest posture of a robot's description."""
        return cls(robot.criterion_weights, robot.q_rest, scale, robot.criterion_couplings)

    def value(self, q: Array) -> float:
        """F(q)."""
        deviation = q - self.q_rest
        return float(0.5 * deviation @ self._hessian @ deviation)

    def gradient(self, q: Array) -> Array:
        """c_F K_F (q - q_rest), shape (nq,)."""
        gradient: Array = self._hessian @ (q - self.q_rest)
        return gradient

    def hessian(self, q: Array) -> Array:
        """c_F K_F, shape (nq, nq)."""
        return self._hessian.copy()

    def hessian_rate(self, q: Array, q_dot: Array) -> Array:
        """Zero, shape (nq, nq)."""
        return np.zeros_like(self._hessian)

    def entry(self, q: Array, q_dot: Array, *into: Array) -> Callable[[], None]:
        """See :class:`Criterion`; H and H' are constant and written once, here."""
        gradient, hessian, hessian_rate = into
        hessian[:] = self._hessian
        hessian_rate[:] = 0.0
        if self._coupled:
            return bind(_coupled_gradient, self._hessian, q, self.q_rest, gradient)
        return bind(_gradient, self._diagonal, q, self.q_rest, gradient)


class Sum:
    """The posture criterion and terms that are added to it.

    Args:
        posture: What is there in any case.
        terms: At least one.
    """

    def __init__(self, posture: Posture, terms: Sequence[Criterion]) -> None:
        self.weights = posture.weights
        self._parts: tuple[Criterion, ...] = (posture, *terms)

    def value(self, q: Array) -> float:
        """F(q)."""
        return sum(part.value(q) for part in self._parts)

    def gradient(self, q: Array) -> Array:
        """dF/dq, shape (nq,)."""
        return self._total("gradient", q)

    def hessian(self, q: Array) -> Array:
        """d2F/dq2, shape (nq, nq)."""
        return self._total("hessian", q)

    def hessian_rate(self, q: Array, q_dot: Array) -> Array:
        """dH/dt along q', shape (nq, nq)."""
        return self._total("hessian_rate", q, q_dot)

    def _total(self, name: str, *given: Array) -> Array:
        total: Array = np.sum([getattr(part, name)(*given) for part in self._parts], axis=0)
        return total

    def entry(self, q: Array, q_dot: Array, *into: Array) -> Callable[[], None]:
        """See :class:`Criterion`."""
        own = [[np.empty_like(array) for array in into] for _ in self._parts]
        parts = [
            criterion_entry(part, q, q_dot, *arrays)
            for part, arrays in zip(self._parts, own, strict=True)
        ]
        of_each = list(zip(into, *own, strict=True))

        def evaluate() -> None:
            for part in parts:
                part()
            for total, *summands in of_each:
                np.sum(summands, axis=0, out=total)

        return evaluate


@kernel
def _gradient(diagonal: Vector, q: Vector, q_rest: Vector, gradient: Vector) -> None:
    for i in range(q.shape[0]):
        gradient[i] = diagonal[i] * (q[i] - q_rest[i])


@kernel
def _coupled_gradient(K: Matrix, q: Vector, q_rest: Vector, gradient: Vector) -> None:
    for i in range(q.shape[0]):
        gradient[i] = 0.0
        for j in range(q.shape[0]):
            gradient[i] += K[i, j] * (q[j] - q_rest[j])
