"""Calling a kernel with arguments from a table of 64-bit words."""

from __future__ import annotations

import ast
import gc
import inspect
import struct
import textwrap
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types as numba_types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from mobman.arrays import Index
from mobman.kernels.cache import KernelCache
from mobman.kernels.kernel import OPTIONS, kernel

types: Any = numba_types  # typed in part only
_BOUND = types.int64(types.CPointer(types.int64))

# What reads a parameter with that annotation from the words, and how many of them it takes.
_READERS = {
    "Vector": ("_floats(_words[{0}], (_words[{1}],))", 2),
    "Matrix": ("_floats(_words[{0}], (_words[{1}], _words[{2}]))", 3),
    "Columns": ("_floats_by_column(_words[{0}], (_words[{1}], _words[{2}]))", 3),
    "Tensor": ("_floats(_words[{0}], (_words[{1}], _words[{2}], _words[{3}]))", 4),
    "Index": ("_integers(_words[{0}], (_words[{1}],))", 2),
    "int": ("_words[{0}]", 1),
    "float": ("_number(_words[{0}])", 1),
}
_WHOLE = (int, np.integer)
_REAL = (float, int, np.floating, np.integer)
_FLOAT, _BITS = struct.Struct("d"), struct.Struct("q")
_compiled: dict[Any, Any] = {}


class Held(NamedTuple):
    """An array that a table points to."""

    array: Any
    kinds: frozenset[str]
    """Annotations that it satisfies."""
    words: tuple[int, ...]
    """Its address and its shape."""


def words_of(function: Any, arguments: tuple[Any, ...], held: dict[int, Held]) -> list[int]:
    """The words that stand for a kernel's arguments: an array's address and shape, a number itself.

    Args:
        function: The kernel.
        arguments: Its arguments.
        held: Arrays by ``id``, added to here; they must outlive the words.

    Raises:
        TypeError: If an argument is not what the kernel's annotation says.
    """
    annotations = _annotations(function.py_func)
    if len(annotations) != len(arguments):
        raise TypeError(
            f"kernel {function.__name__!r} takes {len(annotations)} arguments; given: {len(arguments)}"
        )
    words: list[int] = []
    for argument, (name, kind) in zip(arguments, annotations, strict=True):
        known = held.get(id(argument))
        if known is None and isinstance(argument, np.ndarray):
            known = held[id(argument)] = _held(argument)
        if known is not None and kind in known.kinds:
            words += known.words
        elif known is None and kind == "float" and isinstance(argument, _REAL):
            words += _BITS.unpack(_FLOAT.pack(argument))
        elif known is None and kind == "int" and isinstance(argument, _WHOLE):
            words.append(int(argument))
        else:
            raise TypeError(
                f"kernel {function.__name__!r}: argument {name!r} is {_described(argument)}; "
                f"needed: {kind}"
            )
    return words


def _held(array: Any) -> Held:
    dtype, ndim, flags = array.dtype, array.ndim, array.flags
    kinds = set()
    if flags.c_contiguous:
        kinds = {(np.dtype(np.int64), 1): {"Index"}}.get((dtype, ndim), set())
        if dtype == np.float64:
            kinds = {1: {"Vector"}, 2: {"Matrix"}, 3: {"Tensor"}}.get(ndim, set())
    if flags.f_contiguous and dtype == np.float64 and ndim == 2:
        kinds = kinds | {"Columns"}
    address = array.__array_interface__["data"][0]
    return Held(array, frozenset(kinds), (address, *array.shape))


def address_of(function: Any) -> int:
    """The address of a C function that runs a kernel's body, given a pointer to its arguments' words."""
    if function not in _compiled:
        # the first stays, if two threads come at once: its address may be in tables already
        _compiled.setdefault(function, _compile(function.py_func))
    return int(_compiled[function].address)


@cache
def _annotations(function: Callable[..., Any]) -> list[tuple[str, str]]:
    """Names of the parameters, and what they are to be."""
    found = [(name, kind) for name, kind in function.__annotations__.items() if name != "return"]
    if not all(isinstance(kind, str) for _, kind in found):
        # values that can no longer be told apart: the text can
        parameters = _definition(function).args.args
        found = [(one.arg, ast.unparse(one.annotation or ast.Constant(None))) for one in parameters]
    for name, kind in found:
        if kind not in _READERS:
            raise TypeError(
                f"kernel {function.__name__!r}: parameter {name!r} is annotated {kind!r}; allowed: "
                f"{', '.join(_READERS)}"
            )
    return found


def _described(argument: Any) -> str:
    if isinstance(argument, np.ndarray):
        return f"an array of {argument.dtype} of shape {argument.shape} with strides {argument.strides}"
    return repr(argument)


def _compile(function: Callable[..., Any]) -> Any:
    """The kernel as a C function: its own body, with its parameters read from the words."""
    definition = _definition(function)
    reading = []
    at = 0
    for name, kind in _annotations(function):
        text, length = _READERS[kind]
        reading.append(f"{name} = {text.format(*range(at, at + length))}")
        at += length
    body = [_Status().visit(node) for node in definition.body]
    definition.args.args = [ast.arg("_words")]
    definition.body = [*ast.parse("\n".join(reading)).body, *body, ast.Return(ast.Constant(0))]
    definition.decorator_list, definition.returns = [], None
    tree = ast.Module([definition], [])
    ast.increment_lineno(tree, function.__code__.co_firstlineno - 1)
    namespace = {
        **function.__globals__,
        "_floats": _floats,
        "_floats_by_column": _floats_by_column,
        "_integers": _integers,
        "_number": _number,
    }
    code = compile(ast.fix_missing_locations(tree), function.__code__.co_filename, "exec")
    exec(code, namespace)
    entry: Any = namespace[function.__name__]
    entry.__qualname__ = f"{function.__qualname__}.bound"
    compiled: Any = CFunc(entry, (_BOUND.args, _BOUND.return_type), {}, OPTIONS)
    compiled._cache = KernelCache(entry)
    collecting = gc.isenabled()
    gc.disable()  # a compiler makes many objects, and few cycles: a sixth of its time
    try:
        compiled.compile()
    finally:
        if collecting:
            gc.enable()
    return compiled


def _definition(function: Callable[..., Any]) -> ast.FunctionDef:
    """A function's text, parsed.

    Raises:
        TypeError: If it has none.
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except OSError as error:
        raise TypeError(
            f"kernel {function.__name__!r} has no source text; write it in a file"
        ) from error
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    return definition


class _Status(ast.NodeTransformer):
    """Returns without a value report success."""

    def visit_Return(self, node: ast.Return) -> ast.Return:
        return node if node.value is not None else ast.Return(ast.Constant(0))


def _view(dtype: Any, layout: str) -> Any:
    """An intrinsic: the array of that type at an address."""

    @intrinsic  # type: ignore[untyped-decorator]
    def view(typing: Any, address: Any, shape: Any) -> Any:
        array = types.Array(dtype, shape.count, layout)

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            size = context.get_constant(types.intp, 8)
            lengths = [builder.extract_value(arguments[1], i) for i in range(shape.count)]
            strides, step = [], size
            for length in reversed(lengths) if layout == "C" else lengths:
                strides.append(step)
                step = builder.mul(step, length)
            result = context.make_array(array)(context, builder)
            populate_array(
                result,
                data=builder.inttoptr(arguments[0], result.data.type),
                shape=lengths,
                strides=strides[::-1] if layout == "C" else strides,
                itemsize=size,
                meminfo=None,
            )
            return result._getvalue()

        return array(types.int64, shape), codegen

    return view


_floats = _view(types.float64, "C")
_floats_by_column = _view(types.float64, "F")
_integers = _view(types.int64, "C")


@intrinsic  # type: ignore[untyped-decorator]
def _number(typing: Any, bits: Any) -> Any:
    """The float with these 64 bits."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), codegen


@intrinsic  # type: ignore[untyped-decorator]
def _invoke(typing: Any, address: Any, table: Any, position: Any) -> Any:
    """Call the C function at an address with a pointer to the table's words from a position on."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        function = builder.inttoptr(
            arguments[0], ir.FunctionType(word, [word.as_pointer()]).as_pointer()
        )
        words = context.make_array(signature.args[1])(context, builder, arguments[1]).data
        return builder.call(function, [builder.gep(words, [arguments[2]])])

    return types.int64(types.int64, table, types.int64), codegen


@cache
def runner() -> Callable[[Index], int]:
    """The machine code of :func:`run` behind a plain function: numba's dispatcher would look at the
    types of its argument at every call, which costs more than the call."""
    run(np.zeros(1, dtype=np.int64))
    compiled: Callable[[Index], int] = run.get_overload(run.signatures[0])  # type: ignore[attr-defined]
    return compiled


@kernel
def run(table: Index) -> int:
    """Make the calls of a table: their number, then for each the address of its machine code, the
    number of its words, and the words. The status of the first that reports one, or 0."""
    position = 1
    for _ in range(table[0]):
        status = _invoke(table[position], table, position + 2)
        if status != 0:
            return int(status)
        position += 2 + table[position + 1]
    return 0
