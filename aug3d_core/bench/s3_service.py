"""A real S3 service on a real socket, in a process of its own: moto's server."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.run.linux_process import die_with_parent

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
    """Return a port that nothing has now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@contextmanager
def s3_service(port: int | None = None, free_actions: int | None = None) -> Iterator[str]:
    """Run the service; yield its address. What it holds is gone with it.

    free_actions: how many requests need no rights; then it asks for them as IAM does. Raises UsageError without moto.
    """
    port = port or free_port()
    with s3_process(port, free_actions):
        yield address_of(port)


@contextmanager
def s3_process(port: int, free_actions: int | None = None) -> Iterator[subprocess.Popen]:
    """Run the service at a port, as `s3_service` does; yield its process."""
    if find_spec("moto") is None:
        raise UsageError(
            "moto, which serves as an S3 service, is not installed",
            "pip install -e .[dev], or for figures of the store alone set AUG3D_STORE=s3://BUCKET/PREFIX and its keys",
        )
    limited = {} if free_actions is None else {"INITIAL_NO_AUTH_ACTION_COUNT": str(free_actions)}
    with subprocess.Popen(
        [sys.executable, "-c", _SERVER, str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **limited},
        preexec_fn=partial(die_with_parent, parent=os.getpid()),
    ) as server:
        try:
            _wait(port)
            yield server
        finally:
            server.kill()


def address_of(port: int) -> str:
    """Return the address of the service at a port."""
    return f"http://127.0.0.1:{port}"


def _wait(port: int) -> None:
    for _ in range(600):
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=1):
                return
        except OSError:
            time.sleep(0.1)
    raise StoreError(f"moto's S3 service does not start at port {port}", "see that the port is free, and try again")
