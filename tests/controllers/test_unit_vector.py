"""The unit vector s/|s|, as printed and discretised implicitly."""

from __future__ import annotations

import numpy as np
import pytest
from support.inclusions import inclusion
from support.unit_vectors import implicit_unit_vector, sampled_unit_vector, unit_vector


def _metric(random, p):
    root = random.standard_normal((p, p))
    return root @ root.T + 0.1 * np.eye(p)


def _gram(random, p, rank):
    root = random.standard_normal((p, rank)) * 10.0 ** random.uniform(-3, 2)
    return root @ root.T


def _cases(count=150):
    """M the identity or not, K of full rank or not and of any size, b small or large."""
    random = np.random.default_rng(50)
    for i in range(count):
        p = int(random.integers(1, 8))
        metric = np.eye(p) if i % 3 == 0 else _metric(random, p)
        gram = _gram(random, p, p if i % 2 else max(1, p - 1))
        yield metric, gram, random.standard_normal(p) * 10.0 ** random.uniform(-3, 3)


@pytest.mark.parametrize("layer", [0.0, 0.05])
def test_inclusion_holds(layer):
    """s+ + P n = b with P = M^-1 K; n = s+/|s+| outside the boundary layer, s+/layer inside it."""
    inside = outside = 0
    for metric, gram, b in _cases():
        n = implicit_unit_vector(metric, gram, b, layer)
        s = b - np.linalg.solve(metric, gram @ n)
        size = np.linalg.norm(s)
        scale = np.linalg.norm(b)
        assert np.linalg.norm(n) <= 1.0 + 1e-9
        if size > layer + 1e-8 * scale:
            # s is a difference of b and P n, whose rounding, some 100 eps, the division magnifies
            rounding = (
                100 * np.finfo(float).eps * np.linalg.norm(np.linalg.solve(metric, gram)) / size
            )
            assert np.allclose(n, s / size, atol=max(1e-6, rounding))
            outside += 1
        elif layer > 0.0:
            assert np.allclose(n, s / layer, atol=1e-6 * max(1.0, scale / layer))
            inside += 1
        else:
            inside += 1  # s+ = 0 with n in the unit ball
    assert inside > 10
    assert outside > 10


@pytest.mark.parametrize("layer", [0.0, 0.05])
def test_solution_is_that_of_a_plain_search(layer):
    for metric, gram, b in _cases():
        if np.linalg.matrix_rank(gram) < len(b) and layer == 0.0:
            continue  # the search needs sigma > 0; the inclusion test covers these
        n = implicit_unit_vector(metric, gram, b, layer)
        assert np.allclose(n, inclusion(metric, gram, b, layer), atol=1e-7)


def test_equivalent_control_inside_the_unit_ball():
    """A small b is cancelled exactly: s+ = 0."""
    random = np.random.default_rng(51)
    for p in range(1, 8):
        metric, gram = _metric(random, p), _gram(random, p, p) + np.eye(p)
        b = 1e-6 * random.standard_normal(p)
        n = implicit_unit_vector(metric, gram, b)
        assert np.linalg.norm(n) < 1.0
        assert np.allclose(np.linalg.solve(metric, gram @ n), b, atol=1e-18, rtol=1e-9)


def test_gain_does_not_matter_inside_the_unit_ball():
    """P n is the same for any larger gain: what a bound a that is too low costs is nothing."""
    random = np.random.default_rng(52)
    gram, b = _gram(random, 4, 4) + np.eye(4), 1e-3 * random.standard_normal(4)
    taken = [k * gram @ implicit_unit_vector(np.eye(4), k * gram, b) for k in (1.0, 10.0, 1e4)]
    assert np.allclose(taken[0], taken[1], rtol=1e-9)
    assert np.allclose(taken[0], taken[2], rtol=1e-9)


def test_short_ticks_give_the_explicit_unit_vector():
    """dt -> 0: P and the drift shrink with dt, and n tends to s/|s|, linearly."""
    random = np.random.default_rng(53)
    metric, gram = _metric(random, 5), _gram(random, 5, 5)
    s, drift = random.standard_normal((2, 5))
    explicit = unit_vector(s)
    distance = [
        np.linalg.norm(
            sampled_unit_vector("implicit", 0.0, s, dt * drift, metric, dt * gram) - explicit
        )
        for dt in (1e-4, 1e-5, 1e-6)
    ]
    assert distance[2] < 1e-3 * max(1.0, np.abs(gram).max())
    assert np.isclose(distance[1] / distance[2], 10.0, rtol=0.1)


def test_nothing_to_do_gives_zero():
    assert not implicit_unit_vector(np.eye(3), np.eye(3), np.zeros(3)).any()
    assert not unit_vector(np.zeros(3)).any()


def test_gram_of_no_rank_at_all_gives_the_unit_vector_of_b():
    b = np.array([3.0, 0.0, -4.0])
    assert np.allclose(implicit_unit_vector(np.eye(3), np.zeros((3, 3)), b), b / 5.0)


def test_explicit_unit_vector():
    assert np.allclose(unit_vector(np.array([3.0, -4.0])), [0.6, -0.8])
    assert np.allclose(unit_vector(np.array([3.0, -4.0]), 10.0), [0.3, -0.4])
    assert np.allclose(unit_vector(np.array([30.0, -40.0]), 10.0), [0.6, -0.8])


def test_explicit_discretisation_looks_at_the_start_of_the_tick_alone():
    s, anything = np.array([3.0, -4.0]), np.array([7.0, 7.0])
    n = sampled_unit_vector("explicit", 0.0, s, anything, np.eye(2), np.eye(2))
    assert np.allclose(n, [0.6, -0.8])


def test_no_control_and_nothing_to_control():
    """K has lost its rank and s is 0: any n does, and 0 is taken."""
    n = implicit_unit_vector(np.eye(3), np.zeros((3, 3)), np.zeros(3))
    assert n.tolist() == [0.0, 0.0, 0.0]
