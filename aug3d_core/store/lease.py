"""The right of one machine, of many, to make a thing: a lease that is renewed, and lapses with its owner.

No clock of a machine or of the service counts. An owner writes a new number into its lease again and again; who waits sees,
by its own clock, that the number has stood still for too long, and takes the thing over by creating the next lease, which
one of many can. What two make all the same ends as one: the record is created once.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from aug3d_core.run.errors import StoreError
from aug3d_core.store.bucket import Bucket

RENEW_S = 15.0
LAPSED_S = 75.0  # without a new number
LOOK_S = 3.0


@contextmanager
def lease(bucket: Bucket, name: str, made: Callable[[], bool], waiting: Callable[[str], None]) -> Iterator[bool]:
    """Hold the lease of a name, and yield True; or yield False as soon as `made()` says that there is nothing to do.

    waiting: told who holds it. Raises StoreError as the bucket does.
    """
    owner = {"host": socket.gethostname(), "pid": os.getpid(), "nonce": secrets.token_hex(8)}
    mine = _acquire(bucket, f"leases/{name}", owner, made, waiting)
    if mine is None:
        yield False
        return
    done = threading.Event()
    renewing = threading.Thread(target=_renew, args=(bucket, mine, owner, done), daemon=True)
    renewing.start()
    try:
        yield not made()
    finally:
        done.set()
        renewing.join()
        with suppress(StoreError):  # it lapses
            bucket.delete([each for each in bucket.names(f"leases/{name}") if each <= mine])


def _acquire(
    bucket: Bucket, folder: str, owner: dict, made: Callable[[], bool], waiting: Callable[[str], None]
) -> str | None:
    seen, since = b"", time.monotonic()
    while True:
        held = bucket.names(folder)
        content = (bucket.get(held[-1]) or b"") if held else b""
        if content != seen:
            seen, since = content, time.monotonic()
        if not held or time.monotonic() - since > LAPSED_S:
            number = int(held[-1].rpartition("/")[2]) + 1 if held else 0
            mine = f"{folder}/{number:08d}"
            if bucket.create(mine, _told(owner, 0)):
                return mine
        elif made():
            return None
        else:
            waiting(_host(content))
        time.sleep(LOOK_S)


def _renew(bucket: Bucket, mine: str, owner: dict, done: threading.Event) -> None:
    number = 0
    while not done.wait(RENEW_S):
        number += 1
        with suppress(StoreError):  # the store is away: others cannot see the lease either
            bucket.put(mine, _told(owner, number))


def _told(owner: dict, number: int) -> bytes:
    return json.dumps({**owner, "number": number}).encode()


def _host(content: bytes) -> str:
    try:
        return str(json.loads(content)["host"])
    except (ValueError, KeyError, TypeError):
        return "another machine"
