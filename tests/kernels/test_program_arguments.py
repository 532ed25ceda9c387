"""What a program refuses to bind: it would read memory that is something else."""

from __future__ import annotations

import numpy as np
import pytest

from mobman.arrays import Columns, Index, Matrix, Tensor, Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import call, program


@kernel
def vector(x: Vector) -> None: ...


@kernel
def matrix(a: Matrix) -> None: ...


@kernel
def columns(a: Columns) -> None: ...


@kernel
def tensor(a: Tensor) -> None: ...


@kernel
def index(i: Index) -> None: ...


@kernel
def number(a: float) -> None: ...


@kernel
def whole(n: int) -> None: ...


@kernel
def two(x: Vector, a: float) -> None: ...


@kernel
def unknown(x: list) -> None: ...


@kernel
def bare(x, a: float) -> None: ...


A = np.zeros((4, 6))

REFUSED = {
    "stride": (vector, np.zeros(6)[::2]),
    "backwards": (vector, np.zeros(6)[::-1]),
    "column": (vector, A[:, 1]),
    "single precision": (vector, np.zeros(3, dtype=np.float32)),
    "integers": (vector, np.zeros(3, dtype=np.int64)),
    "complex": (vector, np.zeros(3, dtype=complex)),
    "other bytes": (vector, np.zeros(3, dtype=">f8")),
    "matrix for a vector": (vector, A),
    "number for a vector": (vector, 1.0),
    "list for a vector": (vector, [1.0, 2.0]),
    "no dimension": (vector, np.zeros(())),
    "vector for a matrix": (matrix, np.zeros(4)),
    "by column for by row": (matrix, A.T),
    "block": (matrix, A[1:3, 1:3]),
    "by row for by column": (columns, A),
    "tensor for a matrix": (matrix, np.zeros((2, 3, 4))),
    "matrix for a tensor": (tensor, A),
    "turned tensor": (tensor, np.zeros((2, 3, 4)).transpose(1, 0, 2)),
    "floats for an index": (index, np.zeros(3)),
    "short integers": (index, np.zeros(3, dtype=np.int32)),
    "unsigned integers": (index, np.zeros(3, dtype=np.uint64)),
    "array for a number": (number, np.zeros(1)),
    "text": (number, "1.0"),
    "nothing": (number, None),
    "complex number": (number, 1j),
    "array for a whole number": (whole, np.zeros(1, dtype=np.int64)),
    "float for a whole number": (whole, 1.0),
}


@pytest.mark.parametrize("case", REFUSED)
def test_argument_that_does_not_fit_is_refused(case):
    function, argument = REFUSED[case]
    wanted = {
        vector: "Vector", matrix: "Matrix", columns: "Columns", tensor: "Tensor", index: "Index",
        number: "float", whole: "int",
    }[function]  # fmt: skip
    with pytest.raises(
        TypeError, match=rf"kernel '{function.__name__}': argument '\w' is .*; needed: {wanted}$"
    ):
        program([call(function, argument)])


def test_message_says_what_the_array_is():
    with pytest.raises(
        TypeError, match=r"array of float64 of shape \(2, 2\) with strides \(48, 8\)"
    ):
        program([call(matrix, A[1:3, 1:3])])


@pytest.mark.parametrize("arguments", [(), (np.zeros(3),), (np.zeros(3), 1.0, 2.0)])
def test_number_of_arguments_must_be_right(arguments):
    with pytest.raises(TypeError, match=rf"'two' takes 2 arguments; given: {len(arguments)}"):
        program([call(two, *arguments)])


def test_parameters_need_annotations_that_are_known():
    with pytest.raises(TypeError, match="parameter 'x' is annotated 'list'; allowed: Vector"):
        program([call(unknown, [1.0])])
    with pytest.raises(TypeError, match="'bare'"):
        program([call(bare, np.zeros(3), 1.0)])


def test_functions_of_python_take_anything():
    seen = []
    program([call(seen.append, None), call(seen.append, A[:, 1])])()
    assert seen[0] is None
    assert seen[1].shape == (4,)
