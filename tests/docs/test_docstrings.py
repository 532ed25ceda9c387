"""Docstrings of the public names: each says its arguments and has an example, and the examples run."""

from __future__ import annotations

import doctest
import inspect
import re

import pytest

import mobman as mm
from mobman.robots import catalogue

NAMES = [name for name in mm.__all__ if name != "__version__"]


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_described_with_an_example(name):
    thing = getattr(mm, name)
    text = inspect.getdoc(thing)
    assert ">>> " in text or name == "Comparison"
    first = text.partition("\n\n")[0]
    assert first.endswith(".")
    if inspect.isfunction(thing):
        for parameter in inspect.signature(thing).parameters.values():
            entry = rf"\n {{4,}}\**{parameter.name}: "
            assert re.search(entry, f"\n{text}".replace("\n", "\n    ")), parameter.name
        if inspect.signature(thing).parameters:
            assert "Raises:" in text


def test_every_public_method_is_described():
    for name in NAMES:
        thing = getattr(mm, name)
        for method, function in vars(thing).items() if inspect.isclass(thing) else ():
            if not method.startswith("_") and inspect.isfunction(function):
                assert inspect.getdoc(function), f"{name}.{method}"


def test_examples_of_the_docstrings_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(catalogue, "_registered", {})  # what an example registers stays its own
    finder, failed, tried = doctest.DocTestFinder(), [], 0
    for name in ("", *NAMES):
        thing = getattr(mm, name) if name else mm
        # of a class its methods, too; of the package itself the text alone
        tests = finder.find(thing, name or "mobman", module=False if name else mm, globs={})
        for test in tests if name else tests[:1]:
            runner = doctest.DocTestRunner(verbose=False)
            said: list[str] = []
            result = runner.run(test, out=said.append)
            tried += result.attempted
            if result.failed:
                failed.append("".join(said))
    assert not failed, "\n".join(failed)
    assert tried > 50
