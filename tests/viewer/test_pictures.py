"""Pictures and film."""

from __future__ import annotations

import sys
from contextlib import closing

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

import mobman as mm
from mobman.viewer.page import BrowserError, BrowserMissingError
from mobman.viewer.view import View, make_scene

SMALL = (320, 200)


@pytest.fixture(scope="module")
def view():
    return View(make_scene(mm.simulate("youbot", "tsm", "circle", duration=0.3)))


@pytest.mark.usefixtures("browser")
@pytest.mark.slow  # the film's frames are such pictures, and the transparent one is a file
def test_picture(view, tmp_path):
    with Image.open(view.save(tmp_path / "picture.png", size=SMALL, time=0.1)) as image:
        assert image.size == SMALL
        pixels = np.asarray(image.convert("RGB"), dtype=float)
    assert pixels.std() > 10.0
    r, g, b = pixels.reshape(-1, 3).T
    assert np.mean((r > 1.4 * g) & (g > 1.4 * b)) > 0.01, "the youBot is orange"


@pytest.mark.usefixtures("browser")
def test_transparent_picture_at_twice_the_size(view, tmp_path):
    """Nothing where no robot, line or shadow is: the colours of those do not depend on the page's."""
    with Image.open(
        view.save(tmp_path / "clear.png", size=SMALL, scale=2.0, transparent=True)
    ) as image:
        assert image.size == (640, 400)
        assert image.mode == "RGBA"
        r, g, b, alpha = np.moveaxis(np.asarray(image, dtype=float), 2, 0)
    assert np.mean(alpha == 0.0) > 0.5
    assert np.mean((alpha == 255.0) & (r > 1.4 * g) & (g > 1.4 * b)) > 0.01, "the youBot is orange"
    assert alpha[:4].max() == alpha[-4:].max() == 0.0, "boxes are left out"


@pytest.mark.usefixtures("browser")
@pytest.mark.slow
def test_gif(view, tmp_path):
    with Image.open(view.save(tmp_path / "film.gif", size=SMALL, fps=10.0)) as film:
        assert film.size == SMALL
        assert film.n_frames == 4
        assert film.info["duration"] == 100
        pixels = []
        for frame in (0, 3):
            film.seek(frame)
            pixels.append(np.asarray(film.convert("RGB"), dtype=float))
    assert np.abs(pixels[0] - pixels[1]).max() > 40.0, "nothing moves"


@pytest.mark.usefixtures("browser")
def test_mp4(view, tmp_path):
    shares = []
    file = view.save(
        tmp_path / "film.mp4", size=(321, 200), fps=5.0, speed=0.5, progress=shares.append
    )
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(file))
    assert count == 4
    with closing(imageio_ffmpeg.read_frames(str(file))) as frames:
        width, height = next(frames)["size"]
        pixels = np.frombuffer(next(frames), dtype=np.uint8).reshape(height, width, 3).astype(float)
    assert pixels.std() > 10.0
    r, g, b = pixels.reshape(-1, 3).T
    assert np.mean((r > 1.4 * g) & (g > 1.4 * b)) > 0.01, "the youBot is orange"
    assert seconds == pytest.approx(0.8, abs=0.05)
    assert shares[-1] == 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("film.avi", {}, "allowed: a file .html, .png, .gif or .mp4"),
        ("picture.png", {"time": -1.0}, "time = -1.0"),
        ("picture.png", {"size": (3, 3)}, "size = 3x3"),
        ("picture.png", {"colour": "red"}, "colour"),
        ("picture.png", {"scale": 0.0}, "scale = 0.0"),
        ("picture.png", {"scale": 20.0}, "size = 25600x14400: allowed"),
        ("film.gif", {"transparent": True}, "transparent"),
        ("film.mp4", {"fps": 0.0}, "fps = 0.0"),
        ("film.gif", {"speed": float("inf")}, "speed = inf"),
        ("film.gif", {"fps": 1e6}, "allowed: 20000"),
        ("page.html", {"time": 1.0}, "no option time"),
    ],
)
def test_wrong_options(view, tmp_path, name, options, message):
    with pytest.raises(mm.MobmanError, match=message):
        view.save(tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []


def test_missing_browser_is_a_clear_message(view, tmp_path, monkeypatch):
    monkeypatch.setenv("MOBMAN_BROWSER", "no-such-browser")
    with pytest.raises(mm.MobmanError, match="'no-such-browser': there is no such program"):
        view.save(tmp_path / "picture.png")
    monkeypatch.delenv("MOBMAN_BROWSER")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path))
    with pytest.raises(BrowserMissingError, match="need Chromium or Chrome, and there is none"):
        view.save(tmp_path / "picture.png")


def test_program_that_is_no_browser_is_a_clear_message(view, tmp_path, monkeypatch):
    monkeypatch.setenv("MOBMAN_BROWSER", "false")
    with pytest.raises(BrowserError, match="false does not start") as caught:
        view.save(tmp_path / "picture.png")
    assert not isinstance(caught.value, BrowserMissingError)


@pytest.mark.parametrize(
    ("package", "name"), [("playwright", "picture.png"), ("imageio_ffmpeg", "film.mp4")]
)
def test_missing_extra_is_a_clear_message(view, tmp_path, monkeypatch, package, name):
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setitem(sys.modules, f"{package}.sync_api", None)
    with pytest.raises(mm.MobmanError, match=r"pip install 'mobman\[film\]'"):
        view.save(tmp_path / name)


def test_files_that_cannot_be_written(view, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(mm.MobmanError, match="cannot write"):
        view.save(tmp_path / "file" / "page.html")
