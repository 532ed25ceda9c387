"""Plots under the time line: what they show, and that they are linked to the clock."""

from __future__ import annotations

import re

import numpy as np
import pytest

import mobman as mm


@pytest.fixture(scope="module")
def page(runs, opened, tmp_path_factory):
    file = tmp_path_factory.mktemp("plots") / "run.html"
    with opened(mm.view(runs("youbot"), html=file).url) as shown:
        assert shown.is_hidden("#plots"), "plots are folded in a small window"
        shown.click("#fold")
        yield shown


def _at(page, share, plot=1, height=0.5):
    """A point of a plot, by its share of the run's duration, in pixels of the page."""
    box = page.locator("#plots svg").nth(plot).bounding_box()
    left, right = page.evaluate("[mobman.app.plots[0].x(0), mobman.app.plots[0].x(1e9)]")
    right = left + (right - left) * page.evaluate("mobman.duration()") / 1e9
    return box["x"] + left + share * (right - left), box["y"] + height * box["height"]


def _points(page, plot, curve=0):
    """The corners of a curve, in pixels of its plot."""
    path = page.locator("#plots svg").nth(plot).locator(".curve").nth(curve).get_attribute("d")
    return np.array([[float(x), float(y)] for x, y in re.findall(r"[ML](\S+) ([^ML]+)", path)])


def test_pointer_scrubs_and_a_click_seeks(page, runs):
    end = runs("youbot").t[-1]
    page.evaluate("mobman.setTime(0.1)")
    page.mouse.move(*_at(page, 0.5))
    assert page.evaluate("mobman.time()") == pytest.approx(0.5 * end, abs=2e-3)
    q = page.evaluate("mobman.configuration()")
    assert q == pytest.approx(runs("youbot").q[round(500 * end)].tolist(), abs=5e-3)
    page.mouse.move(370, 60)
    assert page.evaluate("mobman.time()") == pytest.approx(0.1), "it returns to the clock's time"
    page.mouse.click(*_at(page, 0.75))
    page.mouse.move(*_at(page, 0.25))
    page.mouse.move(370, 60)
    assert page.evaluate("mobman.time()") == pytest.approx(0.75 * end, abs=2e-3)
    cursor = page.evaluate("mobman.app.plots.map(plot => +plot.cursor.getAttribute('x1'))")
    expected = page.evaluate("mobman.app.plots.map(plot => plot.x(mobman.time()))")
    assert cursor == pytest.approx(expected)


def test_curves_are_the_runs(page, runs):
    """Their highest and lowest points are those of the data, on the axes as they are written."""
    robot, record = mm.load_robot("youbot"), runs("youbot")
    names = page.evaluate("mobman.app.plots[1].curves.map(curve => curve.label)")
    efforts = np.array(
        [robot.actuation(q) @ v for q, v in zip(record.q, record.torque, strict=True)]
    )
    low, high = page.evaluate("mobman.app.plots[1].range()")
    for i, name in enumerate(names):
        effort = efforts[:, robot.joint_names.index(name)]
        at = page.evaluate(
            "values => values.map(mobman.app.plots[1].y)", [effort.min(), effort.max()]
        )
        _, y = _points(page, 1, i).T
        assert [y.max(), y.min()] == pytest.approx(at, abs=0.6), name
    assert high == pytest.approx(efforts.max(), rel=0.02)
    assert low == pytest.approx(efforts.min(), rel=0.02)
    error = np.linalg.norm(record.task_error, axis=1)
    x, y = _points(page, 0).T
    ends = page.evaluate("values => values.map(mobman.app.plots[0].y)", [error[0], error[-1]])
    assert [y[0], y[-1]] == pytest.approx(ends, abs=0.2)
    assert np.all(np.diff(x) >= 0.0)


def test_value_is_that_of_the_curve_at_the_pointer(page):
    share, curve = 0.5, page.evaluate("mobman.app.plots[1].curves.length - 1")
    page.mouse.move(*_at(page, share))
    value = page.evaluate(
        "i => mobman.app.plots[1].curves[i].values[mobman.app.runs[0].place.frame]", curve
    )
    y = page.evaluate("value => mobman.app.plots[1].y(value)", value)
    x, top = _at(page, share, height=0.0)
    page.mouse.move(x, top + y)
    label, shown = page.text_content("#plots svg:nth-child(2) .value").split()
    assert label == page.evaluate("i => mobman.app.plots[1].curves[i].label", curve)
    assert float(shown) == pytest.approx(value, rel=0.02)
    page.mouse.move(370, 60)


def test_values_that_are_not_finite_are_gaps(page):
    path = page.evaluate(
        """() => {
            const plot = mobman.app.plots[1], [curve] = plot.curves, values = curve.values;
            curve.values = values.map((value, i) => i > 5 && i < 30 ? NaN : value);
            plot.draw();
            const path = plot.root.querySelector(".curve").getAttribute("d");
            curve.values = values;
            plot.draw();
            return path;
        }"""
    )
    assert path.count("M") == 2
    assert "NaN" not in path


def test_several_runs_have_a_curve_each_in_their_colours(runs, opened, tmp_path):
    pair = [runs("youbot"), mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.1)]
    with opened(mm.view(pair, html=tmp_path / "pair.html").url) as page:
        page.click("#fold")
        colours = page.evaluate("mobman.app.runs.map(run => run.colour)")
        for plot in (0, 1):
            curves = page.locator("#plots svg").nth(plot).locator(".curve")
            assert [curve.get_attribute("stroke") for curve in curves.all()] == colours
        assert _points(page, 0, 1)[-1, 0] < 0.4 * _points(page, 0, 0)[-1, 0], "it ended before"
        page.set_viewport_size({"width": 400, "height": 700})
        page.wait_for_function("document.body.classList.contains('folded')")
        page.click("#fold")
        for plot in page.locator("#plots svg").all():  # a name that has no room is left out
            title, value = plot.locator("text:not(.value)").last, plot.locator("text.value")
            box = title.bounding_box()
            assert box["x"] + box["width"] < value.bounding_box()["x"]


def test_margins_of_a_monitored_run_have_a_plot(opened, tmp_path):
    """The least of each stage until the next frame, on decades that have 1 among them."""
    record = mm.simulate("youbot", "tsm", "circle", duration=0.1, monitor=True)
    with opened(mm.view(record, html=tmp_path / "run.html").url) as page:
        page.click("#fold")
        names = page.evaluate("mobman.app.plots[2].curves.map(curve => curve.label)")
        assert names == ["kinematic", "dynamic"]
        t, shown = page.evaluate(
            "[Array.from(mobman.app.plots[2].curves[1].t), "
            "Array.from(mobman.app.plots[2].curves[1].values)]"
        )
        margin = record.signals["monitors/margin_dynamic"]
        first, last = (round(1000 * time) for time in t[3:5])
        assert shown[3] == pytest.approx(np.nanmin(margin[first:last]), rel=1e-6)
        assert page.evaluate("mobman.app.plots[2].logarithmic[0]") <= -1
        texts = page.locator("#plots svg:nth-child(3) text").all_text_contents()
        assert "margin of the gains, enough from 1 on" in texts
        rules = page.locator("#plots svg:nth-child(3) .rule")
        heights = [float(rules.nth(i).get_attribute("y1")) for i in range(rules.count())]
        enough = page.evaluate("mobman.app.plots[2].y(1)")
        assert min(abs(height - enough) for height in heights) < 0.01
