"""Pictures and films of a scene, taken by a browser without a window."""

from __future__ import annotations

import io
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from numbers import Real
from pathlib import Path
from typing import Any

from PIL import Image

from mobman.errors import MobmanError, UsageError
from mobman.viewer.page import document, write_whole
from mobman.viewer.scene import Scene, check_view

VARIABLE = "MOBMAN_BROWSER"
"""Environment variable that may name the browser's program."""
_PROGRAMS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("msedge", "microsoft-edge"),
)
# WebGL by the processor, so that a picture is the same with and without a graphics card
_FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_PATIENCE = 120_000.0  # ms
_SIZE = (1280, 720)
_LARGEST = 8192
_MOST_FRAMES = 20_000
_GIF_STEP = 0.01  # s: its clock


class BrowserError(MobmanError):
    """There is no browser that could take a picture, or it failed."""


class BrowserMissingError(BrowserError):
    """Neither Chromium nor Chrome is installed, or the package that drives it is not."""


def save_picture(
    scene: Scene,
    path: Path,
    *,
    time: float | None = None,
    size: tuple[int, int] | None = None,
    scale: float = 1.0,
    transparent: bool = False,
) -> None:
    """Write a picture as a PNG file: whole, or not at all.

    Args:
        scene: The scene.
        path: The file.
        time: s; the end of the longest run by default.
        size: Width and height (pixels).
        scale: Pixels of the file for each of these, along both; letters and lines grow with it.
        transparent: True for the robots, their lines, labels and shadows alone, on nothing.

    Raises:
        UsageError: If the time, the size or the scale cannot be.
        BrowserError: If there is no browser.
        MobmanError: If the file cannot be written.
    """
    check_view(time)
    at = scene.duration if time is None else min(time, scene.duration)
    _check_positive(scale=scale)
    shown = _checked_size(size)
    _checked_size((round(scale * shown[0]), round(scale * shown[1])))
    picture = _in_browser(
        scene, shown, lambda page: _frame(page, at, transparent), scale, transparent
    )
    write_whole(path, lambda file: file.write_bytes(picture))


def save_film(
    scene: Scene,
    path: Path,
    *,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    speed: float = 1.0,
    progress: Callable[[float], None] = lambda _: None,
) -> None:
    """Write a film of the runs from beginning to end, as GIF or MP4 by the file's name.

    Args:
        scene: The scene.
        path: The file, ``.gif`` or ``.mp4``.
        fps: Frames a second; 30, and 20 for a GIF, by default.
        size: Width and height (pixels).
        speed: Seconds of the run in a second of the film.
        progress: Told the share done, 0 to 1.

    Raises:
        UsageError: If an argument cannot be, or the scene does not move.
        BrowserError: If there is no browser.
        MobmanError: If the file cannot be written, or the film encoder is missing.
    """
    gif = path.suffix.lower() == ".gif"
    if scene.duration <= 0.0:
        raise UsageError(f"{path}: there is no run, and a robot alone does not move; make a .png")
    rate = fps if fps is not None else (20.0 if gif else 30.0)
    _check_positive(fps=rate, speed=speed)
    count = math.ceil(scene.duration * rate / speed) + 1
    if count > _MOST_FRAMES:
        raise UsageError(
            f"a film of {scene.duration:g} s at {rate:g} frames a second and speed {speed:g} has "
            f"{count} frames; allowed: {_MOST_FRAMES}"
        )
    width, height = _checked_size(size)
    even = (width + width % 2, height + height % 2)  # the encoder's blocks
    write: Callable[..., None] = _write_gif if gif else _write_mp4
    if not gif:
        _encoder()  # before the work, not after it

    def frames(page: Any) -> Iterator[Any]:
        for i in range(count):
            with Image.open(io.BytesIO(_frame(page, min(i * speed / rate, scene.duration)))) as one:
                yield one.convert("RGB")
            progress((i + 1) / count)

    def shoot(page: Any) -> None:
        write_whole(path, lambda file: write(file, frames(page), rate, even))

    _in_browser(scene, even, shoot)


def _frame(page: Any, time: float, transparent: bool = False) -> bytes:
    page.evaluate("time => window.mobman.setTime(time)", time)
    picture: bytes = page.screenshot(type="png", omit_background=transparent)
    return picture


def _check_positive(**given: Any) -> None:
    for name, value in given.items():
        if not (isinstance(value, Real) and 0.0 < float(value) < math.inf):
            raise UsageError(f"{name} = {value!r}: must be a number above 0")


def _checked_size(size: tuple[int, int] | None) -> tuple[int, int]:
    match _SIZE if size is None else size:
        case [int(width), int(height)] if (
            16 <= min(width, height) <= max(width, height) <= _LARGEST
        ):
            return width, height
    shown = "x".join(map(str, size)) if isinstance(size, tuple) else repr(size)
    raise UsageError(f"size = {shown}: allowed: 16x16 to {_LARGEST}x{_LARGEST} pixels")


def _write_gif(path: Path, frames: Iterator[Any], rate: float, size: tuple[int, int]) -> None:
    reduced = (frame.quantize(128, dither=0) for frame in frames)
    pause = max(2.0 * _GIF_STEP, round(1.0 / rate / _GIF_STEP) * _GIF_STEP)  # viewers refuse less
    options = {"duration": round(1000.0 * pause), "loop": 0, "optimize": True}
    next(reduced).save(path, format="GIF", save_all=True, append_images=reduced, **options)


def _write_mp4(path: Path, frames: Iterator[Any], rate: float, size: tuple[int, int]) -> None:
    options = {"fps": rate, "codec": "libx264", "quality": 8, "macro_block_size": 2}
    with closing(_encoder().write_frames(str(path), size, **options)) as writer:
        writer.send(None)
        for frame in frames:
            writer.send(frame.tobytes())


def _encoder() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MobmanError(
            "films as MP4 need the package imageio-ffmpeg; install it with: pip install 'mobman[film]', "
            "or make a .gif"
        ) from error
    return imageio_ffmpeg


def _in_browser(
    scene: Scene,
    size: tuple[int, int],
    act: Callable[[Any], Any],
    scale: float = 1.0,
    transparent: bool = False,
) -> Any:
    """Open the page of a scene, without its controls, and do something with it; returns its result.

    Raises:
        BrowserError: If playwright or a browser is missing, or the page does not open.
    """

    def run() -> Any:
        with browser() as running, tempfile.TemporaryDirectory(prefix="mobman-") as folder:
            from playwright.sync_api import Error

            file = Path(folder) / "page.html"
            file.write_text(document(scene.title, scene.content), encoding="utf-8")
            try:
                viewport = {"width": size[0], "height": size[1]}
                page = running.new_page(viewport=viewport, device_scale_factor=scale)
                page.set_default_timeout(_PATIENCE)
                page.goto(file.as_uri())
                page.evaluate("window.mobman.ready")
                page.evaluate("on => window.mobman.picture(on)", transparent)
                return act(page)
            except Error as error:
                raise BrowserError(f"the browser failed: {str(error).splitlines()[0]}") from error

    # a thread of its own: playwright's plain interface refuses to run where an event loop does, as in
    # a notebook
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(run).result()


@contextmanager
def browser() -> Iterator[Any]:
    """Start a browser without a window, by playwright; it is closed at the end.

    Raises:
        BrowserMissingError: If playwright or a browser is missing.
        BrowserError: If the browser does not start, or ``MOBMAN_BROWSER`` names no program.
    """
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        raise BrowserMissingError(
            "pictures and film need the package playwright; install it with: "
            "pip install 'mobman[film]'"
        ) from error
    program = _program()
    with sync_playwright() as playwright:
        try:
            running = playwright.chromium.launch(executable_path=program, args=list(_FLAGS))
        except Error as error:
            reason = str(error).splitlines()[0]
            if program is None and "Executable doesn't exist" in reason:
                raise BrowserMissingError(
                    "pictures and film need Chromium or Chrome, and there is none; install one, or "
                    f"name its program in the environment variable {VARIABLE}"
                ) from error
            name = program or "that playwright has installed"
            raise BrowserError(f"the browser {name} does not start: {reason}") from error
        try:
            yield running
        finally:
            running.close()


def _program() -> str | None:
    """The browser's program; None for the one that playwright may have downloaded."""
    named = os.environ.get(VARIABLE)
    if not named:
        return next((found for name in _PROGRAMS if (found := shutil.which(name))), None)
    if (found := shutil.which(named)) is None:
        raise BrowserError(f"{VARIABLE} = {named!r}: there is no such program")
    return found
