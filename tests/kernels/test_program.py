"""Programs: kernels in sequence, with their arguments bound once."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from mobman.arrays import Columns, Index, Matrix, Tensor, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import call, program


@kernel
def note(log: Vector, count: Index, value: float) -> None:
    """Write a value at the log's end."""
    log[count[0]] = value
    count[0] += 1


@kernel
def report(status: Index) -> int:
    return status[0]


@kernel
def report_large(values: Vector, bound: float) -> int:
    """Returns in several places."""
    for i in range(values.shape[0]):
        if values[i] > bound:
            return 7 + i
    return 0


@kernel
def count_small(values: Vector, bound: float) -> None:
    """Returns in several places, too, and never with a value."""
    for i in range(1, values.shape[0]):
        if values[i] > bound:
            return
        values[0] += 1.0


@kernel
def keep_numbers(number: float, whole: int, floats: Vector, integers: Index) -> None:
    floats[0], integers[0] = number, whole


@kernel
def sum_by_column(a: Columns, sums: Vector) -> None:
    """The entries' places and their numbers, so that a transposed view would show."""
    sums[0], sums[1], sums[2] = a.shape[0], a.shape[1], 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            sums[2] += a[i, j] * (10.0 * i + j)


@kernel
def sum_by_row(a: Matrix, sums: Vector) -> None:
    sums[0], sums[1], sums[2] = a.shape[0], a.shape[1], 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            sums[2] += a[i, j] * (10.0 * i + j)


@kernel
def sum_of_layers(a: Tensor, sums: Vector) -> None:
    for i in range(a.shape[0]):
        sums[i] = 0.0
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                sums[i] += a[i, j, k] * (10.0 * j + k)


@kernel
def double(x: Vector) -> None:
    for i in range(x.shape[0]):
        x[i] *= 2.0


@kernel
def add(a: Vector, b: Vector, total: Vector) -> None:
    for i in range(total.shape[0]):
        total[i] = a[i] + b[i]


@pytest.fixture
def log():
    return np.zeros(9), np.zeros(1, dtype=np.int64)


def _noted(log):
    return log[0][: log[1][0]].tolist()


def test_calls_are_made_in_order(log):
    run = program([call(note, *log, float(value)) for value in (3, 1, 2)])
    assert run() == 0
    assert _noted(log) == [3.0, 1.0, 2.0]
    assert run() == 0
    assert _noted(log) == [3.0, 1.0, 2.0, 3.0, 1.0, 2.0]


def test_functions_of_python_may_come_in_between(log):
    """At any place, with arguments of any kind."""

    def look(name, values):
        values.append((name, log[1][0]))

    seen = []
    run = program(
        [
            call(look, "first", seen),
            call(note, *log, 1.0),
            call(look, "second", seen),
            call(look, "third", seen),
            call(note, *log, 2.0),
            call(note, *log, 3.0),
            call(look, "last", seen),
        ]
    )
    assert run() == 0
    assert _noted(log) == [1.0, 2.0, 3.0]
    assert seen == [("first", 0), ("second", 1), ("third", 1), ("last", 3)]


def test_program_of_nothing_does_nothing():
    assert program([])() == 0


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("python", [False, True], ids=["kernel", "python"])
def test_status_ends_the_program(log, place, python):
    status = np.zeros(1, dtype=np.int64)
    reporting = call(lambda: int(status[0])) if python else call(report, status)
    steps = [call(note, *log, float(value)) for value in range(3)]
    run = program([*steps[:place], reporting, *steps[place:]])
    assert run() == 0
    log[1][0], status[0] = 0, 42
    assert run() == 42
    assert _noted(log) == [float(value) for value in range(place)]


def test_kernel_may_return_in_several_places():
    values = np.array([0.0, 1.0, 2.0])
    run = program([call(count_small, values, 3.5), call(report_large, values, 3.5)])
    assert run() == 0
    assert values[0] == 2.0
    values[2] = 4.0
    assert run() == 9
    assert values[0] == 3.0


@pytest.mark.parametrize(
    "number", [0.1, -0.0, 1e-310, 1.7e308, float("inf"), np.float64(-2.5), 3, np.int64(-3), True]
)
def test_numbers_are_constants_to_the_last_bit(number):
    floats, integers = np.zeros(1), np.zeros(1, dtype=np.int64)
    program([call(keep_numbers, number, 0, floats, integers)])()
    assert floats.tobytes() == np.array([number], dtype=float).tobytes()


def test_what_is_not_a_number_may_be_one_too():
    floats, integers = np.zeros(1), np.zeros(1, dtype=np.int64)
    program([call(keep_numbers, float("nan"), 0, floats, integers)])()
    assert np.isnan(floats[0])


@pytest.mark.parametrize("whole", [0, -1, 2**62, -(2**63), np.int64(7), np.int32(-7), True, False])
def test_whole_numbers_are_constants(whole):
    floats, integers = np.zeros(1), np.zeros(1, dtype=np.int64)
    program([call(keep_numbers, 0.0, whole, floats, integers)])()
    assert integers[0] == int(whole)


def test_arrays_by_row_and_by_column():
    a = np.random.default_rng(0).standard_normal((3, 5))
    expected = [3.0, 5.0, (a * (10.0 * np.arange(3)[:, None] + np.arange(5))).sum()]
    for function, matrix in ((sum_by_row, a), (sum_by_column, np.asfortranarray(a))):
        sums = np.zeros(3)
        assert program([call(function, matrix, sums)])() == 0
        assert np.allclose(sums, expected)


def test_transposed_array_is_one_by_column():
    a, sums = np.random.default_rng(0).standard_normal((3, 5)), np.zeros(3)
    program([call(sum_by_column, a.T, sums)])()
    assert np.allclose(sums[2], (a.T * (10.0 * np.arange(5)[:, None] + np.arange(3))).sum())


def test_arrays_of_three_dimensions():
    a, sums = np.random.default_rng(0).standard_normal((2, 3, 4)), np.zeros(2)
    assert program([call(sum_of_layers, a, sums)])() == 0
    assert np.allclose(sums, (a * (10.0 * np.arange(3)[:, None] + np.arange(4))).sum(axis=(1, 2)))


def test_one_program_takes_arrays_of_any_size():
    for n in (0, 1, 5, 100):
        x = np.ones(n)
        program([call(double, x)])()
        assert np.all(x == 2.0)


def test_arrays_are_read_when_the_program_runs():
    a, b, total = np.zeros(2), np.ones(2), np.zeros(2)
    run = program([call(add, a, b, total)])
    a[:] = [1.0, 2.0]
    run()
    assert total.tolist() == [2.0, 3.0]


def test_one_array_in_several_calls_and_places():
    x = np.ones(3)
    run = program([call(double, x), call(add, x, x, x), call(double, x)])
    run()
    assert x.tolist() == [8.0] * 3
    run()
    assert x.tolist() == [64.0] * 3


def test_parts_of_an_array_are_written_in_place():
    x = np.ones((3, 4))
    program([call(double, x[1]), call(double, x[2, 1:3])])()
    assert x.tolist() == [[1.0] * 4, [2.0] * 4, [1.0, 2.0, 2.0, 1.0]]


def test_arrays_live_as_long_as_the_program():
    class Array(np.ndarray):
        """One that weak references can be made to, and a view of which is made."""

    whole = np.ones(100_000).view(Array)
    reference = weakref.ref(whole)
    run = program([call(double, whole[10:20])])
    del whole
    gc.collect()
    assert reference() is not None
    others = [np.zeros(100_000) for _ in range(20)]  # would take the place of what was let go
    assert run() == 0
    assert np.all(reference()[10:20] == 2.0)
    assert not any(other.any() for other in others)
    del run
    gc.collect()
    assert reference() is None


def test_arrays_of_python_functions_live_as_long_too():
    values = []
    run = program([call(values.append, np.ones(3)), call(double, np.ones(3))])
    gc.collect()
    run()
    assert values[0].tolist() == [1.0] * 3
