"""The speed harness: its statistics and verdicts, on made-up times; wall times are not tested."""

from __future__ import annotations

import json
import shutil
import sys
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from support.states import random_states

import mobman as mm

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import speed
from chains import chain_robot
from measure import baseline
from measure.closed_loop import ratios
from measure.page import numbers_into, page
from measure.plot import draw
from measure.rounds import Spread, batch, exponent, interleaved, once, ratio
from measure.targets import Target, rounded_against, targets

SPREAD = {"median": 2.0, "low": 1.5, "high": 2.5}


def spread(median):
    return {"median": median, "low": 0.9 * median, "high": 1.1 * median}


@pytest.fixture
def result():
    """A measurement of two robots, as speed.json holds it, that meets every target."""
    seconds = {
        "bare_tick": spread(15e-6),
        "bare_controller": spread(5e-6),
        "step": spread(10e-6),
        "tick": spread(30e-6),
        "tick_alone": spread(29e-6),
        "one_tick_run": spread(2e-3),
        "plain_tick": spread(900e-6),
    }
    names = {"tick_over_bare": 2.0, "step_over_bare": 2.0, "plain_over_tick": 30.0}
    robot = {
        "joints": 8,
        "nz": 5,
        "ticks": 2000,
        "seconds": seconds,
        "ratios": {name: spread(value) for name, value in names.items()},
        "notes": {"pink_solve": "not installed: no module 'pink'"},
    }
    own = [2e-6, 3e-6, 5e-6, 9e-6]
    return {
        "command": "python benchmarks/speed.py",
        "created": "2026-01-01T00:00:00+00:00",
        "processor": "a processor",
        "versions": {"python": "3.11"},
        "quick": False,
        "rounds": 11,
        "robots": {"youbot": robot, "tiago_no_hand": robot},
        "growth": {
            "joints": {
                "joints": [3, 8, 17, 40],
                "nz": [5, 10, 19, 42],
                "step": [spread(2 * value) for value in own],
                "bare_controller": [spread(value) for value in own],
                "own": [spread(value) for value in own],
                "exponent": {"all": 1.0, "larger half": 1.4},
            },
            "dt": {"dt": [1e-3], "seconds_per_simulated_second": [SPREAD]},
            "workers": {
                "runs": 4,
                "duration": 2.0,
                "workers": [1, 2],
                "runs_per_minute": [30.0, 55.0],
                "speed_up": [1.0, 1.83],
            },
        },
        "long_runs": {
            "youbot": {
                "duration": 60.0,
                "ticks": 60_000,
                "seconds": 2.0,
                "median": 10e-6,
                "p99": 15e-6,
                "max": 1e-4,
                "p99_over_median": 1.5,
                "p99_over_median_by_second": 1.3,
                "machine_p99_over_median": 1.4,
                "preemptions": 3,
                "record": 20_000_000,
                "beyond_record": 3_000_000,
                "kept_beyond_record": 100_000,
                "growth_per_tick": 2.0,
                "kept_growth_per_tick": 0.0,
                "resolution": 25.0,
            }
        },
        "real_time": {"simulated": 10.0, "factor": spread(30.0)},
        "imports": {
            "pinocchio": spread(0.3),
            "mobman": spread(0.01),
            "mobman_used": spread(0.5),
            "difference": {"median": -0.29, "low": -0.3, "high": -0.28},
            "difference_used": spread(0.2),
        },
    }


# Rounds ----------------------------------------------------------------------------------------


def test_every_measure_runs_once_a_round_and_each_is_first_in_turn():
    order = []

    def measure(name):
        return lambda: order.append(name) or float(len(order))

    taken = interleaved({name: measure(name) for name in "abc"}, rounds=4)
    assert "".join(order) == "abc" + "abc" + "bca" + "cab" + "abc"  # the first round warms up
    assert taken["a"].tolist() == [4, 9, 11, 13]
    assert {len(values) for values in taken.values()} == {4}


def test_ratios_are_taken_in_each_round_so_that_a_slow_one_cancels_out():
    pace = np.array([1.0, 1.0, 7.0, 1.0, 3.0])  # how slow the machine is in each round
    assert ratio(6.0 * pace, 2.0 * pace) == Spread(3.0, 3.0, 3.0)
    found = ratios({"tick": 6.0 * pace, "bare_tick": 2.0 * pace, "plain_tick": 60.0 * pace})
    assert found.keys() == {"tick_over_bare", "plain_over_tick"}  # of what was measured
    assert found["plain_over_tick"]["median"] == pytest.approx(10.0)


def test_spread_has_median_and_quartiles():
    assert Spread.of(np.array([5.0, 1.0, 3.0, 2.0, 4.0])) == Spread(3.0, 2.0, 4.0)


def test_a_batch_makes_many_calls_and_gives_the_time_of_one(monkeypatch):
    clock = count()  # each look at it is a second later
    monkeypatch.setattr("measure.rounds.perf_counter", lambda: float(next(clock)))
    calls = []
    measure = batch(lambda: calls.append(next(clock)), seconds=100.0)  # a call takes a second
    before = len(calls)
    taken = measure()
    made = len(calls) - before
    assert 80 <= made <= 125
    assert taken == pytest.approx((made + 1) / made)
    assert once(lambda: next(clock), units=4)() == pytest.approx(2 / 4)


@pytest.mark.parametrize("power", [0.5, 1.0, 2.7])
def test_exponent_of_a_power_law_is_found(power):
    sizes = np.array([5, 7, 10, 14, 19, 26, 34, 42])
    noise = np.exp(0.01 * np.random.default_rng(0).standard_normal(len(sizes)))
    assert exponent(sizes, 3e-6 * sizes**power) == pytest.approx(power)
    assert exponent(sizes, 3e-6 * sizes**power * noise) == pytest.approx(power, abs=0.05)


def test_there_is_no_exponent_of_costs_that_are_lost_in_noise():
    assert np.isnan(exponent(np.array([1, 2, 3]), np.array([1.0, -0.1, 2.0])))


# Targets and page ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "upwards", "text"),
    [
        (3.001, True, "3.01"),
        (3.0, True, "3.00"),
        (2.999, False, "2.99"),
        (19.99, False, "19.9"),
        (1234.2, True, "1235"),
        (0.30001, True, "0.301"),
        (-0.2266, True, "-0.226"),
        (0.1 + 0.2, True, "0.300"),
        (0.0, True, "0"),
    ],
)
def test_numbers_are_rounded_to_the_side_that_speaks_against_us(value, upwards, text):
    assert rounded_against(value, upwards) == text


def test_a_target_is_judged_by_its_number_before_rounding():
    assert Target("", 3.0, 3.0).met
    assert not Target("", 3.0000001, 3.0).met
    assert not Target("", 2.0, 2.0, strictly=True).met
    assert not Target("", 9.9999999, 10.0, at_most=False).met
    assert not Target("", float("nan"), 3.0).met
    assert Target("", 1.4, 3.0, stretch=1.5).verdict == "met; stretch of 1.5 met"
    assert Target("", 1.6, 3.0, stretch=1.5).verdict == "met; stretch of 1.5 not met"
    assert Target("", 4.0, 3.0, stretch=1.5).verdict == "**not met**; stretch of 1.5 not met"


def test_every_promise_with_a_number_is_judged(result):
    assert all(one.met for one in targets(result))
    robot = result["robots"]["tiago_no_hand"]
    robot["ratios"] = {**robot["ratios"], "step_over_pink": spread(0.6)}
    (missed,) = (one for one in targets(result) if not one.met)
    assert "Pink" in missed.text
    assert missed.bound == "at most 0.5"
    assert targets({}) == []


def test_docs_and_baseline_are_of_one_measurement():
    found = json.loads(speed.BASELINE.read_text(encoding="utf-8"))["ratios"][
        "youbot tick_over_bare"
    ]
    document = (speed.DOCS / "speed.md").read_text(encoding="utf-8")
    assert f"| (c)/(a) | {rounded_against(found, True)} [" in document


def test_numbers_go_between_the_marks_of_a_document(result):
    """As the page has them, a heading lower; the text around them is left alone."""
    document = (speed.DOCS / "speed.md").read_text(encoding="utf-8")
    written = numbers_into(document, result, "elsewhere.svg")
    assert "](elsewhere.svg)" in written
    assert "### Ratios" in written
    assert "\n## Ratios" not in written
    assert written.split("<!--")[0] == document.split("<!--")[0]
    assert written.split("<!-- end")[1] == document.split("<!-- end")[1]
    assert numbers_into(written, result, "elsewhere.svg") == written


def test_page_and_picture_have_what_was_measured_and_say_what_was_not(result, tmp_path):
    text = page(result)
    assert "| (b) our controller step | 10.0 [9.00, 11.0] |" in text
    assert "not installed: no module 'pink'" in text
    assert "| not measured |" in text
    assert "r^1.40" in text
    assert "final" not in text
    assert "none of these verdicts is final" in page({**result, "quick": True})
    draw(result, tmp_path / "speed.svg")
    assert "(c) our tick" in (tmp_path / "speed.svg").read_text(encoding="utf-8")
    draw({"robots": {}, "growth": {}}, tmp_path / "empty.svg")


# Baseline --------------------------------------------------------------------------------------


@pytest.fixture
def kept(result, tmp_path):
    path = tmp_path / "baseline.json"
    baseline.write_baseline(path, result)
    return baseline.read_baseline(path)


def failed(result, kept):
    return [one.name for one in baseline.compare(result, kept) if one.failed]


def test_the_same_measurement_passes_and_so_does_a_better_one(result, kept):
    assert len(kept["ratios"]) == 2 * 3 + 1
    assert failed(result, kept) == []
    for robot in result["robots"].values():
        robot["ratios"] = {**robot["ratios"], "tick_over_bare": spread(0.5)}
        robot["ratios"]["plain_over_tick"] = spread(300.0)
    assert failed(result, kept) == []


@pytest.mark.parametrize(
    ("name", "worse", "just_right"),
    [("tick_over_bare", 2.51, 2.49), ("plain_over_tick", 23.9, 24.1)],
)
def test_a_ratio_fails_when_it_is_worse_by_more_than_the_tolerance(
    result, kept, name, worse, just_right
):
    robot = result["robots"]["youbot"]
    for value, expected in ((just_right, []), (worse, [f"youbot {name}"])):
        ratios_now = {**robot["ratios"], name: spread(value)}
        now = {**result, "robots": {"youbot": {**robot, "ratios": ratios_now}}}
        assert failed(now, kept) == expected


def test_an_exponent_counts_and_one_that_is_no_number_fails(result, kept):
    for value, failures in ((1.69, 0), (1.71, 1), (float("nan"), 1)):  # 1.4 is kept
        result["growth"]["joints"]["exponent"]["larger half"] = value
        assert len(failed(result, kept)) == failures


def test_what_was_not_measured_is_told_and_does_not_fail(kept):
    comparisons = baseline.compare({}, kept)
    assert len(comparisons) == len(kept["ratios"])
    assert not any(one.failed for one in comparisons)
    assert "not measured" in baseline.as_table(comparisons)


def test_the_tolerance_that_is_kept_counts(result, kept, tmp_path):
    path = tmp_path / "strict.json"
    path.write_text(json.dumps({**kept, "tolerance": 0.01, "exponent_tolerance": 0.02}))
    result["growth"]["joints"]["exponent"]["larger half"] += 0.03
    robot = result["robots"]["youbot"]
    ratios_now = {**robot["ratios"], "tick_over_bare": spread(2.03)}
    result["robots"]["youbot"] = {**robot, "ratios": ratios_now}
    strict = baseline.read_baseline(path)
    assert failed(result, strict) == ["youbot tick_over_bare", "exponent larger half"]
    baseline.write_baseline(path, result)
    rewritten = baseline.read_baseline(path)
    assert (rewritten["tolerance"], rewritten["exponent_tolerance"]) == (0.01, 0.02)
    assert failed(result, rewritten) == []


def test_exit_status_tells_a_pass_from_a_fail(result, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(speed, "measure", lambda options: result)
    monkeypatch.setattr("measure.plot.draw", lambda result, path: path.write_text("<svg/>"))
    monkeypatch.setattr(speed, "BASELINE", tmp_path / "baseline.json")
    docs = tmp_path / "docs"
    (docs / "images").mkdir(parents=True)
    shutil.copy(speed.DOCS / "speed.md", docs)
    monkeypatch.setattr(speed, "DOCS", docs)
    arguments = ["-o", str(tmp_path / "out")]
    assert speed.main(arguments) == 0  # nothing to compare with
    assert speed.main([*arguments, "--update-baseline"]) == 0
    assert speed.main(arguments) == 0
    result["growth"]["joints"]["exponent"]["larger half"] = 3.0
    assert speed.main(arguments) == 1
    assert "WORSE" in capsys.readouterr().out
    assert "a processor" in (docs / "speed.md").read_text(
        encoding="utf-8"
    )  # written with the baseline
    assert (docs / "images" / "speed.svg").exists()
    assert json.loads((tmp_path / "out" / "speed.json").read_text(encoding="utf-8")) == result


# Chains ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("joints", [3, 10])
def test_chains_are_robots_that_tsm_controls(joints, tmp_path):
    robot = chain_robot(joints, tmp_path)
    assert (robot.n, robot.nz) == (joints, joints + 2)
    for q, _ in random_states(robot, 5):
        assert robot.constraint_matrix(q) @ robot.velocity_map(q) == pytest.approx(0.0, abs=1e-12)
    record = mm.simulate(robot, "tsm", "circle", duration=0.2)
    assert record.ok
    assert np.abs(record.z).max() < 3.0
