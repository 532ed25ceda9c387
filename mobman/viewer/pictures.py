"""Pictures and film of a scene."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mobman.errors import MobmanError, UsageError
from mobman.viewer.browser import in_browser
from mobman.viewer.document import document
from mobman.viewer.files import write_whole
from mobman.viewer.scene import Scene

if TYPE_CHECKING:
    from playwright.sync_api import Page

FILM = (".gif", ".mp4")
PICTURE = ".png"
SIZE = (1280, 720)
_LARGEST = 8192
_MOST_FRAMES = 20_000
_GIF_STEP = 0.01  # s: its clock

Progress = Callable[[float], None]


def save_picture(
    scene: Scene,
    path: Path,
    *,
    time: float | None = None,
    size: tuple[int, int] | None = None,
) -> None:
    """A picture as a PNG file: whole, or not at all.

    Args:
        scene: What to show.
        path: The file.
        time: s; the end of the longest run by default.
        size: Width and height (pixels).

    Raises:
        UsageError: If the time or the size cannot be.
        BrowserError: If there is no browser.
        MobmanError: If the file cannot be written.
    """
    at = _instant(scene, time)

    def shoot(page: Page) -> bytes:
        return _frame(page, at)

    picture = in_browser(document(scene), _checked_size(size), shoot)
    write_whole(path, lambda file: file.write_bytes(picture))


def save_film(
    scene: Scene,
    path: Path,
    *,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    speed: float = 1.0,
    progress: Progress = lambda _: None,
) -> None:
    """A film of the runs from beginning to end, as GIF or MP4 by the file's name.

    Args:
        scene: What to show.
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
    kind = path.suffix.lower()
    if kind not in FILM:
        raise UsageError(f"{path}: a film is a file {' or '.join(FILM)}")
    if scene.duration <= 0.0:
        raise UsageError(f"{path}: there is no run, and a robot alone does not move; make a .png")
    rate = fps if fps is not None else (20.0 if kind == ".gif" else 30.0)
    for name, value in (("fps", rate), ("speed", speed)):
        if not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"{name} = {value!r}: must be a number above 0")
    count = math.ceil(scene.duration * rate / speed) + 1
    if count > _MOST_FRAMES:
        raise UsageError(
            f"a film of {scene.duration:g} s at {rate:g} frames a second and speed {speed:g} has "
            f"{count} frames; allowed: {_MOST_FRAMES}"
        )
    width, height = _checked_size(size)
    even = (width + width % 2, height + height % 2)  # the encoder's blocks
    encode = _write_gif if kind == ".gif" else _write_mp4
    if kind == ".mp4":
        _encoder()  # before the work, not after it
    times = np.minimum(np.arange(count) * speed / rate, scene.duration)

    def shoot(page: Page) -> None:
        def frames() -> Iterator[bytes]:
            for i, time in enumerate(times):
                yield _frame(page, float(time))
                progress((i + 1) / count)

        write_whole(path, lambda file: encode(file, frames(), rate, even))

    in_browser(document(scene), even, shoot)


def _frame(page: Page, time: float) -> bytes:
    page.evaluate("time => window.mobman.setTime(time)", time)
    return page.screenshot(type="png")


def _instant(scene: Scene, time: float | None) -> float:
    if time is None:
        return scene.duration
    if not (math.isfinite(time) and time >= 0.0):
        raise UsageError(f"time = {time!r}: must be a number, 0 or more (s)")
    return min(time, scene.duration)


def _checked_size(size: tuple[int, int] | None) -> tuple[int, int]:
    width, height = SIZE if size is None else size
    if not (16 <= width <= _LARGEST and 16 <= height <= _LARGEST):
        raise UsageError(f"size = {width}x{height}: allowed: 16x16 to {_LARGEST}x{_LARGEST}")
    return width, height


def _write_gif(path: Path, frames: Iterator[bytes], rate: float, size: tuple[int, int]) -> None:
    from PIL import Image

    def reduced(frame: bytes) -> Image.Image:
        with Image.open(io.BytesIO(frame)) as image:
            return image.convert("RGB").quantize(128, dither=Image.Dither.NONE)

    first = reduced(next(frames))
    pause = max(2.0 * _GIF_STEP, round(1.0 / rate / _GIF_STEP) * _GIF_STEP)  # viewers refuse less
    first.save(
        path,
        format="GIF",
        save_all=True,
        append_images=(reduced(frame) for frame in frames),
        duration=round(1000.0 * pause),
        loop=0,
        optimize=True,
    )


def _write_mp4(path: Path, frames: Iterator[bytes], rate: float, size: tuple[int, int]) -> None:
    from PIL import Image

    writer = _encoder().write_frames(
        str(path), size, fps=rate, codec="libx264", quality=8, macro_block_size=2
    )
    writer.send(None)
    try:
        for frame in frames:
            with Image.open(io.BytesIO(frame)) as image:
                writer.send(np.asarray(image.convert("RGB")).tobytes())
    finally:
        writer.close()


def _encoder() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MobmanError(
            "films as MP4 need the package imageio-ffmpeg; install it with: pip install 'mobman[film]', "
            "or make a .gif"
        ) from error
    return imageio_ffmpeg
