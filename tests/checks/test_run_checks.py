"""What running the checks gives, whatever the checks do."""

from __future__ import annotations

import pytest

import mobman as mm
from mobman.checks.checks import Check, checks, list_checks, ok, run_checks, warning
from mobman.errors import UnknownNameError

KINDS = {
    "closed-loop", "constraints", "criterion", "derivatives", "fold", "following", "gravity", "ground",
    "inertias", "limits", "meshes", "reach", "singularities", "urdf", "weights", "wheel-radius",
}  # fmt: skip
SIMULATING = {"closed-loop", "fold"}


@pytest.fixture
def registered(monkeypatch):
    """Registers a check for the time of a test."""
    list_checks()  # the package's own come first

    def register(name, function):
        monkeypatch.setitem(checks._items, name, Check(name, "what it means", function, False))

    return register


def test_checks_are_found_by_looking():
    assert {item.name for item in list_checks()} == KINDS
    assert all(item.meaning for item in list_checks())
    assert {item.name for item in list_checks() if item.simulates} == SIMULATING


def test_every_check_gives_a_finding(youbot):
    findings = run_checks(youbot)
    assert {item.check for item in findings} == KINDS
    assert [item.check for item in findings] == sorted(item.check for item in findings)
    assert all(item.status in ("ok", "warning", "wrong") and item.found for item in findings)


def test_simulation_is_left_out(youbot):
    assert {item.check for item in run_checks(youbot, simulation=False)} == KINDS - SIMULATING


def test_check_that_raises_is_a_finding_and_hides_nothing(youbot, registered):
    def broken(subject):
        yield ok("the first part is fine")
        raise ZeroDivisionError("by\nnothing")

    registered("broken", broken)
    findings = run_checks(youbot, only=["broken", "constraints"])
    assert [(item.check, item.status) for item in findings] == [
        ("broken", "ok"), ("broken", "wrong"), ("constraints", "ok"),
    ]  # fmt: skip
    assert findings[1].found == "the check ended with ZeroDivisionError: by nothing"
    assert "what it means" in findings[1].fix


def test_check_that_finds_nothing_is_fine(youbot, registered):
    registered("silent", lambda subject: [])
    (finding,) = run_checks(youbot, only=["silent"])
    assert (finding.status, finding.found, finding.fix) == ("ok", "what it means", "")


def test_that_all_is_well_is_said_alone(youbot, registered):
    def told(*found):
        yield from found
        return "all is well"

    registered("well", lambda subject: told())
    registered("nearly", lambda subject: told(warning("odd", "look")))
    findings = run_checks(youbot, only=["well", "nearly"])
    assert [(item.check, item.status, item.found, item.fix) for item in findings] == [
        ("nearly", "warning", "odd", "look"), ("well", "ok", "all is well", ""),
    ]  # fmt: skip


def test_unknown_check_is_refused(youbot):
    with pytest.raises(UnknownNameError, match="did you mean 'inertias'"):
        run_checks(youbot, only=["inertia"])


def test_checks_leave_the_robot_as_it_was():
    robot = mm.load_robot("youbot")
    rest, gravity = robot.q_rest.copy(), robot.model.gravity.linear.copy()
    run_checks(robot)
    assert (robot.q_rest == rest).all()
    assert (robot.model.gravity.linear == gravity).all()
