"""Records of unknown origin: no code of theirs runs, nothing else is read, nothing crashes or hangs."""

from __future__ import annotations

import contextlib
import shutil

import numpy as np
import pytest
from support.crafted_records import CONTROL, CRAFTED, SCRIPT

import mobman as mm
from mobman.errors import RecordError

REFUSED = {
    "samples_in_another_file": r"q are in another file, '.*secret\.txt'",
    "times_in_another_file": r"t are in another file, '.*secret\.txt'",
    "urdf_in_another_file": r"urdf\.?.* are in another file, '.*secret\.txt'",
    "joint_names_in_another_file": r"joint are in another file, '.*secret\.txt'",
    "soft_link_within_the_file": r"z is a soft link to '/torque'",
    "external_link_to_samples": r"q is an external link to '.*secret\.h5':'/values'",
    "external_link_to_a_group": r"tip is an external link to ",
    "external_link_to_metrics": r"metrics is an external link to ",
    "external_link_to_a_pipe": r"q is an external link to '.*fifo'",
    "external_link_among_the_urdfs": r"urdf/0/more is an external link to ",
    "virtual_dataset": r"q is a virtual dataset",
    "links_in_a_circle": r"urdf/0/again is a soft link to ",
    "groups_in_a_circle": r"holds more than the URDFs of a robot",
    "samples_that_no_memory_holds": r"q has shape \(21, 500000000\)",
    "times_that_no_memory_holds": r"t has shape \(10000000000000,\), 8e\+07 MB; allowed in a file",
    "chunk_that_no_memory_holds": r"q has shape \(21, 8\), 3\.2e\+03 MB; allowed",
    "zeros_that_were_packed_small": r"error/auxiliary has shape \(21, 1500000\), 252 MB; allowed",
    "names_that_no_memory_holds": r"joint has shape \(2000000000,\), 1\.6e\+04 MB; allowed",
    "long_names_that_no_memory_holds": r"joint has shape \(8,\), 1\.6e\+04 MB; allowed",
    "twenty_thousand_metrics": r"it has 20\d\d\d metrics; allowed: 10000",
    "json_nested_without_end": r"'spec_json' is nested too deeply",
    "settings_nested_without_end": r"'settings_json' is nested too deeply",
    "number_of_many_digits": r"'spec_json' is not JSON",
    "samples_of_one_axis": r"q has shape \(21,\); allowed: \(21, 8\)",
    "samples_of_three_axes": r"q has shape \(21, 8, 2\); allowed: \(21, 8\)",
    "samples_of_more_columns_than_joints": r"q has shape \(21, 9\); allowed: \(21, 8\)",
    "samples_of_text": r"q has entries of type object; allowed: 64-bit floats",
    "samples_of_pairs": r"q has entries of type .*; allowed: 64-bit floats",
    "samples_of_references": r"q has entries of type object; allowed: 64-bit floats",
    "samples_of_a_named_type": r"q is not a dataset",
    "samples_of_nothing": r"q is empty",
    "samples_by_another_filter": r"q is stored by the filter 32000; allowed: gzip",
    "times_of_text": r"t has entries of type object",
    "times_that_are_no_numbers": r"t has entries that are not finite",
    "times_that_do_not_end": r"t has entries that are not finite",
    "no_times": r"t has no times",
    "no_samples_at_all": r"t has no times",
    "states_that_are_no_numbers": r"q has entries that are not finite",
    "errors_that_are_no_numbers": r"error/task has entries that are not finite",
    "tip_of_other_dimension": r"tip/desired has shape \(21, 3\), and tip/position \(21, 2\)",
    "signal_that_leads_out": r"\.\. is missing",
    "signal_called_as_the_samples": r"its signal 'q' has the name of another part",
    "signals_that_are_a_number": r"'signals' is no list of names",
    "metric_of_text": r"its metric 'task_error_max' is no number",
    "metric_of_many_numbers": r"its metric 'task_error_max' is no number",
    "decimation_of_zero": r"'decimation' is 0; allowed: from 1",
    "decimation_below_zero": r"'decimation' is -3; allowed: from 1",
    "schema_version_of_a_list": r"has schema version",
    "urdf_called_as_the_folder_above": r"urdf/1/\.\. is no place of a URDF",
    "text_that_is_not_utf_8": r"'robot' is not valid UTF-8",
    "metric_with_the_name_of_a_folder": r"its metric 'a/b' has a name that no dataset can have",
    "settings_of_many_levels": r"'settings_json' is nested too deeply",
    "versions_that_are_lists": r"'versions_json' has entries that are not text",
    "settings_of_a_list": r"'settings_json' is no dictionary",
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_the_part_and_the_reason(name, craft, harmless, modest):
    path = craft(CRAFTED[name])
    with pytest.raises(RecordError, match=REFUSED[name]) as caught:
        mm.load_record(path)
    assert str(path) in str(caught.value)
    harmless(str(caught.value))


SAMPLE = (
    "platform_that_is_a_shell_command",
    "platform_in_a_file_of_the_folder",
    "plant_whose_platform_is_code",
    "robot_named_by_a_path_with_its_own_code",
    "task_of_a_class_of_the_library",
    "law_by_a_module",
    "urdf_path_of_another_file",
    "urdf_beside_it_with_a_mesh_elsewhere",
    "duration_beyond_all_bounds",
    "torques_that_are_no_numbers",
    "scenario_that_extends_another_file",
    "plant_that_extends_another_file",
    "end_that_never_comes",
    "urdf_with_thousands_of_links",
    "texts_that_are_scripts",
    "texts_that_steer_the_terminal",
)
"""Records that are read, for the commands that then use them."""


@pytest.fixture
def looked_at(mobman, harmless, trap):
    """Runs what reads one record on it; gives the page, or an empty text if there is none."""

    def look(path):
        page = trap.folder.parent / "page.html"
        shown = mobman("view", path, "--html", page)
        again = mobman("rerun", path, "--verify")
        assert shown.status in (0, 1, 2)
        assert again.status in (0, 1, 2)
        for done in (shown, again):
            assert done.status == 0 or done.err or done.out
        content = page.read_text(encoding="utf-8") if page.exists() else ""
        harmless(content, shown.out, shown.err, again.out, again.err)
        page.unlink(missing_ok=True)
        return content, shown, again

    return look


@pytest.mark.parametrize("name", SAMPLE)
def test_looking_at_a_crafted_record_or_repeating_it_is_harmless(name, craft, looked_at, modest):
    looked_at(craft(CRAFTED[name]))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CRAFTED if name not in SAMPLE])
def test_every_other_crafted_record(name, craft, looked_at, modest):
    looked_at(craft(CRAFTED[name]))


def test_platform_that_is_code_is_not_drawn_and_not_repeated(craft, looked_at):
    _, shown, again = looked_at(craft(CRAFTED["platform_that_is_a_shell_command"]))
    reason = (
        "its platform is Python code, 'subprocess:getstatusoutput', which the file does not hold"
    )
    assert shown.status == 0
    assert f"'youbot' is not drawn, only the paths: {reason}" in shown.err
    assert again.status == 1
    assert reason in again.err


def test_run_that_is_said_to_be_longer_than_its_record(craft, mobman):
    for name, reason in {
        "duration_of_an_hour": "are not those of a run of 3600 s",
        "end_that_never_comes": "goes on beyond t = 0.02 s, where the run of the record ended",
        "end_that_comes_after_days": "are not those of a run of 9000 s",
        "samples_far_apart": "are not those of a run of 3600 s",
        "scenario_that_extends_another_file": "its scenario names others that it extends",
        "plant_that_extends_another_file": "its scenario names others that it extends",
        "disturbances_without_number": "disturbances",
        "urdf_with_thousands_of_links": "it has 20000 links; allowed: 500",
    }.items():
        done = mobman("rerun", craft(CRAFTED[name]))
        assert done.status == 1
        assert reason in done.err, name


def test_mesh_outside_the_folder_of_the_run_is_left_out(craft, looked_at):
    content, shown, _ = looked_at(craft(CRAFTED["urdf_beside_it_with_a_mesh_elsewhere"]))
    assert "secret.obj' lies outside the folder of the run" in shown.err
    assert '"phi_1"' in content  # the robot is drawn


def test_scripts_in_texts_stay_text(craft, looked_at):
    content, *_ = looked_at(craft(CRAFTED["texts_that_are_scripts"]))
    assert "alert(1)" in content
    assert "</script><script>alert" not in content
    assert "<img src=x" not in content


def test_control_characters_do_not_reach_the_terminal(craft, looked_at):
    for done in looked_at(craft(CRAFTED["texts_that_steer_the_terminal"]))[1:]:
        assert not set(CONTROL) & set("\x1b\x07\x9b‮") & set(done.out + done.err)


def _report(mobman, harmless, folder):
    done = mobman("bench", "report", folder, "--replays", "--latex", folder / "latex")
    assert done.status == 0, done.err
    files = [path for path in folder.rglob("*") if path.suffix in (".html", ".md", ".csv", ".tex")]
    texts = {path.name: path.read_text(encoding="utf-8") for path in files}
    harmless(*texts.values(), done.out, done.err)
    assert SCRIPT not in texts["report.html"]
    return texts


def test_report_on_crafted_records(results, craft, mobman, harmless, modest):
    names = ("texts_that_are_scripts", "texts_that_are_formulas", "texts_that_are_latex")
    names += ("samples_in_another_file", "external_link_to_metrics", "json_nested_without_end")
    names += ("gains_of_a_list",)
    folder, places = results(len(names) + 1)
    for seed, (name, place) in enumerate(zip(names, places, strict=False)):
        made = craft(CRAFTED[name], seed=seed)
        shutil.move(made, place)
    shutil.move(craft(lambda file, trap: None, seed=len(names)), places[-1])
    texts = _report(mobman, harmless, folder)
    for line in texts["report.csv"].splitlines():
        assert not any(cell.startswith(("=", '"=')) for cell in line.split(","))
    assert "HYPERLINK" in texts["report.csv"]
    for name, text in texts.items():
        if name.endswith(".tex"):
            assert "\\input{/etc" not in text
            assert "\\write18" not in text


@pytest.mark.slow
def test_report_on_every_crafted_record(results, craft, mobman, harmless, modest):
    folder, places = results(len(CRAFTED) + 1)
    for seed, (name, place) in enumerate(zip(CRAFTED, places, strict=False)):
        shutil.move(craft(CRAFTED[name], seed=seed), place)
    shutil.move(craft(lambda file, trap: None, seed=len(CRAFTED)), places[-1])
    _report(mobman, harmless, folder)


def _flips(good, trap, count, seed):
    """Copies of a record with one bit or byte changed."""
    random = np.random.default_rng(seed)
    content = good.read_bytes()
    for number in range(count):
        changed = bytearray(content)
        for place in random.integers(len(content), size=random.integers(1, 4)):
            changed[place] ^= int(random.integers(1, 256))
        path = trap.folder / f"flip_{number}.h5"
        path.write_bytes(changed)
        yield path


def _flipped(good, trap, looked_at, count, seed):
    readable = 0
    for path in _flips(good, trap, count, seed):
        with contextlib.suppress(RecordError):  # any other exception is a fault
            mm.load_record(path)
            readable += 1
        looked_at(path)
        path.unlink()
    assert 0 < readable < count


def test_flipped_bytes(good, trap, looked_at, modest):
    _flipped(good, trap, looked_at, 20, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 12))
def test_many_flipped_bytes(seed, good, trap, looked_at, modest):
    _flipped(good, trap, looked_at, 50, seed)


@pytest.mark.slow
def test_report_on_flipped_bytes(good, trap, results, mobman, harmless, modest):
    folder, places = results(101)
    for path, place in zip(_flips(good, trap, 100, seed=12), places[1:], strict=True):
        shutil.move(path, place)
    shutil.copy(good, places[0])
    _report(mobman, harmless, folder)
