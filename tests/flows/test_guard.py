"""What the guard hands on, and what it does not: an app behind it notes all that reaches it."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from contextlib import suppress

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from flows.guard import SIGN_IN, Door, Guard

SECRET = "correct horse battery"
DOOR = Door(SECRET, frozenset({"127.0.0.1", "localhost", "[::1]"}), "/health")
BASIC = {"Authorization": "Basic " + base64.b64encode(f"admin:{SECRET}".encode()).decode()}
HOME = "http://127.0.0.1:4200"
SOCKET = "ws://127.0.0.1:4200/ws"


@pytest.fixture
def reached() -> list[str]:
    return []


@pytest.fixture
def client(reached: list[str]) -> Iterator[TestClient]:
    async def page(asked: Request) -> PlainTextResponse:
        reached.append(f"{asked.method} {asked.url.path}")
        return PlainTextResponse("inside")

    async def socket(opened: WebSocket) -> None:
        await opened.accept(subprotocol="prefect" if "prefect" in opened.scope["subprotocols"] else None)
        await opened.send_text("too early")
        with suppress(WebSocketDisconnect):
            reached.append(await opened.receive_text())
            await opened.send_text("inside")

    methods = ["GET", "POST", "PUT", "PATCH", "DELETE"]
    app = Starlette(routes=[WebSocketRoute("/ws", socket), Route("/{path:path}", page, methods=methods)])
    with TestClient(Guard(app, DOOR), base_url=HOME, follow_redirects=False) as client:
        yield client


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example:4200"},
        {"Host": "127.0.0.1.evil.example"},
        {"Host": ""},
        {"Host": "localhost:4200@evil.example"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:8888"},  # another program of this machine
        {"Origin": "http://localhost:4200"},  # is not where 127.0.0.1:4200 is
        {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image"},
        {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "script"},
        {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe"},
    ],
)
@pytest.mark.parametrize("path", ["/", "/health", f"/?token={SECRET}"])
def test_other_names_and_origins_are_turned_away_even_with_the_secret(
    headers: dict[str, str], path: str, client: TestClient, reached: list[str]
) -> None:
    answer = client.get(path, headers={**BASIC, **headers})
    assert answer.status_code == 403 and not reached and "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize("host", ["127.0.0.1:4200", "localhost", "LOCALHOST:9", "[::1]:4200", "[::1]"])
def test_own_names_are_taken_on_every_port(host: str, client: TestClient, reached: list[str]) -> None:
    headers = {**BASIC, "Host": host, "Origin": f"http://{host}"}
    assert client.get("/", headers=headers).text == "inside" and reached == ["GET /"]


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": "Basic !!!"},
        {"Authorization": "Basic " + base64.b64encode(b"\xff\xfe").decode()},
        {"Authorization": "Basic " + base64.b64encode(f"root:{SECRET}".encode()).decode()},
        {"Cookie": "=".join(Door("another secret", frozenset(), "/").cookie)},
        {"Cookie": f"{DOOR.cookie[0]}={SECRET}"},
    ],
)
def test_without_the_secret_only_the_health_is_told(
    told: dict[str, str], client: TestClient, reached: list[str]
) -> None:
    for method in ("GET", "POST", "PUT", "DELETE", "OPTIONS"):
        assert client.request(method, "/api/flows", headers=told).status_code == 401
        assert client.request(method, "/?token=wrong", headers=told).status_code == 401
    assert client.get("/health/../api/flows", headers=told).status_code == 401 and not reached
    assert client.get("/health", headers=told).text == "inside"
    assert client.post("/health", headers=told).status_code == 401


@pytest.mark.parametrize(
    "told", [BASIC, {"Authorization": f"Bearer {SECRET}"}, {"Authorization": f"Bearer admin:{SECRET}"}]
)
def test_programs_give_the_secret_in_a_header(told: dict[str, str], client: TestClient) -> None:
    assert client.post("/api/flows", headers=told, json={}).text == "inside"


@pytest.mark.parametrize(
    "kind",
    ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "", "application/jsonx"],
)
def test_a_body_that_changes_something_is_json(kind: str, client: TestClient, reached: list[str]) -> None:
    for method in ("POST", "PATCH", "DELETE"):
        headers = {**BASIC, **({"Content-Type": kind} if kind else {})}
        assert client.request(method, "/api/flows", headers=headers, content=b"{}").status_code == 415
    assert not reached
    headers = {**BASIC, "Content-Type": "application/json; charset=utf-8"}
    assert client.post("/api/flows", headers=headers, content=b"{}").text == "inside"


def test_the_printed_address_signs_a_browser_in_and_leaves_no_token_behind(client: TestClient) -> None:
    answer = client.get(f"/runs?a=1&token={SECRET}&b=%26")
    assert (answer.status_code, answer.headers["location"]) == (303, "/runs?a=1&b=%26")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie and "max-age" in cookie and SECRET not in cookie
    assert client.get("/runs").text == "inside", "the bookmark"
    assert client.get("/runs").headers["x-frame-options"] == "SAMEORIGIN"


def test_no_address_leads_to_another_server(client: TestClient) -> None:
    for path in ("//evil.example/x", "/\\evil.example/x", "///evil.example"):
        form = {"next": path, "token": SECRET}
        where = client.post(SIGN_IN, data=form).headers["location"]
        assert where.startswith("/") and not where.startswith(("//", "/\\"))
    where = client.get(f"{HOME}//evil.example/?token={SECRET}").headers["location"]
    assert where.startswith("/") and not where.startswith(("//", "/\\"))


def test_a_person_is_asked_for_the_password(client: TestClient, reached: list[str]) -> None:
    asked = client.get('/runs?x="><script>', headers={"Accept": "text/html"})
    assert asked.status_code == 401 and SIGN_IN in asked.text and "<script>" not in asked.text and not reached
    assert client.post(SIGN_IN, data={"token": "wrong", "next": "/runs"}).status_code == 401
    assert client.post(SIGN_IN, content=b"x" * 9000).status_code == 413
    known = client.post(SIGN_IN, data={"token": SECRET, "next": "/runs"})
    assert (known.status_code, known.headers["location"]) == (303, "/runs")
    assert client.get("/runs").text == "inside"


def test_a_socket_is_opened_by_header_or_cookie(client: TestClient) -> None:
    with client.websocket_connect(SOCKET, headers=BASIC) as socket:
        assert socket.receive_text() == "too early"
    client.cookies.set(*DOOR.cookie)
    with client.websocket_connect(SOCKET, headers={"Origin": HOME, "Host": "127.0.0.1:4200"}) as socket:
        assert socket.receive_text() == "too early"


@pytest.mark.parametrize("headers", [{}, {"Origin": "http://evil.example", **BASIC}, {"Host": "evil.example", **BASIC}])
def test_other_sockets_are_not_opened(headers: dict[str, str], client: TestClient) -> None:
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(SOCKET, headers=headers):
        pass


def test_prefects_clients_give_the_secret_in_the_first_message(client: TestClient, reached: list[str]) -> None:
    with client.websocket_connect(SOCKET, subprotocols=["prefect"]) as socket:
        socket.send_json({"type": "auth", "token": f"admin:{SECRET}"})
        assert socket.receive_text() == "inside", "nothing is told before"
    reached.clear()
    for wrong in ('{"type": "auth", "token": "wrong"}', "[]", "{", '{"token": null}', '{"token": {}}'):
        with client.websocket_connect(SOCKET, subprotocols=["prefect"]) as socket:
            socket.send_text(wrong)
            with pytest.raises(WebSocketDisconnect):
                socket.receive_text()
    assert not reached


def test_the_secret_is_in_no_representation() -> None:
    assert SECRET not in repr(DOOR) and SECRET not in "".join(DOOR.cookie)
