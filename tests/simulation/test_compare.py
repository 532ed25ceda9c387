"""Runs side by side."""

from __future__ import annotations

import numpy as np
import pytest
from support.reported import made_up_record

import mobman as mm
from mobman.errors import RecordError, UsageError


def test_runs_are_labelled_by_what_they_differ_in():
    one, two = made_up_record(), made_up_record(controller="pseudo-inverse")
    other = made_up_record(scenario="heavier")
    assert list(mm.compare([one, two]).records) == ["tsm", "pseudo-inverse"]
    assert list(mm.compare([one, other]).records) == ["nominal", "heavier"]
    assert list(mm.compare([one, two, other]).records) == [
        "tsm · nominal",
        "pseudo-inverse · nominal",
        "tsm · heavier",
    ]
    assert list(mm.compare([one, one]).records) == ["tsm (1)", "tsm (2)"]
    assert list(mm.compare({"a": one, "b": one}).records) == ["a", "b"]
    assert repr(mm.compare([one, two])) == "Comparison(tsm, pseudo-inverse)"


def test_table_has_a_row_a_run():
    both = mm.compare([made_up_record(), made_up_record(seed=4, robot="<b>tiago</b>")])
    table = both.table
    assert table["seed"].tolist() == [0, 4]
    assert table["task_error_max"].tolist() == [1e-9, 1e-9]
    html = both._repr_html_()
    assert "task_error_max" in html
    assert "<b>tiago" not in html


def test_figure_has_every_run_in_every_panel(tmp_path):
    ended = made_up_record(controller="pseudo-inverse", status="diverged", message="at t = 1 s")
    ended.torque[-1] = np.inf
    both = mm.compare([made_up_record(), ended])
    panels = both.plot().to_dict()["vconcat"]
    assert len(panels) == 3
    for panel in panels:
        labels = {row["label"] for row in panel["data"]["values"]}
        assert labels == {"tsm", "pseudo-inverse"}
    assert both.plot(tmp_path / "both.svg").read_text(encoding="utf-8").count("pseudo-inverse")


def test_files_are_read_and_others_refused(tmp_path):
    path = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.02).save(tmp_path / "a.h5")
    assert mm.compare([path]).table["robot"].tolist() == ["youbot"]
    for wrong in ([], {}, path, 3, [3]):
        with pytest.raises(UsageError, match=r"expected|is not a run"):
            mm.compare(wrong)
    with pytest.raises(RecordError):
        mm.compare([tmp_path / "missing.h5"])
