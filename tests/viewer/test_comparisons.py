"""Several runs in one scene, on one clock."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from PIL import Image

import mobman as mm
from mobman.figures.looks import LAWS
from mobman.viewer.scene import labels
from mobman.viewer.view import make_scene
from tests.support.poses import largest_difference


@pytest.fixture(scope="module")
def pair(runs):
    """Two runs of the youBot, the second one shorter."""
    first = runs("youbot")
    second = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.3)
    return [first, second]


def test_both_robots_move_on_one_clock(pair, opened, tmp_path):
    robot = mm.load_robot("youbot")
    view = mm.view(pair, html=tmp_path / "pair.html")
    with opened(view.url) as page:
        for time in (0.0, 0.25, 0.3):
            page.evaluate("time => mobman.setTime(time)", time)
            for i, record in enumerate(pair):
                frame = page.evaluate(
                    "([i, time]) => mobman.frameTimes(i).reduce((a, b) => b <= time ? b : a)",
                    [i, time],
                )
                page.evaluate("time => mobman.setTime(time)", frame)
                q = record.q[int(np.argmin(np.abs(record.t - frame)))]
                assert largest_difference(page, robot, q, run=i) <= 1e-6
        page.evaluate("mobman.setTime(0.6)")
        assert largest_difference(page, robot, pair[1].q[-1], run=1) <= 1e-6
        assert "ended" in page.inner_text("#info")
        assert page.locator("#labels div").all_inner_texts() == ["tsm", "pseudo-inverse"]

        # ghosts at one place, or solid beside each other; the poses are the runs' own in both
        def state():
            return page.evaluate(
                """mobman.app.runs.map(run => [run.group.position.x,
                    run.robot.layers.visual[0].material.opacity])"""
            )

        (x_0, opacity), (x_1, _) = state()
        assert x_0 == x_1
        assert opacity < 1.0
        page.select_option("#layout", "side-by-side")
        (x_0, opacity), (x_1, _) = state()
        assert x_1 - x_0 > 0.5
        assert opacity == 1.0
        assert largest_difference(page, robot, pair[1].q[-1], run=1) <= 1e-6


def test_runs_of_one_robot_share_its_shapes(pair):
    one, two = make_scene(pair[0]), make_scene(pair)
    assert len(two.content["robots"]) == 1
    assert len(two.content["geometries"]) == len(one.content["geometries"])
    assert len({run["colour"] for run in two.content["runs"]}) == 2


def test_a_run_has_the_colour_of_its_law(pair):
    def colours(*laws):
        runs = [dataclasses.replace(pair[0], controller=law) for law in laws]
        return [run["colour"] for run in make_scene(runs).content["runs"]]

    assert colours("pseudo-inverse", "tsm") == [LAWS["pseudo-inverse"], LAWS["tsm"]]
    first, second, third = colours("tsm", "tsm", "mine")
    assert first == LAWS["tsm"]
    assert len({first, second, third}) == 3


def test_layout_is_where_the_page_begins(pair):
    scene = make_scene(pair, layout="side-by-side")
    assert scene.content["layout"] == "side-by-side"
    with pytest.raises(mm.MobmanError, match="allowed: overlay, side-by-side"):
        make_scene(pair, layout="stacked")


def test_labels_say_what_differs(pair):
    first, second = pair
    heavier = dataclasses.replace(first, scenario="heavier")
    assert labels(pair, ["a", "b"]) == ["tsm", "pseudo-inverse"]
    assert labels([first, heavier], ["a", "b"]) == [first.scenario, "heavier"]
    assert labels([first, heavier, second], "abc")[1] == "tsm · heavier"
    assert labels([first, first], ["a", "b"]) == ["tsm · a", "tsm · b"]
    assert labels([dataclasses.replace(first, seed=1), first], "ab") == ["seed 1", "seed 0"]


def test_robots_that_are_together_do_not_hide_one_another(pair, opened, tmp_path):
    """Both colours are there at the start, about as much of one as of the other."""

    def shares(page):
        page.evaluate(
            """() => {
                const { runs, stage } = mobman.app;
                for (const run of runs)
                    for (const { material } of run.robot.layers.visual)
                        Object.assign(material, { emissive: material.color.clone(), opacity: 1 });
                for (const layer of ["ground", "tip", "trails"]) mobman.show(layer, false);
                for (const id of ["labels", "info", "panel", "legend"])
                    document.getElementById(id).hidden = true;
            }"""
        )
        with Image.open(io.BytesIO(page.screenshot())) as image:
            r, _, b = np.moveaxis(np.asarray(image.convert("RGB"), dtype=float), 2, 0)
        return np.mean(b > r + 30.0), np.mean(r > b + 30.0)  # blue tsm, red pseudo-inverse

    with opened(mm.view(pair, html=tmp_path / "pair.html").url, draws=True) as page:
        page.evaluate("mobman.setTime(0)")
        assert page.evaluate("mobman.app.runs.map(run => run.robot.stripe.value.y)") == [2, 2]
        blue, red = shares(page)
        assert blue > 0.003
        assert 0.6 < blue / red < 1.6
        page.evaluate("mobman.setLayout('side-by-side')")
        assert page.evaluate("mobman.app.runs.map(run => run.robot.stripe.value.y)") == [1, 1]
        page.evaluate("mobman.setLayout('overlay')")
        assert page.evaluate("mobman.app.runs.map(run => run.robot.stripe.value.x)") == [0, 1]
