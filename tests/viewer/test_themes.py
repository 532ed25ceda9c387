"""Light and dark: text can be read in both."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

import mobman as mm

# Of every text that is shown: what it is, its size (px), and the lowest contrast with what is behind it;
# a sheet that lets through some of the scene is over black or over white.
TEXTS = """() => {
    const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
    const luminance = (rgb) => {
        const linear = (x) => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
        const [r, g, b] = rgb.map((x) => linear(x / 255));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const behind = (node, under) => {
        const layers = [];
        for (let at = node; at; at = at.parentElement)
            layers.unshift(getComputedStyle(at).backgroundColor);
        return layers.slice(2).reduce((low, layer) => {
            const [r, g, b, alpha = 1] = numbers(layer);
            return [r, g, b].map((x, i) => alpha * x + (1 - alpha) * low[i]);
        }, under);
    };
    const found = [];
    for (const node of document.querySelectorAll("body *:not(script)")) {
        const own = [...node.childNodes].filter((child) => child.nodeType === 3 && child.data.trim());
        if (!own.length || !node.getClientRects().length) continue;
        const style = getComputedStyle(node);
        const ink = luminance(numbers(node.closest("svg") ? style.fill : style.color).slice(0, 3));
        const ratios = [0, 255].map((x) => {
            const back = luminance(behind(node, [x, x, x]));
            return (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
        });
        found.push([own[0].data.trim(), parseFloat(style.fontSize), Math.min(...ratios)]);
    }
    return found;
}"""


@pytest.fixture(scope="module")
def page(runs, opened, tmp_path_factory):
    laws = ["tsm-inverse-actuation", "damped-least-squares", "pseudo-inverse", "extended-jacobian"]
    failed = mm.simulate("youbot", "tsm", "circle", duration=0.1)
    failed.status, failed.message = "diverged", "at 0.1 s"
    shown = [failed, *(mm.simulate("youbot", law, "circle", duration=0.05) for law in laws)]
    file = tmp_path_factory.mktemp("themes") / "runs.html"
    with opened(mm.view(shown, html=file).url) as page:
        page.click("#fold")
        page.evaluate("mobman.setTime(1)")
        yield page


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("kind", ["page", "picture"])
def test_texts_can_be_read(page, theme, kind):
    page.select_option("#theme", theme, force=True)
    page.evaluate("on => document.body.classList.toggle('picture', on)", kind == "picture")
    texts = page.evaluate(TEXTS)
    page.evaluate("document.body.classList.remove('picture')")
    assert {"youbot", "tsm", "extended-jacobian", "desired path"} <= {text for text, *_ in texts}
    assert [text for text in texts if text[1] < 11.0 or text[2] < 4.5] == []


def test_the_scene_is_dark_where_the_system_is(opened, tmp_path):
    def brightness(page):
        page.wait_for_function("!mobman.app.stage.viewer.needs_render")
        with Image.open(io.BytesIO(page.screenshot())) as image:
            return np.median(np.asarray(image.convert("L")))

    with opened(mm.view("youbot", html=tmp_path / "robot.html").url, draws=True) as page:
        page.emulate_media(color_scheme="dark")
        page.evaluate("mobman.setTheme('')")
        assert brightness(page) < 60.0
        page.emulate_media(color_scheme="light")
        assert brightness(page) > 200.0
        page.emulate_media(color_scheme="dark")
        page.evaluate("mobman.setTheme('light')")
        assert brightness(page) > 200.0, "the choice comes before the system's"
