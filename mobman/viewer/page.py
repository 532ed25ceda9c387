"""The page: one HTML file with everything in it, that opens without a network; and its server."""

from __future__ import annotations

import base64
import errno
import gzip
import html
import importlib.util
import ipaddress
import json
import os
import re
import socket
import socketserver
import threading
from collections.abc import Callable
from functools import cache
from http.server import BaseHTTPRequestHandler
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
from numpy.typing import NDArray

from mobman.errors import MobmanError, UsageError
from mobman.files import temporary_beside
from mobman.printable import printable

LOOPBACK = "127.0.0.1"
_SCRIPTS = ("robot.js", "run.js", "plots.js", "stage.js", "app.js")


def packed(array: NDArray[Any], kind: str) -> dict[str, Any]:
    """Pack an array for JSON, compact and exact: base64 of its bytes, little endian, row by row.

    Args:
        array: The array.
        kind: ``"f8"``, ``"f4"``, ``"u1"`` or ``"u4"``: the page reads these.
    """
    plain = np.ascontiguousarray(array, dtype="<" + kind)
    data = base64.b64encode(plain.tobytes()).decode("ascii")
    return {"kind": kind, "shape": list(plain.shape), "data": data}


def document(title: str, content: dict[str, Any]) -> str:
    """Make the page of a scene.

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


class PageServer(socketserver.ThreadingTCPServer):
    """Serves a page in this process until it is closed, for this machine alone unless told otherwise.

    It answers only to names of the address that it listens on, so that a page from elsewhere cannot
    reach it by a name of its own. Whoever reaches the address sees the page: there is no password, and
    no encryption.

    Args:
        page: The page.
        host: Address to listen on; ``"0.0.0.0"`` or ``"::"`` for all of this machine.
        port: Port; a free one if None.
        frames: Gives what a page that follows a run is to be told, as JSON, from the time of its
            latest frame (s); it is called by one thread at a time.

    Raises:
        UsageError: If the port is taken or not allowed, or the address is none of this machine's.

    Attributes:
        url: The page's address.
    """

    daemon_threads = True
    allow_reuse_address = os.name == "posix"  # elsewhere it would let others take the port
    request_queue_size = 128

    def __init__(
        self,
        page: str,
        host: str = LOOPBACK,
        port: int | None = None,
        frames: Callable[[float], str] | None = None,
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
        address = ipaddress.ip_address(_without_zone(bound))
        shown = host
        self.names = {host.lower()}
        if address.is_unspecified:  # reached by the loopback address too, and by the machine's name
            shown = LOOPBACK if address.version == 4 else "::1"
            self.names = {socket.gethostname().lower()}
        if address.is_unspecified or address.is_loopback:
            self.names |= {"localhost", LOOPBACK, "::1"}
        self.url = f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}/"
        self._thread = threading.Thread(
            target=self.serve_forever, args=(0.05,), name="mobman view", daemon=True
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
