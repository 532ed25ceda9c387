"""Vectors and matrices against numpy, for every size of a robot."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.kernels import dense

SIZES = [(1, 1), (1, 7), (7, 1), (2, 3), (5, 5), (8, 3), (3, 8), (17, 12), (40, 40), (40, 9)]


@pytest.fixture(params=SIZES, ids=str)
def matrices(request):
    """A of that shape, B that A B exists with, and C of A's width."""
    rows, columns = request.param
    random = np.random.default_rng(rows * 100 + columns)
    shapes = (rows, columns), (columns, rows + 1), (rows + 2, columns)
    return [random.standard_normal(shape) for shape in shapes]


def _close(found, expected):
    return np.allclose(found, expected, rtol=0.0, atol=1e-14 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("n", [0, 1, 2, 3, 8, 40])
def test_dot_norm_and_copy(n):
    a, b = np.random.default_rng(n).standard_normal((2, n))
    assert np.isclose(dense.dot(a, b), a @ b, rtol=0.0, atol=1e-14 * max(1, n))
    assert np.isclose(dense.norm(a), np.linalg.norm(a), rtol=1e-14)
    to = np.full(n, np.nan)
    dense.copy(a, to)
    assert np.array_equal(to, a)


def test_apply(matrices):
    a = matrices[0]
    x, y = np.random.default_rng(1).standard_normal(a.shape[1]), np.full(len(a), np.nan)
    dense.apply(a, x, y)
    assert _close(y, a @ x)


def test_apply_transpose(matrices):
    a = matrices[0]
    x, y = np.random.default_rng(2).standard_normal(len(a)), np.full(a.shape[1], np.nan)
    dense.apply_transpose(a, x, y)
    assert _close(y, a.T @ x)


def test_multiply(matrices):
    a, b, _ = matrices
    c = np.full((len(a), b.shape[1]), np.nan)
    dense.multiply(a, b, c)
    assert _close(c, a @ b)


def test_gram(matrices):
    """Symmetric to the last bit, which factorisations of it rely on."""
    a = matrices[0]
    c = np.full((len(a), len(a)), np.nan)
    dense.gram(a, c)
    assert _close(c, a @ a.T)
    assert np.array_equal(c, c.T)


def test_rows_of_a_matrix_will_do():
    """They are contiguous: kernels take them as vectors, and leading rows as matrices."""
    a, y = np.arange(12.0).reshape(4, 3), np.zeros((3, 2))
    dense.apply(a[1:3], a[3], y[1])
    assert np.array_equal(y[1], a[1:3] @ a[3])


def test_what_is_not_a_number_stays_that():
    """Reordering sums is all that is allowed to the compiler."""
    a = np.array([1.0, np.nan, 2.0])
    assert np.isnan(dense.dot(a, np.ones(3)))
    assert np.isnan(dense.dot(a, np.zeros(3)))
    assert dense.dot(np.array([np.inf, 1.0]), np.ones(2)) == np.inf
    assert np.isnan(dense.norm(a))
