"""The report's page in a browser: its charts are drawn without a network, its tables sort and filter."""

from __future__ import annotations

import pytest
from support.reported import made_up_runs, results_of

from mobman.benchmark.report.report import write_report

UNFOLD = """document.querySelectorAll('details.cell, details.more')
    .forEach((place) => { place.open = true; })"""


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A report of two controllers in nine cells."""
    runs = made_up_runs({"tsm": 1e-9, "pseudo-inverse": 1e-3}, [f"payload-{i}" for i in range(9)])
    runs = [{**run, "family": "payload"} for run in runs]
    folder = tmp_path_factory.mktemp("report")
    return write_report(folder, results_of(runs, name="made up")).html.as_uri()


@pytest.fixture(scope="module")
def shown(browser, address):
    """The page, and what was reported: nothing may be asked of the network, nor an error be told."""
    page = browser.new_page()
    wrong = []
    page.on("console", lambda message: message.type == "error" and wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda asked: asked.url == address or wrong.append(asked.url[:99]))
    page.goto(address)
    yield page, wrong
    page.close()


@pytest.fixture
def page(shown):
    """The page, wide."""
    page, wrong = shown
    page.set_viewport_size({"width": 1200, "height": 900})
    yield page
    assert wrong == []


def test_every_chart_is_drawn_when_it_comes_into_sight(page):
    places = page.locator(".chart")
    page.evaluate(UNFOLD)
    for i in range(places.count()):
        places.nth(i).scroll_into_view_if_needed()
    page.wait_for_function(
        "[...document.querySelectorAll('.chart')].every((place) => place.querySelector('canvas'))"
    )
    assert places.count() > 20
    assert page.locator(".vega-embed .error").count() == 0


def test_a_narrow_page_is_as_wide_as_the_screen(page):
    page.set_viewport_size({"width": 400, "height": 800})
    page.wait_for_timeout(100)
    assert page.evaluate("document.documentElement.scrollWidth") == 400


def test_a_point_has_its_values_and_a_legend_picks_a_curve(page):
    page.evaluate("document.querySelector('#cells details.cell').open = true")
    chart = page.locator("#cells .chart").first
    chart.scroll_into_view_if_needed()
    canvas = chart.locator("canvas")
    canvas.hover(position={"x": 400, "y": 120})
    canvas.hover(position={"x": 405, "y": 150})
    tip = page.locator("#vg-tooltip-element.visible")
    tip.wait_for(timeout=5000)
    assert tip.locator("td").all_inner_texts()[::2] == ["label", "t", "y"]
    before = canvas.screenshot()
    canvas.click(position={"x": 80, "y": 7})
    page.mouse.move(0, 0)
    page.wait_for_timeout(300)
    assert canvas.screenshot() != before


def test_tables_sort_and_filter(page):
    table = page.locator("#leaderboard table").first
    names = table.locator("tbody td:nth-child(2)")
    assert names.all_inner_texts() == ["tsm", "pseudo-inverse"]
    for order in (["tsm", "pseudo-inverse"], ["pseudo-inverse", "tsm"]):
        table.locator("thead th:nth-child(3) button").click()
        assert [text.strip() for text in names.all_inner_texts()] == order
    page.locator("#results input").fill("PAYLOAD-8")
    assert page.locator("#results tbody tr:visible").count() == 1


def test_texts_of_others_run_nothing_when_they_are_shown(browser, tmp_path):
    """Texts that end a script are in other tests; these would run in a legend, an axis or a tooltip."""
    hostile = "<img src=x onerror=window.ran=1>${window.ran=1}{{7*7}}');window.ran=1;//"
    runs = made_up_runs({hostile: 1e-9, "tsm": 1e-3}, [hostile, "nominal"], [hostile])
    address = write_report(tmp_path, results_of(runs, name=hostile)).html.as_uri()
    page = browser.new_page(viewport={"width": 1200, "height": 900})
    page.goto(address)
    page.evaluate(UNFOLD)
    charts, seen = page.locator(".chart"), 0
    for i in range(charts.count()):
        canvas = charts.nth(i).locator("canvas")
        charts.nth(i).scroll_into_view_if_needed()
        canvas.wait_for()
        canvas.hover(position={"x": 250, "y": 60})
        page.wait_for_timeout(30)
        seen += page.locator("#vg-tooltip-element.visible", has_text="<img src=x").count()
    assert seen > 0
    assert page.evaluate("window.ran") is None
    page.close()
