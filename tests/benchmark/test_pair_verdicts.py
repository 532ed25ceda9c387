"""The verdict on two controllers, as one of several pairs."""

from __future__ import annotations

import pytest
from support.reported import made_up_runs, results_of

from mobman.benchmark.report.standings import board_of
from mobman.benchmark.report.tables import pairs_table


def verdicts(errors, cells):
    runs = made_up_runs(errors, [f"scenario-{i}" for i in range(cells)])
    rows = pairs_table(board_of(results_of(runs)).pairs).rows
    return {row[0].text: row[-1].text for row in rows}


@pytest.mark.parametrize(
    ("labels", "cells", "verdict"),
    [
        (2, 8, "best has the smaller error"),  # 2^-7 = 0.008
        (6, 8, "too few cells to say"),  # 15 2^-7 = 0.12
        (6, 10, "best has the smaller error"),  # 15 2^-9 = 0.03
    ],
)
def test_best_in_every_cell_by_seven_decades(labels, cells, verdict):
    others = {f"other-{i}": 1e8 for i in range(labels - 1)}
    found = verdicts({"best": 10.0, **others}, cells)
    assert {text for pair, text in found.items() if "best" in pair} == {verdict}


def test_equals_on_enough_cells_are_not_distinguished():
    assert set(verdicts({"one": 1.0, "other": 1.0}, 24).values()) == {"not distinguished"}
