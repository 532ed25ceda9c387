"""Where the page looks from, and that what it shows is not behind what is written."""

from __future__ import annotations

import numpy as np
import pytest

import mobman as mm
from mobman.viewer.scene import CAMERAS
from mobman.viewer.view import make_scene

# Points that are to be in view but are outside of the window or behind a box (px).
HIDDEN = """() => {
    const shown = [...document.querySelectorAll("#info, #legend, #menu, #panel, #clock")]
        .filter((node) => node.offsetWidth).map((node) => node.getBoundingClientRect());
    const { stage } = mobman.app;
    const points = mobman.app.outline().map((point) => stage.project(stage.root.localToWorld(point)));
    const inside = ([x, y], box) => x > box.left && x < box.right && y > box.top && y < box.bottom;
    const whole = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };
    return [points.length, points.filter((at) =>
        !at || !inside(at, whole) || shown.some((box) => inside(at, box)))];
}"""
# Boxes that lie on each other, and texts that do not fit into theirs.
CLASHES = """() => {
    const ids = ["info", "legend", "menu", "panel", "clock"];
    const nodes = ids.map((id) => document.getElementById(id)).filter((node) => node.offsetWidth);
    const boxes = nodes.map((node) => node.getBoundingClientRect());
    const meet = (a, b) =>
        a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    const out = ({ left, right, bottom }) => left < 0 || right > innerWidth || bottom > innerHeight;
    const bad = nodes.filter((_, i) =>
        out(boxes[i]) || boxes.some((box, j) => j !== i && meet(boxes[i], box)));
    const texts = nodes.flatMap((node) => [node, ...node.querySelectorAll("*:not(svg *, option)")]);
    const cut = texts.filter((n) => n.clientWidth && n.scrollWidth > n.clientWidth + 1);
    return [...bad, ...cut].map((node) => node.id || node.outerHTML.slice(0, 80));
}"""
FROM = """() => {
    const { camera, controls } = mobman.app.stage.viewer;
    const { x, y, z } = camera.position.clone().sub(controls.target).normalize();
    return [x, -z, y];
}"""


@pytest.fixture(scope="module")
def files(runs, tmp_path_factory):
    """Pages of a tall robot alone, of its run, of a run that goes far, and of a comparison."""
    folder = tmp_path_factory.mktemp("cameras")
    tall, low = runs("tiago"), runs("youbot")
    shown = {"robot": "tiago", "tall": tall, "low": low, "pair": [low, low]}
    return {name: mm.view(what, html=folder / f"{name}.html").url for name, what in shown.items()}


def _hidden(page):
    """What HIDDEN gives, once it is nothing or 10 s are over: the sizes of a window that was changed,
    what folds in it, and the view that follows come in events of their own."""
    for _ in range(100):
        count, hidden = page.evaluate(HIDDEN)
        if not hidden:
            break
        page.wait_for_timeout(100)
    return count, hidden


def _resized(page, width, height):
    """What is hidden once the window and the view have a size."""
    page.set_viewport_size({"width": width, "height": height})
    aspect = "size => mobman.app.stage.viewer.camera.aspect === size[0] / size[1]"
    page.wait_for_function(aspect, arg=[width, height])
    return _hidden(page)


@pytest.mark.parametrize(
    "name",
    ["robot", "pair", *(pytest.param(name, marks=pytest.mark.slow) for name in ("tall", "low"))],
)
def test_first_view_is_clear_of_what_is_written(files, opened, name):
    with opened(files[name]) as page:
        for width, height in ((1400, 900), (700, 520), (400, 800)):
            count, hidden = _resized(page, width, height)
            assert count > 8
            assert hidden == [], (width, height)
            if name == "pair":
                page.evaluate("mobman.app.cells[1].status.textContent = 'beyond: torso_lift_joint'")
            assert page.evaluate(CLASHES) == [], (width, height)
        assert _resized(page, 1400, 900)[1] == []
        for camera in CAMERAS:
            page.evaluate("camera => mobman.look(camera)", camera)
            assert _hidden(page)[1] == [], camera


def test_presets_and_directions(files, opened):
    with opened(files["low"]) as page:
        for camera, direction in {**CAMERAS, "1,2,3": (1.0, 2.0, 3.0)}.items():
            asked = camera if camera in CAMERAS else direction
            page.evaluate("camera => mobman.look(camera)", asked)
            expected = np.array(direction) / np.linalg.norm(direction)
            assert page.evaluate(FROM) == pytest.approx(expected, abs=2e-4), camera
        page.evaluate("mobman.look('top')")
        right = page.evaluate(
            """() => [[0, 0, 0], [1, 0, 0]].map(point =>
                mobman.app.stage.project(
                    mobman.app.stage.root.localToWorld(new MeshCat.THREE.Vector3(...point))))"""
        )
        (x_0, y_0), (x_1, y_1) = right
        assert x_1 - x_0 > 10.0
        assert y_1 == pytest.approx(y_0, abs=0.5)
        with pytest.raises(Exception, match="no camera behind: allowed: front"):
            page.evaluate("mobman.look('behind')")


def test_view_that_was_moved_is_left_alone(files, opened):
    with opened(files["low"]) as page:
        page.evaluate("mobman.look('iso')")
        page.mouse.move(370, 200)
        page.mouse.down()
        page.mouse.move(420, 200)
        page.mouse.up()
        moved = page.evaluate(FROM)
        assert moved != pytest.approx(np.array(CAMERAS["iso"]) / np.sqrt(3.0), abs=0.01)
        page.set_viewport_size({"width": 900, "height": 700})
        page.wait_for_function("mobman.app.stage.viewer.camera.aspect === 900 / 700")
        page.evaluate("mobman.app.fold(false)")
        assert page.evaluate(FROM) == pytest.approx(moved, abs=1e-6)


def test_camera_of_a_scene(runs):
    assert make_scene("youbot", camera="top").content["camera"] == (0.0, 0.0, 1.0)
    for camera in ("1,-1,0.5", [1, -1, 0.5], np.array([1.0, -1.0, 0.5])):
        assert make_scene(runs("youbot"), camera=camera).content["camera"] == (1.0, -1.0, 0.5)
    assert make_scene("youbot").content["camera"] is None
    for wrong in ("behind", "1,2", "1,2,nan", (0.0, 0.0, 0.0), 3.0, "1,,2"):
        with pytest.raises(mm.MobmanError, match="allowed: front, back, left, side, top, iso, or"):
            make_scene("youbot", camera=wrong)
