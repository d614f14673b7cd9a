"""A server that asks for a secret, and does nothing else."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

SECRET = "correct horse battery"


class _Guarded(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        known = "Basic YWRtaW46Y29ycmVjdCBob3JzZSBiYXR0ZXJ5"  # admin:SECRET
        self.send_response(200 if self.headers.get("Authorization") == known else 401)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def guarded_server() -> Iterator[int]:
    """Run the server; yield its port."""
    with HTTPServer(("127.0.0.1", 0), _Guarded) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()
