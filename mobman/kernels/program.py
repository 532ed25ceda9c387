"""Programs: kernels in sequence, with their arguments bound once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from mobman.kernels.calling import Held, address_of, runner, words_of
from mobman.kernels.kernel import is_compiled

Program = Callable[[], int]
"""Runs its kernels; 0, or the status of the first that reported one, which ends it."""


class Call(NamedTuple):
    """A kernel and what it is to be called with."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


def call(function: Callable[..., Any], *arguments: Any) -> Call:
    """A step of a program.

    Args:
        function: A kernel that returns None or a status; or any function of Python, at the price of
            a call of its own.
        *arguments: Contiguous arrays of floats or of integers, read and written in place for as long
            as the program lives, and numbers, which are constants of it.
    """
    return Call(function, arguments)


def program(calls: Iterable[Call]) -> Program:
    """One function that makes all the calls; their arrays must stay where they are in memory.

    A numba function spends more time on unpacking its arrays from Python objects than these kernels on
    their work. So a program reads addresses and shapes from a table that is filled here.

    Raises:
        TypeError: If an argument of a kernel is not what its annotation says.
    """
    parts: list[Program] = []
    for compiled, items in groupby(calls, lambda item: is_compiled(item.function)):
        steps = list(items)
        parts.append(_compiled(steps) if compiled else _interpreted(steps))
    return parts[0] if len(parts) == 1 else _sequence(parts)


def _compiled(calls: list[Call]) -> Program:
    table = [len(calls)]
    held: dict[int, Held] = {}
    for function, arguments in calls:
        words = words_of(function, arguments, held)
        table += [address_of(function), len(words), *words]
    program: Any = partial(runner(), np.array(table, dtype=np.int64))
    program.held = held  # what the addresses point to lives as long as the program
    result: Program = program
    return result


def _interpreted(calls: list[Call]) -> Program:
    def interpreted() -> int:
        for function, arguments in calls:
            if status := function(*arguments):
                return int(status)
        return 0

    return interpreted


def _sequence(parts: list[Program]) -> Program:
    def sequence() -> int:
        for part in parts:
            if status := part():
                return status
        return 0

    return sequence
