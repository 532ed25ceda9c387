"""How objects show themselves at a prompt and in a notebook."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from support.reported import made_up_record

import mobman as mm
from mobman.benchmark.runner import Outcome, Summary

HOSTILE = "<script>alert(1)</script>\n\x1b[31m"


def outcome(status):
    run = mm.load_suite("quick").runs()[0]
    return Outcome(run, status, "", 1e-9)


SHOWN = {
    "robot": lambda: mm.load_robot("youbot"),
    "record": made_up_record,
    "scenario": lambda: mm.load_scenario("heavier"),
    "suite": lambda: mm.load_suite("quick"),
    "summary": lambda: Summary(asked=3, skipped=1, outcomes=[outcome("ok"), outcome("failed")]),
    **{f"law {n}": lambda n=n: mm.make_controller(n) for n in mm.list_controllers()},
    **{f"task {n}": lambda n=n: mm.make_task(n, "youbot") for n in mm.list_tasks()},
}


def table_of(thing):
    table = ElementTree.fromstring(thing._repr_html_())  # no element is left open
    rows = table.find("tbody")
    return {row[0].text: row[1].text or "" for row in rows}


@pytest.mark.parametrize("name", SHOWN)
def test_one_line_and_a_table(name):
    thing = SHOWN[name]()
    line = repr(thing)
    assert "\n" not in line
    assert line.startswith(f"{type(thing).__name__}(")
    assert " at 0x" not in line
    assert len(table_of(thing)) >= 2


def test_a_law_says_the_gains_that_were_given():
    law = mm.make_controller("tsm", a=0.2, discretization="explicit")
    assert repr(law) == "TerminalSlidingMode('tsm', a=0.2, discretization='explicit')"
    shown = table_of(law)
    assert (shown["a"], shown["c"]) == ("0.2", "2")


def test_a_record_says_what_was_run_and_how_it_ended():
    record = made_up_record(status="diverged", message="at t = 0.3 s: |z| is 1e9")
    assert repr(record) == (
        "Record(youbot · circle · nominal · tsm: diverged, 1 s, at t = 0.3 s: |z| is 1e9)"
    )
    assert table_of(record)["task_error_max"] == "1e-09"


def test_a_scenario_says_what_it_changes():
    assert repr(mm.load_scenario("heavier")) == "Scenario('heavier', mass_factor=1.3, payload=1.0)"


def test_texts_of_others_are_neither_markup_nor_control_characters():
    record = made_up_record(robot=HOSTILE, message=HOSTILE, status="diverged")
    html = record._repr_html_()
    for text in (html, repr(record)):
        assert "\x1b" not in text
    assert "<script" not in html
    assert table_of(record)["robot"].startswith("<script>alert(1)</script>")
    assert "\n" not in repr(record)
