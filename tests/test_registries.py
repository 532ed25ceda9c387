"""Names to things: found by looking, answered with the nearest, extended by other packages."""

from __future__ import annotations

import importlib
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import EntryPoint

import pytest

import mobman as mm
from mobman import registry
from mobman.errors import UnknownNameError
from mobman.registry import Registry

THING = object()


class Ends:
    """What is imported by looking for an attribute ends the process."""

    def __getattr__(self, name):
        raise {"leaves": SystemExit(3), "stops": KeyboardInterrupt}[name]


ENDS = Ends()


@pytest.fixture
def things():
    return Registry("thing", "mobman.tasks", "mobman.test_things")


@pytest.fixture
def plugins(monkeypatch):
    points = [
        EntryPoint("good", f"{__name__}:THING", "mobman.test_things"),
        EntryPoint("broken", "no_such_package:thing", "mobman.test_things"),
        EntryPoint("leaves", f"{__name__}:ENDS.leaves", "mobman.test_things"),
        EntryPoint("stops", f"{__name__}:ENDS.stops", "mobman.test_things"),
    ]
    monkeypatch.setattr(
        registry, "entry_points", lambda group: points if group == "mobman.test_things" else []
    )


def test_registered_thing_is_found_and_listed(things):
    things.register("b", 2)
    things.register("a", 1)
    assert things.names() == ["a", "b"]
    assert things.get("b") == 2


def test_decorator_registers_what_it_decorates(things):
    @things.register("a")
    def a():
        return 1

    assert things.get("a") is a
    assert a() == 1


def test_later_one_replaces_the_earlier(things):
    things.register("a", 1)
    assert things.register("a", 2) == 2
    assert things.get("a") == 2


def test_modules_of_the_package_register_themselves():
    """One new file is enough: nothing lists the laws."""
    from mobman.controllers.protocol import controllers

    assert "tsm" in controllers.names()
    assert controllers.get("tsm").__module__ == "mobman.controllers.tsm"


def test_unknown_name_is_answered_with_the_nearest_and_all(things):
    things.register("circle", 1)
    things.register("line", 2)
    with pytest.raises(UnknownNameError) as caught:
        things.get("circel")
    assert str(caught.value) == (
        "unknown thing 'circel'; did you mean 'circle'? valid names: circle, line"
    )
    assert caught.value.choices == ["circle", "line"]


def test_empty_registry_says_so(things):
    with pytest.raises(UnknownNameError, match="valid names: none"):
        things.get("anything")


@pytest.mark.usefixtures("plugins")
def test_thing_of_another_package(things):
    things.register("own", 1)
    assert things.names() == ["broken", "good", "leaves", "own", "stops"]
    assert things.get("good") is THING


@pytest.mark.usefixtures("plugins")
def test_broken_package_is_left_out_with_a_warning(things):
    with (
        pytest.warns(UserWarning, match="thing 'broken' of no_such_package:thing is left out"),
        pytest.raises(UnknownNameError) as caught,
    ):
        things.get("broken")
    assert "did you mean 'broken'" not in str(caught.value)
    assert things.get("good") is THING


@pytest.mark.usefixtures("plugins")
def test_package_that_ends_the_process_is_left_out_with_a_warning(things):
    with (
        pytest.warns(UserWarning, match=r"thing 'leaves' of .* is left out: SystemExit\(3\)"),
        pytest.raises(UnknownNameError),
    ):
        things.get("leaves")
    with pytest.raises(KeyboardInterrupt):
        things.get("stops")


def test_threads_that_look_at_once_all_find_everything(tmp_path, monkeypatch):
    """However they come to it: by all names, by one of them, or by importing a module themselves."""
    package = tmp_path / "slow_things"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from mobman.registry import Registry\nthings = Registry('thing', __name__)\n"
    )
    for name in "abcd":
        (package / f"{name}.py").write_text(
            "import time\nfrom slow_things import things\n"
            f"time.sleep(0.01)\nthings.register({name!r}, 1)\n"
            f"time.sleep(0.01)\nthings.register('more-{name}', 2)\n"
        )
    monkeypatch.syspath_prepend(tmp_path)
    things = importlib.import_module("slow_things").things
    ways = [
        things.names,
        lambda: things.get("more-d"),
        lambda: things.get("c"),
        things.loaded,
        lambda: importlib.import_module("slow_things.d"),
        lambda: importlib.import_module("slow_things.b"),
        lambda: things.register("a", 3),
    ]

    def look(way):
        way()
        return things.names()

    with ThreadPoolExecutor(len(ways)) as pool:
        found = list(pool.map(look, ways, timeout=20))
    assert found == [["a", "b", "c", "d", "more-a", "more-b", "more-c", "more-d"]] * len(ways)
    assert things.get("a") == 3  # nothing that was found later replaced it
    for module in [name for name in sys.modules if name.startswith("slow_things")]:
        del sys.modules[module]


@pytest.mark.parametrize("name", [[], {}, None, 3])
def test_what_is_no_name_is_an_unknown_one(name):
    for make in (mm.make_controller, lambda name: mm.make_task(name, "youbot")):
        with pytest.raises(UnknownNameError, match=re.escape(repr(name))):
            make(name)
