"""Suites: what they ask for, and what is refused."""

from __future__ import annotations

import pytest
from support.suites import SMALL, small_suite

from mobman.benchmark.suite import list_suites, load_suite
from mobman.errors import SpecError, UnknownNameError
from mobman.toml_model import read_toml

FEW = ("paper", "quick")
"""Suites of few robots and runs."""


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in FEW else pytest.mark.slow) for n in list_suites()]
)
def test_every_shipped_suite_resolves(name):
    assert load_suite(name).runs()


def test_paper_suite_asks_for_what_the_paper_shows_and_more():
    runs = load_suite("paper").runs()
    cells = {(run.robot, run.task, run.scenario["name"], run.label) for run in runs}
    assert len(cells) == len([run for run in runs if run.placement == 0])
    six = {
        "tsm",
        "tsm-simplified",
        "tsm-inverse-actuation",
        "pseudo-inverse",
        "damped-least-squares",
        "extended-jacobian",
    }
    for robot, task in (("youbot", "paper"), ("tiago_no_hand", "circle")):
        for scenario in ("nominal", "heavier", "lighter", "disturbed"):
            labels = {cell[3] for cell in cells if cell[:3] == (robot, task, scenario)}
            assert labels == six | {"tsm-explicit"}
    gains = {run.label: run.gains for run in runs if run.robot == "youbot"}
    # the paper's values, section 4, and its whole inertia
    assert gains["tsm"] == {"a": 0.2, "A": 0.2, "metric_scale": 1.0}
    assert gains["tsm-explicit"]["discretization"] == "explicit"


def test_run_id_depends_on_what_the_result_depends_on(tmp_path):
    suite = load_suite(small_suite(tmp_path))
    ids = {run.run_id for run in suite.runs()}
    assert len(ids) == 8
    assert ids == {run.run_id for run in load_suite(small_suite(tmp_path)).runs()}
    assert not ids & {run.run_id for run in load_suite(small_suite(tmp_path, 0.03)).runs()}


def test_label_is_no_part_of_the_run_id(tmp_path):
    path = small_suite(tmp_path)
    before = {run.run_id for run in load_suite(path).runs()}
    path.write_text(path.read_text().replace("controllers.damped]", "controllers.dls]"))
    assert {run.run_id for run in load_suite(path).runs()} == before


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('tasks = ["circle"]', 'tasks = ["pose-circle"]', "5 degrees of freedom for a task of 6"),
        (
            "[[groups]]",
            "[[overrides]]\nskip = true\nwhere = { robots = ['*'] }\n\n[[groups]]",
            "leave no run",
        ),
        ("duration = 0.02", "duration = true", "duration"),
    ],
)
def test_what_cannot_run_is_refused_before_anything_runs(tmp_path, old, new, fault):
    path = small_suite(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(SpecError, match=fault):
        load_suite(path).runs()


def test_unknown_suite_names_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'paper'"):
        load_suite("papper")


def test_all_wrong_names_are_told_at_once(tmp_path):
    path = small_suite(tmp_path)
    text = path.read_text().replace('"youbot"', '"yuobot"').replace('"circle"', '"cirlce"')
    text = text.replace('"disturbed"', '"disturbt"').replace("mu =", "mi =")
    path.write_text(text.replace('law = "pseudo-inverse"', 'law = "psuedo-inverse"'))
    with pytest.raises(SpecError) as error:
        load_suite(path).runs()
    assert "controller 'pseudo-inverse': unknown controller 'psuedo-inverse'" in str(error.value)
    for expected in ("'youbot'", "'circle'", "'disturbed'", "'mu'"):
        assert f"did you mean {expected}" in str(error.value)


def test_all_wrong_gains_of_a_controller_are_told_at_once(tmp_path):
    path = small_suite(tmp_path)
    text, law = path.read_text(), 'law = "pseudo-inverse"'
    path.write_text(text.replace(law, f'{law}\ngains = {{ K_q = 1.0, K_v = "a", K_x = 2.0 }}'))
    with pytest.raises(SpecError) as error:
        load_suite(path).runs()
    for expected in ("unknown gain of 'pseudo-inverse' 'K_q'", "'K_x'", "K_v = 'a': must"):
        assert expected in str(error.value)


def test_a_wrong_law_alone_is_told_with_its_label(tmp_path):
    path = small_suite(tmp_path)
    text = path.read_text()
    path.write_text(text.replace('law = "pseudo-inverse"', 'law = "psuedo-inverse"'))
    said = r"suite 'small': line \d+: controller 'pseudo-inverse': unknown"
    with pytest.raises(SpecError, match=said):
        load_suite(path).runs()


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("duration = 0.02", "duration = -1", "duration"),
        ("seeds = [0, 1]", "seeds = []", "seeds"),
        ("schema = 1", "schema = 7", "schema"),
        (
            "duration = 0.02",
            "duration = 0.02\ndt = -1",
            "field 'dt' is -1: Input should be greater",
        ),
        (
            "duration = 0.02",
            "duration = 1e-4",
            "toml: duration 0.0001 s is shorter than dt 0.001 s",
        ),
        ('robots = ["youbot"]', 'robot = ["youbot"]', "groups.0.robot"),
        ('law = "pseudo-inverse"', "law = 3", "controllers.pseudo-inverse.law"),
    ],
)
def test_wrong_fields_are_named(tmp_path, old, new, field):
    path = small_suite(tmp_path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SpecError) as error:
        load_suite(path)
    assert field in str(error.value)
    assert str(path) in str(error.value)


def test_not_toml_names_the_file(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text(SMALL[:40] + "[[[")
    with pytest.raises(SpecError, match=r"broken\.toml is not valid TOML"):
        read_toml(path, "suite file")


def test_two_labels_for_one_run_are_refused(tmp_path):
    path = small_suite(tmp_path)
    path.write_text(
        path.read_text().replace("damped-least-squares", "pseudo-inverse").replace("mu = 0.02", "")
    )
    with pytest.raises(SpecError, match="'pseudo-inverse' and 'damped' are the same run"):
        load_suite(path).runs()


def test_two_tasks_for_one_run_are_refused(tmp_path):
    path = small_suite(tmp_path)
    text = path.read_text().replace('tasks = ["circle"]', 'tasks = ["circle", "round"]')
    path.write_text(text + '\n[tasks.round]\ntask = "circle"\n')
    with pytest.raises(SpecError, match="'circle' and 'round' are the same run"):
        load_suite(path).runs()


def test_a_scenario_file_that_is_not_there_is_told_beside_other_faults(tmp_path):
    path = small_suite(tmp_path)
    text = path.read_text().replace('"circle"', '"cirlce"').replace('"disturbed"', '"none.toml"')
    path.write_text(text)
    with pytest.raises(SpecError, match=r"cannot read the scenario file.*did you mean 'circle'"):
        load_suite(path).runs()


def test_writing_a_default_out_does_not_change_the_run(tmp_path):
    path = small_suite(tmp_path)
    before = {run.run_id for run in load_suite(path).runs()}
    path.write_text(path.read_text().replace("mu = 0.02", "mu = 0.02, Kp = 25.0"))
    assert {run.run_id for run in load_suite(path).runs()} == before


def test_gains_for_a_label_that_is_not_there_are_refused(tmp_path):
    path = small_suite(tmp_path)
    path.write_text(
        path.read_text() + 'controllers = ["damped"]\ngains = { pseudo-inverse = { K_p = 9.0 } }\n'
    )
    with pytest.raises(SpecError, match="gains for 'pseudo-inverse', which is not among"):
        load_suite(path).runs()
