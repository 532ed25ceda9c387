"""Cholesky factors against numpy's, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.kernels import cholesky

SIZES = [*range(1, 13), 20, 31, 40]


def _definite(n, seed=0):
    root = np.random.default_rng(seed + n).standard_normal((n, n))
    return root @ root.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("n", SIZES)
def test_factor_is_numpys(n):
    a = _definite(n)
    before, lower = a.copy(), np.full((n, n), np.nan)
    assert cholesky.factor(a, lower) == 0
    assert np.allclose(np.tril(lower), np.linalg.cholesky(a), rtol=1e-10, atol=1e-12)
    assert np.array_equal(a, before)
    assert np.all(np.isnan(lower[np.triu_indices(n, 1)]))  # only the lower triangle is written


@pytest.mark.parametrize("n", SIZES)
def test_factor_may_take_the_matrix_s_own_place(n):
    a, lower = _definite(n), np.zeros((n, n))
    cholesky.factor(a, lower)
    assert cholesky.factor(a, a) == 0
    assert np.array_equal(np.tril(a), np.tril(lower))


@pytest.mark.parametrize("n", SIZES)
def test_solve(n):
    a, b = _definite(n), np.random.default_rng(n).standard_normal(n)
    lower, x = a.copy(), np.full(n, np.nan)
    cholesky.factor(lower, lower)
    cholesky.solve(lower, b, x)
    assert np.allclose(a @ x, b, atol=1e-11 * np.abs(a).max())
    assert np.allclose(x, np.linalg.solve(a, b), rtol=1e-8, atol=1e-10)
    cholesky.solve(lower, b, b)  # in its own place
    assert np.array_equal(b, x)


def test_lower_triangle_alone_is_read():
    matrix = np.array([[4.0, 99.0], [1.0, 3.0]])
    lower, x = np.zeros((2, 2)), np.zeros(2)
    assert cholesky.factor(matrix, lower) == 0
    cholesky.solve(lower, np.array([5.0, 4.0]), x)
    assert np.allclose(x, [1.0, 1.0])


@pytest.mark.parametrize("last", [0.0, -1.0, np.nan, -np.inf])
@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_what_is_not_positive_definite_is_refused(n, last):
    """The status is the order of the first leading minor that is not positive."""
    for place in range(n):
        diagonal = np.ones(n)
        diagonal[place] = last
        assert cholesky.factor(np.diag(diagonal), np.zeros((n, n))) == place + 1


@pytest.mark.parametrize("n", [2, 3, 8, 25])
def test_indefinite_matrices_are_refused(n):
    """An eigenvalue of -1 in any direction."""
    random = np.random.default_rng(n)
    for _ in range(5):
        basis = np.linalg.qr(random.standard_normal((n, n)))[0]
        values = random.uniform(0.5, 2.0, n)
        values[0] = -1.0
        matrix = basis @ np.diag(values) @ basis.T
        status = cholesky.factor(matrix, np.zeros((n, n)))
        assert 1 <= status <= n
        assert np.linalg.eigvalsh(matrix[:status, :status])[0] < 1e-12
        if status > 1:
            assert np.linalg.eigvalsh(matrix[: status - 1, : status - 1])[0] > 0.0


@pytest.mark.parametrize("n", [2, 5, 11])
def test_what_is_not_a_number_is_refused_wherever_it_is(n):
    for i in range(n):
        for j in range(i + 1):
            matrix = _definite(n)
            matrix[i, j] = np.nan
            assert cholesky.factor(matrix, np.zeros((n, n))) == i + 1


@pytest.mark.parametrize("n", [2, 5, 12])
def test_rank_that_is_lost_to_rounding_is_seen(n):
    """Rows that depend on each other: their Gram matrix is singular, its factor need not be."""
    rows = np.random.default_rng(n).standard_normal((n, n + 3))
    lower = np.zeros((n, n))
    assert cholesky.factor(rows @ rows.T, lower) == 0
    assert cholesky.well_posed(lower)
    rows[-1] = rows[:-1].sum(axis=0)
    status = cholesky.factor(rows @ rows.T, lower)
    assert status != 0 or not cholesky.well_posed(lower)


def test_rank_is_judged_by_the_pivots():
    for small, good in ((1e-6, True), (1e-8, False)):
        assert cholesky.well_posed(np.diag([1.0, small, 0.5])) is good
        assert cholesky.well_posed(np.diag([1e3, 1e3 * small])) is good
    assert cholesky.well_posed(np.ones((1, 1)))
