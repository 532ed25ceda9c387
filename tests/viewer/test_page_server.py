"""Names that the page server answers to: no page from elsewhere reaches it by a name of its own."""

from __future__ import annotations

import gzip
import http.client
import socket
import struct
from contextlib import contextmanager

import pytest

from mobman.errors import UsageError
from mobman.viewer.page import PageServer

FOREIGN = ["elsewhere.example", "192.0.2.1", "localhost.elsewhere.example", "", "0.0.0.0", "[::2]"]


@contextmanager
def serving(host):
    try:
        server = PageServer("the page", host, frames=lambda after: "{}")
    except UsageError as error:
        pytest.skip(f"this machine has no address {host}: {error}")
    try:
        yield server
    finally:
        server.close()


def status(server, name, to="127.0.0.1", path="/"):
    """Of a request that reaches an address and calls the server by a name."""
    connection = http.client.HTTPConnection(to, server.port, timeout=10)
    try:
        connection.putrequest("GET", path, skip_host=True)
        connection.putheader("Host", f"{name}:{server.port}" if name else "")
        connection.endheaders()
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.mark.parametrize("path", ["/", "/frames?after=0"])
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0", "127.0.0.2"])
def test_foreign_names_are_refused(host, path):
    with serving(host) as server:
        to = host if host.startswith("127") else "127.0.0.1"
        for name in FOREIGN:
            assert status(server, name, to, path) == 403, name


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "0.0.0.0"])
def test_loopback_names(host):
    with serving(host) as server:
        for name in ("localhost", "LocalHost", "127.0.0.1", "[::1]"):
            assert status(server, name) == 200, name
            assert status(server, name, path="/frames?after=0") == 200, name


def test_every_address_of_the_machine():
    with serving("0.0.0.0") as server:
        assert server.url == f"http://127.0.0.1:{server.port}/"
        assert status(server, socket.gethostname()) == 200
        assert status(server, "127.0.0.2", to="127.0.0.2") == 200  # that the connection came in on
        assert status(server, "127.0.0.2", to="127.0.0.1") == 403  # and no other


def test_every_address_of_version_6():
    with serving("::") as server:
        assert server.url == f"http://[::1]:{server.port}/"
        assert status(server, "[::1]", to="::1") == 200
        assert status(server, "elsewhere.example", to="::1") == 403


def test_an_address_that_is_named():
    with serving("127.0.0.2") as server:
        assert status(server, "127.0.0.2", to="127.0.0.2") == 200


def test_a_host_by_its_name(monkeypatch):
    """The name that was given, and the address that it stands for."""
    real = socket.getaddrinfo

    def resolve(host, *rest, **more):
        return real("127.0.0.2" if host == "Robot.example" else host, *rest, **more)

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    with serving("Robot.example") as server:
        assert status(server, "robot.example", to="127.0.0.2") == 200
        assert status(server, "127.0.0.2", to="127.0.0.2") == 200
        assert status(server, "localhost", to="127.0.0.2") == 200
        assert status(server, "elsewhere.example", to="127.0.0.2") == 403


def test_browser_that_is_gone_before_the_answer(caplog):
    """As when a live run is interrupted and its page is closed: nothing is logged."""
    with serving("127.0.0.1") as server:
        for _ in range(300):
            with socket.create_connection(("127.0.0.1", server.port), timeout=10) as asking:
                reset = struct.pack("ii", 1, 0)
                asking.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
                asking.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 3)
    assert caplog.records == []


def test_answers():
    """The page whole, packed if the browser says that it unpacks; its head alone; nothing else."""
    with serving("127.0.0.1") as server:

        def answer(method, path, **headers):
            connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
            try:
                connection.request(method, path, headers=headers)
                response = connection.getresponse()
                return response.status, response.getheader("Content-Length"), response.read()
            finally:
                connection.close()

        assert answer("GET", "/") == (200, "8", b"the page")
        assert answer("HEAD", "/") == (200, "8", b"")
        status, _, packed = answer("GET", "/", **{"Accept-Encoding": "gzip, br"})
        assert (status, gzip.decompress(packed)) == (200, b"the page")
        assert answer("GET", "/other")[0] == 404
        assert answer("POST", "/")[0] == 501


def test_connection_that_asks_nothing_holds_nothing_up():
    with serving("127.0.0.1") as server, socket.create_connection(("127.0.0.1", server.port)):
        assert status(server, "localhost") == 200
