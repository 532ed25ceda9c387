"""Pages in a real browser that may not reach the network nor report errors."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import mobman as mm

PROBES = (Path(__file__).parent / "probes.js").read_text(encoding="utf-8")
SIZE = {"width": 740, "height": 360}  # small: a processor draws it
NO_PIXELS = """
for (const context of [WebGLRenderingContext, WebGL2RenderingContext])
    for (const name of Object.getOwnPropertyNames(context.prototype))
        if (/^(clear|draw(Arrays|Elements|RangeElements)(Instanced)?)$/.test(name))
            context.prototype[name] = () => {};
"""


@pytest.fixture(scope="session")
def opened(browser):
    """A context manager that opens an address and gives the page when it is ready.

    At its end nothing may have been asked of the network, nor any error have been reported. Unless it
    ``draws``, WebGL is told everything once and fills no pixel: poses are the scene's, and drawing
    without a graphics card takes most of the time. ``framed`` is for a page in a frame of the one that
    is opened, ``left`` for one whose server goes, which the browser reports.

    Tabs are used again, which spares a process and the compilation of MeshCat's script for each page.
    """
    free = {True: [], False: []}

    @contextmanager
    def open_page(url, *, draws=False, framed=False, left=False):
        if free[draws]:
            page = free[draws].pop()
        else:
            page = browser.new_page()
            page.set_default_timeout(120_000)  # a hang, not a slow machine
            if not draws:
                page.add_init_script(NO_PIXELS)
        page.set_viewport_size(SIZE)
        wrong = []
        heard = {
            "console": lambda message: _note_message(message, wrong),
            "pageerror": lambda error: wrong.append(f"error: {error}"),
            "request": lambda request: _note_request(request.url, wrong),
        }
        for event, note in heard.items():
            page.on(event, note)
        page.goto(url)
        shown = page.frames[1] if framed else page
        assert shown.evaluate("window.mobman.ready") is True
        shown.evaluate(PROBES)
        if not draws:
            shown.evaluate("() => { mobman.app.render = () => {}; }")
        yield shown
        assert left or wrong == []
        # a tab on which a test failed is not used again
        for event, note in heard.items():
            page.remove_listener(event, note)
        page.emulate_media(color_scheme="null")
        page.goto("about:blank")
        free[draws].append(page)

    return open_page


def _note_message(message, wrong):
    # the software renderer tells of its own slowness
    if message.type == "error" or (message.type == "warning" and "GL Driver" not in message.text):
        wrong.append(f"{message.type}: {message.text}")


def _note_request(url, wrong):
    parts = urlsplit(url)
    inside = parts.scheme in ("file", "data", "blob", "about")
    if not inside and parts.hostname not in ("127.0.0.1", "localhost"):
        wrong.append(f"request: {url}")


@pytest.fixture(scope="session")
def runs():
    """A short run of each registered robot, by name; made when it is asked for."""
    made = {}

    def run(name):
        if name not in made:
            made[name] = mm.simulate(name, "tsm", "circle", duration=0.6)
        return made[name]

    return run


# one of a few cylinders and boxes, and one of meshes with textures, that steers
@pytest.fixture(
    scope="module", params=["youbot", pytest.param("hunter_ur10", marks=pytest.mark.slow)]
)
def replay(request, runs, opened, tmp_path_factory):
    """A robot, a run of it, and the run's standalone page."""
    robot, record = mm.load_robot(request.param), runs(request.param)
    file = record.save(tmp_path_factory.mktemp("run") / "run.h5")
    page_file = file.with_suffix(".html")
    view = mm.view(file, html=page_file)
    assert view.url == page_file.as_uri()
    assert page_file.stat().st_size < 12e6
    with opened(view.url) as page:
        yield robot, record, page
