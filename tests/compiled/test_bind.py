"""Entries: kernels with their arguments, and what is refused since they would read memory as what it is
not."""

from __future__ import annotations

import gc
import weakref
from typing import NamedTuple

import numpy as np
import pytest

from mobman.compiled import bind, kernel, sequence


@kernel
def scale(x, factor):
    for i in range(x.shape[0]):
        x[i] *= factor


@kernel
def total(a, sums):
    """The entries' places and their numbers, so that a transposed view would show."""
    sums[0] = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            sums[0] += a[i, j] * (10.0 * i + j)


@kernel
def report(status):
    return status[0]


class Pair(NamedTuple):
    x: np.ndarray
    factor: float


@kernel
def scale_pair(pair):
    for i in range(pair.x.shape[0]):
        pair.x[i] *= pair.factor


A = np.zeros((4, 6))
READ_ONLY = np.zeros(3)
READ_ONLY.flags.writeable = False

REFUSED = {
    "stride": np.zeros(6)[::2],
    "backwards": np.zeros(6)[::-1],
    "column": A[:, 1],
    "block": A[1:3, 1:3],
    "turned tensor": np.zeros((2, 3, 4)).transpose(1, 0, 2),
    "single precision": np.zeros(3, dtype=np.float32),
    "short integers": np.zeros(3, dtype=np.int32),
    "complex": np.zeros(3, dtype=complex),
    "other bytes": np.zeros(3, dtype=">f8"),
    "read only": READ_ONLY,
    "list": [1.0, 2.0],
    "text": "1.0",
    "nothing": None,
    "in a tuple": (np.zeros(3), "text"),
}


@pytest.mark.parametrize("argument", REFUSED.values(), ids=REFUSED)
def test_arguments_that_are_refused(argument):
    with pytest.raises(
        TypeError, match=r"kernel 'scale': argument 'x' is .*; needed: a number, or"
    ):
        bind(scale, argument, 2.0)


def test_number_of_arguments():
    with pytest.raises(TypeError, match=r"kernel 'scale' takes 2 arguments; given: 1"):
        bind(scale, np.zeros(3))


def test_entry_reads_and_writes_its_arrays_in_place():
    x = np.arange(3.0)
    entry = bind(scale, x, 2.0)
    entry()
    x[0] = 5.0
    entry()
    assert x.tolist() == [10.0, 4.0, 8.0]


def test_arrays_by_row_and_by_column():
    a, sums = np.arange(6.0).reshape(2, 3), np.zeros(1)
    for same in (a, np.asfortranarray(a)):
        bind(total, same, sums)()
        assert sums[0] == sum(a[i, j] * (10.0 * i + j) for i in range(2) for j in range(3))


def test_named_tuples():
    x = np.arange(3.0)
    bind(scale_pair, Pair(x, 3.0))()
    assert x.tolist() == [0.0, 3.0, 6.0]


def test_entry_keeps_its_arrays_alive():
    x = np.arange(3.0)
    gone = weakref.ref(x)
    entry = bind(scale, x, 2.0)
    del x
    gc.collect()
    assert gone() is not None
    entry()
    del entry
    gc.collect()
    assert gone() is None


def test_function_that_is_no_kernel():
    found = []
    bind(found.append, 3)()
    assert found == [3]


def test_sequence_ends_with_the_first_status():
    x, status = np.ones(2), np.array([0, 7])
    run = sequence(bind(report, status[:1]), bind(scale, x, 2.0), bind(report, status[1:]))
    assert run() == 7
    assert x.tolist() == [2.0, 2.0]
    status[0] = 5
    assert run() == 5
    assert x.tolist() == [2.0, 2.0]
    assert sequence()() == 0


def test_kernel_without_a_file():
    """Typed in, say."""
    names: dict = {}
    exec("def double(x):\n    for i in range(x.shape[0]):\n        x[i] *= 2.0", names)
    x = np.arange(3.0)
    bind(kernel(names["double"]), x)()
    assert x.tolist() == [0.0, 2.0, 4.0]
