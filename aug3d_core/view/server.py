"""viser's server behind a gate: on loopback, on a socket that is known to be free, and for nobody whom the gate stops.

viser has no door of its own. Its one port serves a page and web sockets by `websockets.asyncio.server.serve`, which asks a
function about each request before it answers. Here that function is the gate's: an ASGI app around another one.
"""

from __future__ import annotations

import io
import socket
from collections.abc import Awaitable, Callable, Iterator, MutableMapping
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server as sockets
from viser import _messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from aug3d_core.run.errors import Aug3dError, UsageError

HOST = "127.0.0.1"
# viser's page is one inline script that makes others: those cannot be told from a stranger's, but what a stranger's HTML would
# need beside them is forbidden: handlers in attributes, frames, and any other server
_PAGE_MAY = "; ".join(
    (
        "default-src 'self' data: blob:",
        "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:",
        "script-src-attr 'none'",
        "style-src 'self' 'unsafe-inline'",
        "frame-src 'none'",
        "object-src 'none'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
    )
)
# What ASGI calls them; a gate is given the app that it stands before
Message = MutableMapping[str, Any]
App = Callable[[Message, Callable[[], Awaitable[Message]], Callable[[Message], Awaitable[None]]], Awaitable[None]]
Gate = Callable[[App], App]


def listening(port: int) -> socket.socket:
    """Return a socket that listens on loopback, on any free port for 0; raises UsageError if the port is taken."""
    try:
        return socket.create_server((HOST, port), backlog=64)
    except (OSError, OverflowError) as error:
        raise UsageError(
            f"port {port} cannot be used: {error}", "choose another by --port; 0 takes a free one"
        ) from error


def guarded_server(own: socket.socket, gate: Gate, label: str) -> viser.ViserServer:
    """Start viser on a socket that listens, behind a gate; raises Aug3dError if viser did not take both."""
    with _instead_of_an_open_port(own, gate) as taken, redirect_stdout(io.StringIO()):  # it greets
        server = viser.ViserServer(host=HOST, port=own.getsockname()[1], label=label, verbose=False)
    if not taken:
        stop(server)
        raise Aug3dError(
            f"viser {viser.__version__} does not listen as 1.1 does, so it would let everybody in",
            "install the version of constraints.txt",
        )
    # Its page can ask for a tunnel, by which strangers would reach it past loopback.
    for asked in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(asked)
    return server


def stop(server: viser.ViserServer) -> None:
    """End a server, without its good-bye among what programs read."""
    with redirect_stdout(io.StringIO()):
        server.stop()


@contextmanager
def _instead_of_an_open_port(own: socket.socket, gate: Gate) -> Iterator[list[bool]]:
    taken: list[bool] = []
    serve = sockets.serve

    def guarded(handler: Any, _host: str, _port: int, *, process_request: Any, **options: Any) -> Any:
        taken.append(True)
        return serve(handler, sock=own, process_request=_asking(gate, process_request), **options)

    sockets.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield taken
    finally:
        sockets.serve = serve  # type: ignore[misc]


def _asking(gate: Gate, page: Callable[[Any, Request], Response | None]) -> Callable[..., Awaitable[Response | None]]:
    """Return the function that answers a request; None lets a web socket through, and nothing else does."""

    async def answered(connection: Any, request: Request) -> Response | None:
        scope, sent = _scope(request), list[Message]()

        async def own(_scope: Message, _receive: object, send: Callable[[Message], Awaitable[None]]) -> None:
            if scope["type"] == "websocket":
                await send({"type": "websocket.accept"})
                return
            answer = page(connection, request)
            assert answer is not None  # it answers all but web sockets
            headers = [(name.lower().encode(), value.encode()) for name, value in answer.headers.raw_items()]
            headers.append((b"content-security-policy", _PAGE_MAY.encode()))
            await send({"type": "http.response.start", "status": answer.status_code, "headers": headers})
            await send({"type": "http.response.body", "body": bytes(answer.body or b"")})

        async def send(message: Message) -> None:
            sent.append(message)

        await gate(own)(scope, _nothing_more, send)
        if scope["type"] == "websocket":
            return None if [one["type"] for one in sent] == ["websocket.accept"] else _refusal(sent)
        return _response(sent)

    return answered


def _scope(request: Request) -> Message:
    headers = [(name.lower().encode("latin-1"), value.encode("latin-1")) for name, value in request.headers.raw_items()]
    upgrades = any(name == b"upgrade" and value.lower() == b"websocket" for name, value in headers)
    path, _, query = request.path.partition("?")
    return {
        "type": "websocket" if upgrades else "http",
        "method": "GET",  # the library refuses all others
        "scheme": "ws" if upgrades else "http",
        "path": path,
        "query_string": query.encode("latin-1"),
        "headers": headers,
        "server": (HOST, None),
    }


async def _nothing_more() -> Message:
    return {"type": "http.request", "body": b"", "more_body": False}


def _response(sent: list[Message]) -> Response:
    start, *parts = sent
    status = HTTPStatus(start["status"])
    body = b"".join(part.get("body", b"") for part in parts)
    headers = Headers([(name.decode("latin-1"), value.decode("latin-1")) for name, value in start["headers"]])
    if "content-length" not in headers:
        headers["content-length"] = str(len(body))
    return Response(status, status.phrase, headers, body)


def _refusal(sent: list[Message]) -> Response:
    why = str(sent[0].get("reason", "refused")).encode() if sent else b"refused"
    headers = Headers([("content-type", "text/plain"), ("content-length", str(len(why)))])
    return Response(HTTPStatus.FORBIDDEN, HTTPStatus.FORBIDDEN.phrase, headers, why)
