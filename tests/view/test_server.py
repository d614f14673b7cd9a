"""viser behind a gate: nothing of it, page or web socket, is had past the gate, and there is no other way in."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import viser
import websockets.asyncio.server as sockets
from viser import _messages
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.view.server import guarded_server, listening, stop
from flows.guard import Door, Guard

SECRET = "correct horse battery"
DOOR = Door(SECRET, frozenset({"127.0.0.1", "localhost"}), healthy="", posts=False, command="aug3d view")
COOKIE = {"Cookie": "=".join(DOOR.cookie)}
VERSION = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with listening(0) as own:
        server = guarded_server(own, lambda app: Guard(app, DOOR), "toy")  # type: ignore[arg-type]
        assert _messages.ShareUrlRequest not in server._websock_server._incoming_handlers
        yield own.getsockname()[1]
        stop(server)


def got(port: int, path: str = "/", **headers: str) -> tuple[int, http.client.HTTPMessage, bytes]:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as asked:
        asked.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = asked.getresponse()
        return answer.status, answer.headers, answer.read()


@pytest.mark.parametrize(
    "path", ["/", "/index.html", "/?token=wrong", "/nothing", "//evil.example", "/%2e%2e/pyproject.toml"]
)
def test_without_the_token_there_is_no_page(port: int, path: str) -> None:
    status, headers, body = got(port, path)
    assert status == 401 and b"viser" not in body
    assert headers["X-Frame-Options"] == "SAMEORIGIN"


def test_the_printed_address_opens_it_and_leaves_no_token_behind(port: int) -> None:
    status, headers, _ = got(port, f"/?token={SECRET.replace(' ', '%20')}")
    assert (status, headers["Location"]) == (303, "/")
    cookie = headers["Set-Cookie"]
    assert SECRET not in cookie and "HttpOnly" in cookie and "SameSite=strict" in cookie
    status, headers, body = got(port, Cookie=cookie.partition(";")[0])
    assert status == 200 and b"<html" in body and headers["X-Frame-Options"] == "SAMEORIGIN"
    policy = headers["Content-Security-Policy"].split("; ")
    assert {"script-src-attr 'none'", "frame-src 'none'", "default-src 'self' data: blob:"} <= {*policy}


def test_a_person_without_it_is_asked_in_a_way_that_the_server_hears(port: int) -> None:
    status, _, body = got(port, Accept="text/html")
    assert status == 401 and b'method="get" action="/"' in body and b"aug3d view" in body


@pytest.mark.parametrize(
    "headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Sec_Fetch_Site": "cross-site"}]
)
def test_another_site_gets_nothing_with_the_cookie(port: int, headers: dict[str, str]) -> None:
    status, _, body = got(port, **COOKIE, **headers)
    assert status == 403 and b"viser" not in body


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Cookie": "aug3d-0=0"},
        {"Authorization": "Bearer wrong"},
        {**COOKIE, "Origin": "http://evil.example"},
        {**COOKIE, "Origin": "http://127.0.0.1:1"},  # another program of this machine
    ],
)
@pytest.mark.parametrize("protocols", [[VERSION], [VERSION, "prefect"]])
def test_a_web_socket_without_the_token_or_of_another_origin_is_refused(
    port: int, headers: dict[str, str], protocols: list[Any]
) -> None:
    with pytest.raises(InvalidStatus, match="HTTP 403"):
        connect(f"ws://127.0.0.1:{port}/", additional_headers=headers, subprotocols=protocols).close()


def test_a_web_socket_with_the_token_is_heard(port: int) -> None:
    own: Any = [VERSION]
    origin: Any = f"http://127.0.0.1:{port}"
    with connect(f"ws://127.0.0.1:{port}/", additional_headers=COOKIE, subprotocols=own, origin=origin) as socket:
        assert len(socket.recv(timeout=10)) > 16


def test_a_port_that_is_taken_is_told(port: int) -> None:
    with pytest.raises(UsageError, match=f"port {port} cannot be used"):
        listening(port)


def test_a_viser_that_listens_by_itself_is_not_let_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a version would that calls something else: its server is ended, and the error says why."""
    open_door = sockets.serve

    class OpenDoor(viser.ViserServer):
        def __init__(self, **given: Any) -> None:
            sockets.serve = open_door  # type: ignore[misc]
            given["port"] = 0
            super().__init__(**given)

    monkeypatch.setattr(viser, "ViserServer", OpenDoor)
    with listening(0) as own, pytest.raises(Aug3dError, match="would let everybody in"):
        guarded_server(own, lambda app: app, "toy")
