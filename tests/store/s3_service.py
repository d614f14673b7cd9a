"""A real S3 service on a real socket, in a process of its own: moto's server."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

BUCKET = "photographs"
KEYS = {
    "AWS_ACCESS_KEY_ID": "tester",
    "AWS_SECRET_ACCESS_KEY": "a-secret-that-no-log-may-hold",
    "AWS_REGION": "us-east-1",
}
# The bucket is there before the port is open, as it is where a service comes back. A service sees whether a name is taken and
# puts in one step; moto's threads do not.
_SERVER = f"""
import sys, threading
from moto.core import DEFAULT_ACCOUNT_ID
from moto.s3.models import s3_backends
from moto.s3.responses import S3Response
from moto.server import main
one_step, put = threading.Lock(), S3Response.put_object
def put_object(self):
    with one_step:
        return put(self)
S3Response.put_object = put_object
s3_backends[DEFAULT_ACCOUNT_ID]["aws"].create_bucket("{BUCKET}", "us-east-1")
main(["-H", "127.0.0.1", "-p", sys.argv[1]])
"""


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@contextmanager
def s3_service(port: int | None = None, free_actions: int | None = None) -> Iterator[str]:
    """Run the service; yield its address. What it holds is gone with it.

    free_actions: how many requests need no rights; then it asks for them as IAM does.
    """
    port = port or free_port()
    command = [sys.executable, "-c", _SERVER, str(port)]
    limited = {} if free_actions is None else {"INITIAL_NO_AUTH_ACTION_COUNT": str(free_actions)}
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **limited}
    ) as server:
        try:
            _wait(port)
            yield f"http://127.0.0.1:{port}"
        finally:
            server.kill()


def _wait(port: int) -> None:
    for _ in range(600):
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=1):
                return
        except OSError:
            time.sleep(0.1)
    raise AssertionError("the S3 service does not start")
