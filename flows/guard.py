"""The guard before a server of pages: an ASGI app that hands nothing on to another one without the secret.

A page of another site in the owner's browser can send requests to any address of this machine, and reach it under a name of
its own (DNS rebinding). So the guard looks at the Host, the Origin and what the browser says of the page that asks, then at the
secret, then at the kind of the body. The secret comes in a header, in the first message of a web socket (as Prefect's clients
send it), or in a cookie; a browser gets the cookie for `?token=SECRET` or by the sign-in page, as with Jupyter.
"""

from __future__ import annotations

import base64
import hmac
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape
from urllib.parse import parse_qs, parse_qsl, quote, urlencode

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection, Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

USER = "admin"
TOKEN = "token"  # what an address gives the secret by
SIGN_IN = "/aug3d/sign-in"
_YEAR_S = 365 * 24 * 3600
_LARGEST_FORM = 8192
_CHANGING = ("POST", "PATCH", "DELETE")  # no browser sends PUT for another site without asking first
_HEADERS = {
    "X-Frame-Options": "SAMEORIGIN",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>aug3d: sign in</title>
<style>body{{font:16px sans-serif;max-width:34em;margin:15vh auto;padding:0 1em}}
input,button{{font:inherit;padding:.4em}}</style>
<h1>aug3d</h1><p>{told}</p>
<form method="{method}" action="{action}"><input type="hidden" name="next" value="{next}">
<input type="password" name="token" autocomplete="current-password" aria-label="Password or token" autofocus required>
<button>Sign in</button></form>
<p>It is the password in AUG3D_PASSWORD; without one, the token in the address that <code>{printed}</code> printed.</p></html>
"""
_PAGE_MAY = "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; frame-ancestors 'none'"


@dataclass(frozen=True)
class Door:
    """What the guard asks for: the secret, and one of the names under which this server may be called.

    healthy: the path that answers everybody, who calls it by a right name; empty for none. posts: whether the server hears
    POST; else the sign-in page sends the secret as the printed address does. command: that printed the address.
    """

    secret: str = field(repr=False)
    names: frozenset[str]
    healthy: str
    posts: bool = True
    command: str = "aug3d up"

    @property
    def cookie(self) -> tuple[str, str]:
        """Name and value of the cookie. It tells nothing of the secret, and other homes on this machine have another."""
        name, value = (_digest(self.secret, what) for what in ("name", "value"))
        return f"aug3d-{name[:12]}", value

    def opened_by(self, told: str) -> bool:
        """Say whether this is the secret."""
        return _same(told, self.secret)


class Guard:
    """Stands before an ASGI app."""

    def __init__(self, app: ASGIApp, door: Door) -> None:
        self._app = app
        self._door = door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand on what may pass; answer the rest."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif why := self._foreign(HTTPConnection(scope)):
            await _refuse(403, why, scope, receive, send)
        elif scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        else:
            await self._request(Request(scope, receive), send)

    def _foreign(self, asked: HTTPConnection) -> str:
        """Return why a request is not from this server's own pages, nor from a program; empty if it is."""
        hosts, origins = asked.headers.getlist("host"), asked.headers.getlist("origin")
        if len(hosts) != 1 or _name(hosts[0]) not in self._door.names:
            return "this server is not called that (Host)"
        if any(origin not in (f"http://{hosts[0]}", f"https://{hosts[0]}") for origin in origins):
            return "a page of another origin asks (Origin)"
        navigates = (asked.headers.get("sec-fetch-mode"), asked.headers.get("sec-fetch-dest")) == (
            "navigate",
            "document",
        )
        if asked.headers.get("sec-fetch-site") in ("cross-site", "same-site") and not navigates:
            return "a page of another origin asks (Sec-Fetch-Site)"
        return ""

    async def _request(self, asked: Request, send: Send) -> None:
        path, method, told = asked.scope["path"], asked.method, asked.query_params.get(TOKEN)
        if path == SIGN_IN and method == "POST":
            answer = await self._sign_in(asked)
        elif path == self._door.healthy and method == "GET":
            answer = self._app
        elif told is not None and method == "GET" and self._door.opened_by(told):
            answer = self._welcome(_without_token(asked))
        elif not self._known(asked):
            answer = self._unknown(asked)
        elif method in _CHANGING and _has_body(asked) and not _is_json(asked):
            answer = JSONResponse({"message": "send Content-Type: application/json"}, 415)
        else:
            answer = self._app
        await answer(asked.scope, asked.receive, _with_headers(send))

    def _known(self, asked: HTTPConnection) -> bool:
        name, value = self._door.cookie
        if _same(asked.cookies.get(name, ""), value):
            return True
        kind, _, rest = asked.headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer":
            return self._told(rest.strip())
        if kind.lower() == "basic":
            try:
                return self._told(base64.b64decode(rest, validate=True).decode(), with_user=True)
            except ValueError:
                return False
        return False

    def _told(self, words: object, with_user: bool = False) -> bool:
        """Say whether words are the secret, or `admin:SECRET`, which Prefect's clients send in all places."""
        if not isinstance(words, str):
            return False
        user, colon, rest = words.partition(":")
        own = bool(colon) and _same(user, USER) and self._door.opened_by(rest)
        return own or (not with_user and self._door.opened_by(words))

    def _welcome(self, where: str) -> Response:
        answer = RedirectResponse(where, 303, {"Cache-Control": "no-store"})
        name, value = self._door.cookie
        answer.set_cookie(name, value, max_age=_YEAR_S, httponly=True, samesite="strict")
        return answer

    async def _sign_in(self, asked: Request) -> Response:
        body = b""
        async for part in asked.stream():
            body += part
            if len(body) > _LARGEST_FORM:
                return JSONResponse({"message": "that is no sign-in form"}, 413)
        form = parse_qs(body.decode(errors="replace"))
        where = _on_this_server(form.get("next", ["/"])[0])
        if self._door.opened_by(form.get(TOKEN, [""])[0]):
            return self._welcome(where)
        return self._sign_in_page(where, "That is not the password.")

    def _unknown(self, asked: Request) -> Response:
        """Ask a person to sign in, and tell a program that it must give the secret."""
        if asked.method == "GET" and "text/html" in asked.headers.get("accept", ""):
            return self._sign_in_page(_without_token(asked), "These pages are their owner's.")
        told = {
            "message": "this server asks for a password",
            "exception_message": "Unauthorized",
        }  # MLflow's word, Prefect's
        return JSONResponse(told, 401, {"WWW-Authenticate": "Bearer"})

    def _sign_in_page(self, where: str, told: str) -> Response:
        method, action = ("post", SIGN_IN) if self._door.posts else ("get", "/")
        page = _PAGE.format(
            told=told, method=method, action=action, next=escape(where, quote=True), printed=self._door.command
        )
        return HTMLResponse(page, 401, {"Cache-Control": "no-store", "Content-Security-Policy": _PAGE_MAY})

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self._known(HTTPConnection(scope)):
            await self._app(scope, receive, send)
        elif "prefect" in scope.get("subprotocols", ()):
            first = _FirstMessage(self._told, receive, send)
            await self._app(scope, first.receive, first.send)
        else:
            await _refuse(401, "no secret", scope, receive, send)


class _FirstMessage:
    """A web socket whose first message must tell the secret; until then nothing is handed on, either way."""

    def __init__(self, told: Callable[[object], bool], receive: Receive, send: Send) -> None:
        self._told = told
        self._receive = receive
        self._send = send
        self._known = False

    async def receive(self) -> Message:
        """Return the next message; that the other side has left, once its first one was wrong."""
        message = await self._receive()
        if message["type"] == "websocket.receive" and not self._known:
            self._known = self._told(_token_in(message))
            if not self._known:
                await self._send({"type": "websocket.close", "code": 1008, "reason": "not the secret"})
                return {"type": "websocket.disconnect", "code": 1008}
        return message

    async def send(self, message: Message) -> None:
        """Send what may be sent."""
        if self._known or message["type"] != "websocket.send":
            await self._send(message)


def _token_in(message: Message) -> object:
    try:
        return json.loads(message.get("text") or message.get("bytes") or "").get("token")
    except (ValueError, AttributeError, RecursionError):
        return None


async def _refuse(status: int, why: str, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": why})
    else:
        await JSONResponse({"message": why}, status)(scope, receive, _with_headers(send))


def _without_token(asked: Request) -> str:
    rest = urlencode([(name, value) for name, value in parse_qsl(asked.url.query, True) if name != TOKEN])
    return _on_this_server(quote(asked.scope["path"])) + (f"?{rest}" if rest else "")


def _on_this_server(address: str) -> str:
    """Return an address that cannot lead elsewhere: `//name` and `/\\name` are other servers to a browser."""
    return "/" + "".join(letter for letter in address if letter.isprintable()).lstrip("/\\ ")


def _has_body(asked: Request) -> bool:
    return asked.headers.get("content-length", "0") != "0" or "transfer-encoding" in asked.headers


def _is_json(asked: Request) -> bool:
    kinds = asked.headers.getlist("content-type")
    return len(kinds) == 1 and kinds[0].partition(";")[0].strip().lower() == "application/json"


def _with_headers(send: Send) -> Send:
    async def added(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return added


def _name(host: str) -> str:
    """Return the name in a Host header, without the port."""
    name, colon, port = host.lower().rpartition(":")
    return name if colon and port.isdecimal() and (":" not in name or name.endswith("]")) else host.lower()


def _same(one: str, other: str) -> bool:
    return hmac.compare_digest(one.encode(errors="replace"), other.encode(errors="replace"))


def _digest(secret: str, what: str) -> str:
    return hmac.new(secret.encode(), f"aug3d cookie {what}".encode(), "sha256").hexdigest()
