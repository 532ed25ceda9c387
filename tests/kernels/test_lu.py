"""Gaussian elimination against numpy, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.kernels import lu

SIZES = [*range(1, 13), 20, 31, 40]


def _solve(a, b):
    x, work = np.full(len(b), np.nan), np.full_like(a, np.nan)
    return lu.solve(a, b, x, work), x


@pytest.mark.parametrize("n", SIZES)
def test_solution_is_numpys(n):
    random = np.random.default_rng(n)
    for _ in range(5):
        a, b = random.standard_normal((n, n)), random.standard_normal(n)
        kept = a.copy(), b.copy()
        status, x = _solve(a, b)
        assert status == 0
        assert np.allclose(x, np.linalg.solve(a, b), rtol=1e-8, atol=1e-9)
        assert np.array_equal(a, kept[0])
        assert np.array_equal(b, kept[1])


@pytest.mark.parametrize("n", [2, 3, 7, 24])
def test_rows_are_exchanged_where_they_must_be(n):
    """Permutations: every pivot on the diagonal is 0, or small enough to spoil everything."""
    order = np.roll(np.arange(n), 1)
    b = np.arange(1.0, n + 1.0)
    for diagonal in (0.0, 1e-17):
        a = np.eye(n)[order] + diagonal * np.eye(n)
        status, x = _solve(a, b)
        assert status == 0
        assert np.allclose(a @ x, b, atol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_singular_matrices_are_refused(n):
    """The status is the number of the pivot that is 0."""
    for zero in range(n):
        diagonal = np.arange(1.0, n + 1.0)
        diagonal[zero] = 0.0
        assert _solve(np.diag(diagonal), np.ones(n))[0] == zero + 1
    assert _solve(np.zeros((n, n)), np.ones(n))[0] == 1


def test_rows_that_are_alike_are_refused():
    a = np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [1.0, 0.0, 1.0]])
    assert _solve(a, np.ones(3))[0] == 3


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("n", [1, 2, 4, 7])
def test_what_is_not_finite_is_refused_wherever_it_is(n, value):
    random = np.random.default_rng(n)
    for i in range(n):
        for j in range(n):
            a = random.standard_normal((n, n))
            a[i, j] = value
            status, x = _solve(a, np.ones(n))
            assert status > 0 or not np.all(np.isfinite(x))
            if np.isnan(value):
                assert status > 0


def test_right_side_that_is_not_a_number_shows_in_the_solution():
    status, x = _solve(np.eye(3), np.array([1.0, np.nan, 2.0]))
    assert status == 0
    assert np.isnan(x[1])
