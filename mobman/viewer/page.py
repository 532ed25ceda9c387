"""The page: one HTML file with everything in it, that opens without a network; its server; and pictures
and films of it, taken by a browser without a window."""

from __future__ import annotations

import errno
import gzip
import html
import importlib.util
import io
import ipaddress
import json
import math
import os
import re
import shutil
import socket
import socketserver
import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler
from importlib.resources import files
from numbers import Real
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from PIL import Image

from mobman.display import printable
from mobman.errors import MobmanError, UsageError
from mobman.files import write_all, written
from mobman.viewer.scene import Scene, check_view

LOOPBACK = "127.0.0.1"
News = Callable[[float], str]  # what a page that follows a run is to be told, as JSON
_SCRIPTS = ("robot.js", "run.js", "plots.js", "stage.js", "app.js")


def document(title: str, content: dict[str, Any]) -> str:
    """Make the page of a scene; MobmanError if MeshCat's viewer is not installed as it should be."""
    meshcat, licence = _meshcat()
    scene = json.dumps(content, separators=(",", ":"), allow_nan=False)
    parts = {
        "title": html.escape(printable(f"{title} – mobman")),
        "style": _page_file("style.css"),
        "licence": licence.replace("--", "- -"),
        "scene": scene.replace("<", "\\u003c"),  # it cannot end the element that holds it
        "meshcat": meshcat,
        "script": "\n".join(map(_page_file, _SCRIPTS)),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], _page_file("template.html"))


@cache
def _page_file(name: str) -> str:
    return (files("mobman.viewer") / "page" / name).read_text(encoding="utf-8")


@cache
def _meshcat() -> tuple[str, str]:
    """MeshCat's script, ready to be put into a page, and the licences that it asks to be kept."""
    try:
        spec = importlib.util.find_spec("meshcat")  # its Python side is not needed
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError("no package meshcat")
        folder = Path(spec.origin).parent / "viewer"
        names = ("dist/main.min.js", "LICENSE", "dist/main.min.js.LICENSE.txt")
        script, own, others = ((folder / name).read_text(encoding="utf-8") for name in names)
    except (ModuleNotFoundError, OSError) as error:
        raise MobmanError(
            f"MeshCat's viewer is not there ({error}); install it with: pip install --force-reinstall "
            "meshcat"
        ) from error
    return script.replace("</script", "<\\/script"), f"{own}\n{others}"


class PageServer(socketserver.ThreadingTCPServer):
    """Serves a page in this process until it is closed, for this machine alone unless told otherwise.

    It answers only to names of the address that it listens on, so that a page from elsewhere cannot
    reach it by a name of its own. Whoever reaches the address sees the page: there is no password, and
    no encryption.

    Args:
        page: The page; ``url`` is its address then.
        host: Address to listen on; ``"0.0.0.0"`` or ``"::"`` for all of this machine.
        port: Port; a free one if None. UsageError if it is taken or not allowed, or the host is none.
        frames: Gives what a page that follows a run is to be told, from the time of its latest frame
            (s); it is called by one thread at a time.
    """

    daemon_threads = True
    allow_reuse_address = os.name == "posix"  # elsewhere it would let others take the port
    request_queue_size = 128

    def __init__(
        self, page: str, host: str = LOOPBACK, port: int | None = None, frames: News | None = None
    ) -> None:
        if port is not None and not (isinstance(port, int) and 0 <= port <= 65535):
            raise UsageError(f"port = {port!r}: allowed: 0 to 65535")
        if not isinstance(host, str):
            raise UsageError(f"host = {host!r}: expected an address or a name")
        try:
            found = socket.getaddrinfo(host, port or 0, type=socket.SOCK_STREAM)[0]
            self.address_family = found[0]
            super().__init__(found[4], _Handler)  # type: ignore[arg-type]
        except (socket.gaierror, UnicodeError) as error:
            raise UsageError(f"host = {host!r}: {getattr(error, 'strerror', error)}") from error
        except OSError as error:
            known = {
                errno.EADDRINUSE: f"port {port} of {host} is taken; choose another one, or give none "
                "to get a free one",
                errno.EADDRNOTAVAIL: f"host = {host!r}: not an address of this machine",
            }
            other = f"cannot listen on {host}, port {port}: {error.strerror}"
            raise UsageError(known.get(error.errno or 0, other)) from error
        self.page, self.frames, self.lock = page.encode(), frames, threading.Lock()
        bound, self.port = self.socket.getsockname()[:2]
        address, shown = ipaddress.ip_address(_without_zone(bound)), host
        self.names = {host.lower()}
        if address.is_unspecified:  # reached by the loopback address too, and by the machine's name
            shown = LOOPBACK if address.version == 4 else "::1"
            self.names = {socket.gethostname().lower()}
        if address.is_unspecified or address.is_loopback:
            self.names |= {"localhost", LOOPBACK, "::1"}
        self.url = f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}/"
        name = "mobman view"
        self._thread = threading.Thread(
            target=self.serve_forever, args=(0.05,), name=name, daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop; the port is free afterwards."""
        self.shutdown()
        self._thread.join()
        self.server_close()

    def handle_error(self, *_: Any) -> None:
        """Say nothing: the browser is gone, and nobody reads the answer."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    server_version, sys_version = "mobman", ""
    timeout = 30  # s, for a browser that connects and asks nothing

    def do_GET(self) -> None:
        name = re.sub(r":\d*$", "", self.headers.get("Host", "").lower()).strip("[]")
        own = _without_zone(self.connection.getsockname()[0])
        asked = urlsplit(self.path)
        if name not in self.server.names | {own}:
            self.send_error(403)
        elif asked.path == "/":
            self._answer("text/html; charset=utf-8", self.server.page)
        elif asked.path == "/frames" and self.server.frames is not None:
            try:
                after = float(parse_qs(asked.query)["after"][0])
            except (KeyError, ValueError):
                self.send_error(400)
                return
            with self.server.lock:
                news = self.server.frames(after)
            self._answer("application/json", news.encode())
        else:
            self.send_error(404)

    do_HEAD = do_GET

    def _answer(self, kind: str, content: bytes) -> None:
        self.send_response(200)
        if "gzip" in self.headers.get("Accept-Encoding", ""):
            content = gzip.compress(content, 6)
            self.send_header("Content-Encoding", "gzip")
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        pass


def _without_zone(address: str) -> str:
    """An IPv6 address without the interface's name, which no browser sends."""
    return address.partition("%")[0]


# Pictures ----------------------------------------------------------------------------------------------

VARIABLE = "MOBMAN_BROWSER"
"""Environment variable that may name the browser's program."""
_PROGRAMS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("msedge", "microsoft-edge"),
)
# WebGL by the processor, so that a picture is the same with and without a graphics card
_FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_PATIENCE = 120_000.0  # ms
_LARGEST = 8192
_MOST_FRAMES = 20_000
_GIF_STEP = 0.01  # s: its clock

Size = tuple[int, int]
"""Width and height (pixels)."""
_SIZE: Size = (1280, 720)


class BrowserError(MobmanError):
    """There is no browser that could take a picture, or it failed."""


class BrowserMissingError(BrowserError):
    """Neither Chromium nor Chrome is installed, or the package that drives it is not."""


def save_picture(
    scene: Scene,
    path: Path,
    *,
    time: float | None = None,
    size: Size | None = None,
    scale: float = 1.0,
    transparent: bool = False,
) -> None:
    """Write a picture as a PNG file, as :meth:`View.save <mobman.viewer.view.View.save>` says."""
    check_view(time)
    at = scene.duration if time is None else min(time, scene.duration)
    _check_positive(scale=scale)
    size = _checked(size)
    _checked((round(scale * size[0]), round(scale * size[1])))

    def shoot(page: Any) -> bytes:
        return _frame(page, at, transparent)

    write_all({path: _in_browser(scene, size, shoot, scale, transparent)})


def save_film(
    scene: Scene,
    path: Path,
    *,
    fps: float | None = None,
    size: Size | None = None,
    speed: float = 1.0,
    progress: Callable[[float], None] = lambda _: None,
) -> None:
    """Write a film of the runs, as :meth:`View.save <mobman.viewer.view.View.save>` says."""
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
    size = _checked(size)
    even = (size[0] + size[0] % 2, size[1] + size[1] % 2)  # the encoder's blocks
    write: Callable[..., None] = _write_gif if gif else _write_mp4
    if not gif:
        _encoder()  # before the work, not after it

    def frames(page: Any) -> Iterator[Any]:
        for i in range(count):
            with Image.open(io.BytesIO(_frame(page, min(i * speed / rate, scene.duration)))) as one:
                yield one.convert("RGB")
            progress((i + 1) / count)

    def shoot(page: Any) -> None:
        with written(path) as file:
            write(file, frames(page), rate, even)

    _in_browser(scene, even, shoot)


def _frame(page: Any, time: float, transparent: bool = False) -> bytes:
    page.evaluate("time => window.mobman.setTime(time)", time)
    picture: bytes = page.screenshot(type="png", omit_background=transparent)
    return picture


def _check_positive(**given: Any) -> None:
    for name, value in given.items():
        if not (isinstance(value, Real) and 0.0 < float(value) < math.inf):
            raise UsageError(f"{name} = {value!r}: must be a number above 0")


def _checked(size: Any) -> Size:
    match _SIZE if size is None else size:
        case [int(width), int(height)] if (
            16 <= min(width, height) <= max(width, height) <= _LARGEST
        ):
            return width, height
    shown = "x".join(map(str, size)) if isinstance(size, tuple) else repr(size)
    raise UsageError(f"size = {shown}: allowed: 16x16 to {_LARGEST}x{_LARGEST} pixels")


def _write_gif(path: Path, frames: Iterator[Any], rate: float, size: Size) -> None:
    reduced = (frame.quantize(128, dither=0) for frame in frames)
    pause = max(2.0 * _GIF_STEP, round(1.0 / rate / _GIF_STEP) * _GIF_STEP)  # viewers refuse less
    options = {"duration": round(1000.0 * pause), "loop": 0, "optimize": True}
    next(reduced).save(path, format="GIF", save_all=True, append_images=reduced, **options)


def _write_mp4(path: Path, frames: Iterator[Any], rate: float, size: Size) -> None:
    options = {"fps": rate, "codec": "libx264", "quality": 8, "macro_block_size": 2}
    options |= {"output_params": ["-f", "mp4"]}  # the path does not say it
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
    size: Size,
    act: Callable[[Any], Any],
    scale: float = 1.0,
    transparent: bool = False,
) -> Any:
    """Open the page of a scene, without its controls, and do something with it; returns its result.
    BrowserError as of :func:`browser`, or if the page does not open."""

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

    # playwright's plain interface refuses to run where an event loop does, as in a notebook
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(run).result()


@contextmanager
def browser() -> Iterator[Any]:
    """Start a browser without a window, by playwright; it is closed at the end. BrowserMissingError if
    one of both is missing, BrowserError if it does not start, or ``MOBMAN_BROWSER`` names no program."""
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError as error:
        raise BrowserMissingError(
            "pictures and film need the package playwright; install it with: "
            "pip install 'mobman[film]'"
        ) from error
    named = os.environ.get(VARIABLE)
    # without any, the one that playwright may have downloaded
    program = next(filter(None, map(shutil.which, [named] if named else _PROGRAMS)), None)
    if named and program is None:
        raise BrowserError(f"{VARIABLE} = {named!r}: there is no such program")
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
        with closing(running):
            yield running
