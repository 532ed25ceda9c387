"""The page: one HTML file with everything in it, that opens without a network; and its server."""

from __future__ import annotations

import asyncio
import base64
import errno
import html
import importlib.util
import ipaddress
import json
import os
import re
import socket
import threading
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import tornado.httpserver
import tornado.netutil
import tornado.web
from numpy.typing import NDArray

from mobman.arrays import Array
from mobman.errors import MobmanError, UsageError
from mobman.files import temporary_beside
from mobman.printable import printable

LOOPBACK = "127.0.0.1"
_SCRIPTS = ("robot.js", "run.js", "stage.js", "controls.js", "app.js")
_STOPPING = 5.0  # s


def packed(array: NDArray[Any], kind: str) -> dict[str, Any]:
    """An array for JSON, compact and exact: base64 of its bytes, little endian, row by row.

    Args:
        array: The array.
        kind: ``"f8"``, ``"f4"``, ``"u1"``, ``"u2"`` or ``"u4"``: the page reads these.
    """
    plain = np.ascontiguousarray(array, dtype="<" + kind)
    data = base64.b64encode(plain.tobytes()).decode("ascii")
    return {"kind": kind, "shape": list(plain.shape), "data": data}


def rows(matrix: Array) -> list[float]:
    """A matrix as a plain list, row by row, with all digits."""
    return [float(value) for value in np.asarray(matrix).ravel()]


def document(title: str, content: dict[str, Any]) -> str:
    """The page of a scene.

    Raises:
        MobmanError: If MeshCat's viewer is not installed as it should be.
    """
    meshcat, licence = _meshcat()
    scene = json.dumps(content, separators=(",", ":"), allow_nan=False)
    parts = {
        "title": html.escape(printable(f"{title} – mobman")),
        "style": _page_file("style.css"),
        "licence": licence.replace("--", "- -"),
        "scene": scene.replace("<", "\\u003c"),  # it cannot end the element that holds it
        "meshcat": meshcat,
        "script": "\n".join(_page_file(name) for name in _SCRIPTS),
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


def write_whole(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file under another name next to it, which gets its own when it is done.

    Args:
        path: The file; one that is there is replaced.
        write: Writes it to the path that it is given, which ends like the file's.

    Raises:
        MobmanError: If it cannot be written.
    """
    other = temporary_beside(path)
    temporary = other.with_name(other.name + path.suffix)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            write(temporary)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise MobmanError(f"cannot write {path}: {error.strerror or error}") from error


class PageServer:
    """Serves a page in this process until it is closed, for this machine alone unless told otherwise.

    It answers only to names of the address that it listens on, so that a page from elsewhere cannot
    reach it by a name of its own. Whoever reaches the address sees the page: there is no password, and
    no encryption.

    Args:
        page: The page.
        host: Address to listen on; ``"0.0.0.0"`` or ``"::"`` for all of this machine.
        port: Port; a free one if None.
        frames: Gives what a page that follows a run is to be told, as JSON, from the time of its
            latest frame (s); it is called in the server's own thread.

    Raises:
        UsageError: If the port is taken or not allowed, or the address is none of this machine's.

    Attributes:
        url: The page's address.
    """

    def __init__(
        self,
        page: str,
        host: str = LOOPBACK,
        port: int | None = None,
        frames: Callable[[float], str] | None = None,
    ) -> None:
        self._sockets = _bound(host, port)
        bound, self.port = self._sockets[0].getsockname()[:2]
        address = ipaddress.ip_address(_without_zone(bound))
        shown = host
        if (
            address.is_unspecified
        ):  # listening everywhere, it is reached by the loopback address too
            shown = LOOPBACK if address.version == 4 else "::1"
        self.url = f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}/"
        answer = {"names": _names(host, address), "page": page.encode(), "frames": frames}
        routes: list[Any] = [(r"/", _Page, answer)]
        if frames is not None:
            routes.append((r"/frames", _Frames, answer))
        self._application = tornado.web.Application(
            routes, compress_response=True, log_function=lambda _: None
        )
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="mobman view", daemon=True)
        self._thread.start()
        self._ready.wait()

    def close(self) -> None:
        """Stop; the port is free afterwards."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_STOPPING)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = tornado.httpserver.HTTPServer(self._application)

        async def listen() -> None:
            server.add_sockets(self._sockets)

        self._loop.run_until_complete(listen())
        self._ready.set()  # not before: a stop would be lost between two runs of the loop
        try:
            self._loop.run_forever()
        finally:
            server.stop()
            self._loop.run_until_complete(server.close_all_connections())
            self._loop.close()


class _Page(tornado.web.RequestHandler):
    def initialize(self, names: frozenset[str], page: bytes, frames: Any) -> None:
        self._names, self._content, self._frames = names, page, frames

    def prepare(self) -> None:
        connection: Any = self.request.connection
        if connection.stream.closed():  # the browser is gone; nobody reads the answer
            raise tornado.web.HTTPError(403)
        own = _without_zone(connection.stream.socket.getsockname()[0])
        if self.request.host_name.strip("[]") not in self._names | {own}:
            raise tornado.web.HTTPError(403)
        self.set_header("Cache-Control", "no-store")

    def write_error(self, status_code: int, **_: Any) -> None:
        self.finish(f"{status_code}: {self._reason}")

    def get(self) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.write(self._content)

    def head(self) -> None:
        self.get()


class _Frames(_Page):
    def get(self) -> None:
        try:
            after = float(self.get_query_argument("after"))
        except ValueError as error:
            raise tornado.web.HTTPError(400) from error
        self.set_header("Content-Type", "application/json")
        self.write(self._frames(after))


def _names(host: str, address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> frozenset[str]:
    """Names by which a browser may call the server, with the address that its connection came in on.

    Args:
        host: The address as it was given.
        address: What it stands for.
    """
    names = set() if address.is_unspecified else {host.lower()}
    if address.is_loopback or address.is_unspecified:
        names |= {"localhost", LOOPBACK, "::1"}
    if address.is_unspecified:
        names.add(socket.gethostname().lower())
    return frozenset(names)


def _without_zone(address: str) -> str:
    """An IPv6 address without the interface's name, which no browser sends."""
    return address.partition("%")[0]


def _bound(host: str, port: int | None) -> list[socket.socket]:
    if port is not None and not 0 <= port <= 65535:
        raise UsageError(f"port = {port}: allowed: 0 to 65535")
    try:
        return tornado.netutil.bind_sockets(port or 0, host)[:1]
    except socket.gaierror as error:
        raise UsageError(f"host = {host!r}: {error.strerror}") from error
    except OSError as error:
        known = {
            errno.EADDRINUSE: f"port {port} of {host} is taken; choose another one, or give none to "
            "get a free one",
            errno.EADDRNOTAVAIL: f"host = {host!r}: not an address of this machine",
        }
        other = f"cannot listen on {host}, port {port}: {error.strerror}"
        raise UsageError(known.get(error.errno or 0, other)) from error
