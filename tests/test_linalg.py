"""Small dense linear algebra against numpy, for every size of a robot, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from mobman import linalg

SIZES = [*range(1, 13), 20, 31, 40]
SHAPES = [(1, 1), (1, 7), (7, 1), (2, 3), (5, 5), (8, 3), (3, 8), (17, 12), (40, 40), (40, 9)]


@pytest.fixture(params=SHAPES, ids=str)
def matrices(request):
    """A of that shape, B that A B exists with, and C of A's width."""
    rows, columns = request.param
    random = np.random.default_rng(rows * 100 + columns)
    shapes = (rows, columns), (columns, rows + 1), (rows + 2, columns)
    return [random.standard_normal(shape) for shape in shapes]


def _close(found, expected):
    return np.allclose(found, expected, rtol=0.0, atol=1e-14 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("n", [0, 1, 2, 3, 8, 40])
def test_dot_and_norm(n):
    a, b = np.random.default_rng(n).standard_normal((2, n))
    assert np.isclose(linalg.dot(a, b), a @ b, rtol=0.0, atol=1e-14 * max(1, n))
    assert np.isclose(linalg.norm(a), np.linalg.norm(a), rtol=1e-14)


def test_apply(matrices):
    a = matrices[0]
    x, y = np.random.default_rng(1).standard_normal(a.shape[1]), np.full(len(a), np.nan)
    linalg.apply(a, x, y)
    assert _close(y, a @ x)


def test_apply_transpose(matrices):
    a = matrices[0]
    x, y = np.random.default_rng(2).standard_normal(len(a)), np.full(a.shape[1], np.nan)
    linalg.apply_transpose(a, x, y)
    assert _close(y, a.T @ x)


def test_multiply(matrices):
    a, b, _ = matrices
    c = np.full((len(a), b.shape[1]), np.nan)
    linalg.multiply(a, b, c)
    assert _close(c, a @ b)


def test_gram(matrices):
    """Symmetric to the last bit, which factorisations of it rely on."""
    a = matrices[0]
    c = np.full((len(a), len(a)), np.nan)
    linalg.gram(a, c)
    assert _close(c, a @ a.T)
    assert np.array_equal(c, c.T)


def test_rows_of_a_matrix_will_do():
    """They are contiguous: kernels take them as vectors, and leading rows as matrices."""
    a, y = np.arange(12.0).reshape(4, 3), np.zeros((3, 2))
    linalg.apply(a[1:3], a[3], y[1])
    assert np.array_equal(y[1], a[1:3] @ a[3])


def test_what_is_not_a_number_stays_that():
    """Reordering sums is all that is allowed to the compiler."""
    a = np.array([1.0, np.nan, 2.0])
    assert np.isnan(linalg.dot(a, np.ones(3)))
    assert np.isnan(linalg.dot(a, np.zeros(3)))
    assert linalg.dot(np.array([np.inf, 1.0]), np.ones(2)) == np.inf
    assert np.isnan(linalg.norm(a))


def _definite(n, seed=0):
    root = np.random.default_rng(seed + n).standard_normal((n, n))
    return root @ root.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("n", SIZES)
def test_factor_is_numpys(n):
    a = _definite(n)
    before, lower = a.copy(), np.full((n, n), np.nan)
    assert linalg.cholesky(a, lower) == 0
    assert np.allclose(np.tril(lower), np.linalg.cholesky(a), rtol=1e-10, atol=1e-12)
    assert np.array_equal(a, before)
    assert np.all(np.isnan(lower[np.triu_indices(n, 1)]))  # only the lower triangle is written


@pytest.mark.parametrize("n", SIZES)
def test_factor_may_take_the_matrix_s_own_place(n):
    a, lower = _definite(n), np.zeros((n, n))
    linalg.cholesky(a, lower)
    assert linalg.cholesky(a, a) == 0
    assert np.array_equal(np.tril(a), np.tril(lower))


@pytest.mark.parametrize("n", SIZES)
def test_cholesky_solve(n):
    a, b = _definite(n), np.random.default_rng(n).standard_normal(n)
    lower, x = a.copy(), np.full(n, np.nan)
    linalg.cholesky(lower, lower)
    linalg.cholesky_solve(lower, b, x)
    assert np.allclose(a @ x, b, atol=1e-11 * np.abs(a).max())
    assert np.allclose(x, np.linalg.solve(a, b), rtol=1e-8, atol=1e-10)
    columns = np.column_stack([2.0 * b, b, b + 1.0, np.full(n, np.nan)])
    linalg.cholesky_solve_columns(lower, columns, 3)
    assert np.array_equal(columns[:, 1], x)
    assert np.isnan(columns[:, 3]).all()
    linalg.cholesky_solve(lower, b, b)  # in its own place
    assert np.array_equal(b, x)


def test_lower_triangle_alone_is_read():
    matrix = np.array([[4.0, 99.0], [1.0, 3.0]])
    lower, x = np.zeros((2, 2)), np.zeros(2)
    assert linalg.cholesky(matrix, lower) == 0
    linalg.cholesky_solve(lower, np.array([5.0, 4.0]), x)
    assert np.allclose(x, [1.0, 1.0])


@pytest.mark.parametrize("last", [0.0, -1.0, np.nan, -np.inf])
@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_what_is_not_positive_definite_is_refused(n, last):
    """The status is the order of the first leading minor that is not positive."""
    for place in range(n):
        diagonal = np.ones(n)
        diagonal[place] = last
        assert linalg.cholesky(np.diag(diagonal), np.zeros((n, n))) == place + 1


@pytest.mark.parametrize("n", [2, 3, 8, 25])
def test_indefinite_matrices_are_refused(n):
    """An eigenvalue of -1 in any direction."""
    random = np.random.default_rng(n)
    for _ in range(5):
        basis = np.linalg.qr(random.standard_normal((n, n)))[0]
        values = random.uniform(0.5, 2.0, n)
        values[0] = -1.0
        matrix = basis @ np.diag(values) @ basis.T
        status = linalg.cholesky(matrix, np.zeros((n, n)))
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
            assert linalg.cholesky(matrix, np.zeros((n, n))) == i + 1


@pytest.mark.parametrize("n", [2, 5, 12])
def test_rank_that_is_lost_to_rounding_is_seen(n):
    """Rows that depend on each other: their Gram matrix is singular, its factor need not be."""
    rows = np.random.default_rng(n).standard_normal((n, n + 3))
    lower = np.zeros((n, n))
    assert linalg.cholesky(rows @ rows.T, lower) == 0
    assert linalg.well_posed(lower)
    rows[-1] = rows[:-1].sum(axis=0)
    status = linalg.cholesky(rows @ rows.T, lower)
    assert status != 0 or not linalg.well_posed(lower)


def test_rank_is_judged_by_the_pivots():
    for small, good in ((1e-6, True), (1e-8, False)):
        assert linalg.well_posed(np.diag([1.0, small, 0.5])) is good
        assert linalg.well_posed(np.diag([1e3, 1e3 * small])) is good
    assert linalg.well_posed(np.ones((1, 1)))


def _solve(a, b):
    x, work = np.full(len(b), np.nan), np.full_like(a, np.nan)
    return linalg.solve(a, b, x, work), x


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
