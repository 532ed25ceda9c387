"""What a report counts once: robots on the same platform, and laws that are one."""

from __future__ import annotations

import math

import pytest
from support.reported import made_up_run, results_of

import mobman as mm
from mobman.benchmark.report.data import _base_of
from mobman.benchmark.report.findings import limitations_of
from mobman.benchmark.report.standings import board_of, clusters, unit_of
from mobman.benchmark.report.tables import information_table, leaderboard_table, pairs_table
from mobman.robots.catalogue import find_spec


def runs(errors, robots, scenarios=("nominal",), **fields):
    """Runs of labels, with an error each, times what is the robot's own."""
    return results_of(
        [
            made_up_run(
                label,
                error * 2.0**i,
                robot=robot,
                scenario=scenario,
                **fields.get(label, {}),
                base=robot.partition("_")[0],
            )
            for i, robot in enumerate(robots)
            for scenario in scenarios
            for label, error in errors.items()
        ]
    )


def test_robots_on_the_same_platform_are_found_by_their_descriptions():
    bases = {}
    for name in mm.list_robots():
        base = _base_of(find_spec(name).model_dump(mode="json", by_alias=True))
        bases.setdefault(base or name, []).append(name)
    shared = {tuple(names) for names in bases.values() if len(names) > 1}
    assert shared >= {
        ("husky_kinova", "husky_ur5", "husky_xarm7"),
        ("jackal_ur3", "jackal_z1"),
        ("ridgeback_panda", "ridgeback_ur10"),
        ("tiago", "tiago_dual", "tiago_no_hand"),
    }
    assert ["youbot"] in bases.values()
    assert ["fixed_panda"] in bases.values()


@pytest.mark.parametrize("broken", [None, 3, {}, {"platform": []}, {"platform": {"type": "fixed"}}])
def test_of_a_strangers_record_nothing_is_supposed(broken):
    assert _base_of(broken) == ""


def test_copies_are_one_cell_with_few_platforms():
    found = runs({"a": 1e-6, "b": 1e-3}, ["tiago_1", "tiago_2", "husky_1"], ["nominal", "heavier"])
    names = clusters(found, found.cells.index)
    assert unit_of(found, found.cells.index) == "cell"
    assert len(names) == 6
    assert len(set(names)) == 4
    board = board_of(found)
    assert (board.unit, board.units) == ("cell", 4)
    assert any("not with other robots" in text for text in limitations_of(found))


def test_platforms_are_the_unit_with_many():
    robots = [f"base{i}_{j}" for i in range(10) for j in range(2)]
    found = runs({"a": 1e-6, "b": 1e-3}, robots, ["nominal", "heavier"])
    board = board_of(found)
    assert (board.unit, board.units, len(board.cells)) == ("robot", 10, 40)
    assert board.pairs[0].error.smallest_p == 2.0**-9
    assert any("with robots like these" in text for text in limitations_of(found))
    assert "intervals of errors: of 10 platforms" in leaderboard_table(board).caption


def test_verdicts_are_those_of_so_many_units():
    """Eight cells of each of two platforms' copies are too few, whatever their number."""
    robots = [f"tiago_{j}" for j in range(20)]
    board = board_of(runs({"a": 1e-9, "b": 1e-3, "c": 1.0}, robots, ["x", "y", "z"]))
    verdicts = {row[-1].text for row in pairs_table(board.pairs).rows}
    assert verdicts == {"too few cells to say"}
    assert all(standing.ranks == (1, 3) for standing in board.ranked)


LAWS = {"tsm": {"law": "tsm"}, "inverse": {"law": "tsm-inverse-actuation"}}


def test_laws_that_are_one_are_shown_as_one():
    robots = [f"base{i}" for i in range(12)]
    found = runs({"tsm": 1e-6, "inverse": 1.05e-6, "other": 1e-3}, robots, **LAWS)
    board = board_of(found)
    assert [(s.label, s.twins) for s in board.ranked] == [("tsm", ("inverse",)), ("other", ())]
    assert [(pair.a, pair.b) for pair in board.pairs] == [("tsm", "other")]
    entry = leaderboard_table(board).rows[0][1]
    assert (entry.text, entry.unit) == ("tsm", "the same as inverse")
    assert "differ by 10 % at most" in entry.detail


@pytest.mark.parametrize(
    ("error", "laws"),
    [
        (2e-6, LAWS),
        (math.inf, LAWS),
        (1e-6, {**LAWS, "inverse": {"law": "adaptive"}}),
        (1e-6, {**LAWS, "inverse": {"law": "tsm"}}),  # with other gains
    ],
)
def test_laws_that_differ_anywhere_are_not(error, laws):
    board = board_of(runs({"tsm": 1e-6, "inverse": error}, [f"base{i}" for i in range(12)], **laws))
    assert [s.twins for s in board.ranked] == [(), ()]


def test_rounding_is_no_difference():
    found = runs({"tsm": 1e-14, "inverse": 5e-14}, [f"base{i}" for i in range(12)], **LAWS)
    assert [s.twins for s in board_of(found).ranked] == [("inverse",)]


@pytest.mark.parametrize(("factor", "twins"), [(1.5, ("inverse",)), (3.0, ()), (math.inf, ())])
def test_one_cell_in_which_twins_differ(factor, twins):
    """A little, as near rounding; by more, or by an early end, they are two."""
    rows = list(runs({"tsm": 1e-6, "inverse": 1e-6}, [f"base{i}" for i in range(12)], **LAWS).rows)
    rows[1] = made_up_run("inverse", 1e-6 * factor, robot="base0", base="base0", **LAWS["inverse"])
    assert board_of(results_of(rows)).ranked[0].twins == twins


def test_information_is_that_of_the_gains_and_the_best_of_each_group_is_marked():
    laws = {
        "hedge": {"law": "tsm", "gains": {"saturation": "hedge"}},
        "tsm": {"law": "tsm"},
        "time-delay": {"law": "time-delay"},
    }
    errors = {"hedge": 1e-9, "time-delay": 1e-6, "tsm": 1e-3}
    found = runs(errors, [f"base{i}" for i in range(12)], **laws)
    groups, marks = {}, {}
    for row in information_table(found, board_of(found)).rows:
        if len(row) == 1:
            members = groups.setdefault(row[0].text, [])
        else:
            members.append(row[0].text)
            marks[row[0].text] = row[-2].mark
    assert groups == {
        "use z', M, J', limits": ["hedge", "time-delay"],
        "use z', M, J'": ["tsm"],
    }
    assert marks == {"hedge": "best", "time-delay": "", "tsm": ""}
