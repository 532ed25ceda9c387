"""A web server for one page, in this process and for this machine alone unless told otherwise."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import socket
import threading
from collections.abc import Callable
from typing import Any

import tornado.httpserver
import tornado.netutil
import tornado.web

from mobman.errors import UsageError

LOOPBACK = "127.0.0.1"
_STOPPING = 5.0  # s
Address = ipaddress.IPv4Address | ipaddress.IPv6Address


class PageServer:
    """Serves a page until it is closed.

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
        sockets = _bound(host, port)
        bound, self.port = sockets[0].getsockname()[:2]
        address = ipaddress.ip_address(_without_zone(bound))
        shown = host
        if (
            address.is_unspecified
        ):  # one that listens everywhere is reached by the loopback address too
            shown = LOOPBACK if address.version == 4 else "::1"
        self.url = f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}/"
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        names = _names(host, address)
        routes: list[Any] = [(r"/", _Page, {"page": page.encode(), "names": names})]
        if frames is not None:
            routes.append((r"/frames", _Frames, {"frames": frames, "names": names}))
        self._application = tornado.web.Application(
            routes,
            compress_response=True,
            log_function=lambda _: None,
        )
        self._thread = threading.Thread(
            target=self._serve, args=(sockets,), name="mobman view", daemon=True
        )
        self._thread.start()
        self._ready.wait()

    def close(self) -> None:
        """Stop; the port is free afterwards."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_STOPPING)

    def _serve(self, sockets: list[socket.socket]) -> None:
        asyncio.set_event_loop(self._loop)
        server = tornado.httpserver.HTTPServer(self._application)

        async def listen() -> None:
            server.add_sockets(sockets)

        self._loop.run_until_complete(listen())
        self._ready.set()
        try:
            self._loop.run_forever()
        finally:
            server.stop()
            self._loop.run_until_complete(server.close_all_connections())
            self._loop.close()


class _Answer(tornado.web.RequestHandler):
    _names: frozenset[str]

    def prepare(self) -> None:
        connection: Any = self.request.connection
        own = _without_zone(connection.stream.socket.getsockname()[0])
        if self.request.host_name.strip("[]") not in self._names | {own}:
            raise tornado.web.HTTPError(403)
        self.set_header("Cache-Control", "no-store")

    def write_error(self, status_code: int, **_: Any) -> None:
        self.finish(f"{status_code}: {self._reason}")


class _Page(_Answer):
    def initialize(self, page: bytes, names: frozenset[str]) -> None:
        self._page = page
        self._names = names

    def get(self) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.write(self._page)

    head = get


class _Frames(_Answer):
    def initialize(self, frames: Callable[[float], str], names: frozenset[str]) -> None:
        self._frames = frames
        self._names = names

    def get(self) -> None:
        try:
            after = float(self.get_query_argument("after"))
        except ValueError as error:
            raise tornado.web.HTTPError(400) from error
        self.set_header("Content-Type", "application/json")
        self.write(self._frames(after))


def _names(host: str, address: Address) -> frozenset[str]:
    """What a browser may call the server, in addition to the address that its connection came in on.

    Args:
        host: As it was given.
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
        if error.errno == errno.EADDRINUSE:
            raise UsageError(
                f"port {port} of {host} is taken; choose another one, or give none to get a free one"
            ) from error
        if error.errno == errno.EADDRNOTAVAIL:
            raise UsageError(f"host = {host!r}: not an address of this machine") from error
        raise UsageError(f"cannot listen on {host}, port {port}: {error.strerror}") from error
