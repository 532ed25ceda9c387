"""Faults of a suite's file: all at once, each with its line."""

from __future__ import annotations

import re

import pytest
from support.command_line import mobman

import mobman as mm
from mobman.errors import SpecError
from mobman.toml_model import TomlLines

TEXT = '''schema = 1
name = "suite"  # groups = 3
about = """
duration = 5
"""
"quoted key" = 1

[controllers.a]
law = "tsm"
gains = { c = 2.0 }

[[groups]]
robots = [
  "youbot",
  "tiago",
]
[[groups]]
tasks = ["circle"]
[groups.gains.a]
c = 3.0
[[overrides]]
where = { robots = ["tiago"] }
'''


@pytest.mark.parametrize(
    ("place", "word", "line"),
    [
        (("schema",), "", 1),
        (("duration",), "", None),
        (("quoted key",), "", 6),
        (("controllers", "a"), "", 8),
        (("controllers", "a", "law"), "", 9),
        (("controllers", "a"), "tsm", 9),
        (("controllers", "b"), "", None),
        (("groups", 0, "robots"), "", 13),
        (("groups", 0), "tiago", 15),
        (("groups", 0), "circle", 12),
        (("groups", 1), "", 17),
        (("groups", 1, "gains", "a", "c"), "", 20),
        (("overrides", 0, "where", "robots", 0), "", 22),
        ((), "", None),
    ],
)
def test_lines_of_fields(place, word, line):
    assert TomlLines(TEXT).line(place, word) == line


def suite(folder, text):
    path = folder / "suite.toml"
    path.write_text(text)
    return path


UNKNOWN = """schema = 1
name = "names"
duration = 1.0

[controllers.a]
law = "tms"

[controllers.b]
law = "tsm"
gains = { c = 0.1 }

[[groups]]
robots = ["yuobot"]
tasks = ["circel"]
scenarios = [
  "havier",
]

[[overrides]]
where = { robots = ["nobody"] }
dt = 0.002
"""


def test_every_unknown_name_has_its_line(tmp_path):
    path = suite(tmp_path, UNKNOWN)
    done = mobman("bench", "show", path)
    assert (done.returncode, done.stdout) == (2, "")
    first, *lines = done.stderr.splitlines()
    assert first == f"mobman: suite 'names': {len(lines)} faults"
    found = {int(re.match(r"  line (\d+): ", line)[1]): line for line in lines}
    expected = {6: "tms", 8: "c = 0.1", 13: "yuobot", 14: "circel", 16: "havier", 19: "overrides.0"}
    assert list(found) == sorted(expected)
    for line, word in expected.items():
        assert word in found[line], line
    with pytest.raises(SpecError, match=r"line 6: .*line 16: "):
        mm.load_suite(path).runs()


def test_every_wrong_field_has_its_line(tmp_path):
    text = 'schema = 1\nname = "wrong"\nduration = -1\n[controllers.a]\nlow = "tsm"\n'
    text += "[[groups]]\nrobots = 3\n"
    done = mobman("bench", "run", suite(tmp_path, text))
    assert done.returncode == 2
    _, *lines = done.stderr.splitlines()
    numbers = [int(re.match(r"  line (\d+): ", line)[1]) for line in lines]
    assert numbers == sorted(numbers)
    assert set(numbers) == {3, 4, 5, 6, 7}
    assert "'groups.0.tasks' is missing" in lines[numbers.index(6)]


def test_one_fault_is_one_line_and_a_suite_without_a_file_has_no_lines(tmp_path):
    path = suite(
        tmp_path, UNKNOWN.replace('law = "tms"', 'law = "tsm"').split("[controllers.b]")[0]
    )
    done = mobman("bench", "run", path)
    assert done.stderr.count("\n") == 1
    assert "'groups' is missing" in done.stderr
    content = mm.load_suite("quick").model_dump(by_alias=True, exclude_unset=True)
    content["groups"] = [{"robots": ["yuobot"], "tasks": ["circel"]}]
    with pytest.raises(SpecError) as caught:
        mm.Suite.model_validate(content).runs()
    assert "line " not in str(caught.value)
    assert len(caught.value.faults) == 2


def test_lines_do_not_make_suites_differ():
    one = mm.load_suite("quick")
    assert one.lines is not None
    assert one == mm.Suite.model_validate(one.model_dump(by_alias=True))


def test_a_urdf_in_the_place_of_a_description_leads_to_robots_add(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text('<?xml version="1.0"?>\n<robot name="a"><link name="b"/></robot>\n')
    with pytest.raises(
        SpecError, match=rf"looks like XML.*mobman robots add {re.escape(str(path))}"
    ):
        mm.load_robot(path)
    with pytest.raises(SpecError) as caught:
        mm.load_scenario(path)
    assert "robots add" not in str(caught.value)
