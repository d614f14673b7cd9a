"""The right of one machine, of many, to make a thing: a lease that is renewed, and lapses with its owner.

No clock of a machine or of the service counts. An owner writes a new number into its lease again and again; who waits sees,
by its own clock, that the number has stood still for too long, and takes the thing over by creating the next lease, which
one of many can. What two make all the same ends as one: the record is created once.

A worker's lease on a run is watched by other workers: `Watch`. With it all falls free that the worker and its runs held.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from threading import Event

from aug3d_core.run.beside import beside
from aug3d_core.run.errors import StoreError
from aug3d_core.store.bucket import Bucket

RENEW_S = 15.0
LAPSED_S = 75.0  # without a new number
LOOK_S = 3.0
OWNER = (
    "AUG3D_LEASE_OWNER"  # in the environment of a worker and of the processes of its runs: whose leases fall together
)
_SEEN_S = 10.0  # a look tells of this time before it at most: who could not look cannot say that nothing moved
_FREE = b"{}"  # held by nobody


@contextmanager
def lease(
    bucket: Bucket,
    name: str,
    made: Callable[[], bool],
    waiting: Callable[[str], None],
    lost: Callable[[], None] | None = None,
) -> Iterator[bool]:
    """Hold the lease of a name, and yield True; or yield False as soon as `made()` says that there is nothing to do.

    waiting: told who holds it. lost: called, from a thread, when another has taken it over. Raises StoreError as the bucket
    does.
    """
    with _held(bucket, name, made, waiting, lost) as ours:
        yield ours and not made()


def claim(bucket: Bucket, name: str) -> AbstractContextManager[bool]:
    """Hold the lease of a name, and yield True; or yield False if another holds it. Raises StoreError as the bucket does."""
    return _held(bucket, name, lambda: True, lambda host: None, None)


@contextmanager
def _held(
    bucket: Bucket,
    name: str,
    give_up: Callable[[], bool],
    waiting: Callable[[str], None],
    lost: Callable[[], None] | None,
) -> Iterator[bool]:
    """Hold a lease, renewed, and yield True; or yield False where another holds it and there is no need to wait."""
    owner = _owner()
    mine = _acquire(bucket, f"leases/{name}", owner, give_up, waiting)
    if mine is None:
        yield False
        return
    try:
        with beside(lambda over: _renew(bucket, mine, owner, over, lost)):
            yield True
    finally:
        with suppress(StoreError):  # it lapses
            bucket.delete([each for each in bucket.names(f"leases/{name}/") if each <= mine])


class Watch:
    """Looks again and again at leases that others hold, and takes over those whose owners are dead."""

    def __init__(self, bucket: Bucket) -> None:
        """Begin to watch: an owner counts as alive at first."""
        self._bucket = bucket
        self._still: dict[str, _Stillness] = {}

    def dead(self, names: Iterable[str]) -> list[str]:
        """Return which of these names nobody holds, or holds no longer, as far as this watcher has seen for long enough."""
        self._still = {name: self._still.get(name, _Stillness()) for name in names}
        return [
            name for name, still in self._still.items() if still.look(_last(self._bucket, f"leases/{name}")) > LAPSED_S
        ]

    @contextmanager
    def taking_over(self, name: str) -> Iterator[bool]:
        """Hold what is dead, and yield True; or yield False if another watcher does, or did since the last look.

        In the end it is free, and so is all else that its owner held.
        """
        seen = self._still[name].seen
        mine = _next(f"leases/{name}", seen[0])
        if not self._bucket.create(mine, _told(_owner(), 0)):
            yield False
            return
        yield True
        self._bucket.put(mine, _FREE)
        self._still[name] = _Stillness()
        if whose := _said(seen[1], "owner"):
            self._free_all_of(whose)

    def _free_all_of(self, owner: str) -> None:
        last = {path.rpartition("/")[0]: path for path in self._bucket.names("leases/")}
        for path in last.values():
            if _said(self._bucket.get(path) or b"", "owner") == owner:
                self._bucket.put(path, _FREE)


class _Stillness:
    """For how long a lease has stood still, by this process's clock; time in which nobody looked is hardly counted."""

    def __init__(self) -> None:
        self.seen: tuple[str, bytes] = ("", b"")
        self._looked = time.monotonic()
        self._still_s = 0.0

    def look(self, found: tuple[str, bytes]) -> float:
        now = time.monotonic()
        self._still_s = self._still_s + min(now - self._looked, _SEEN_S) if found == self.seen else 0.0
        self.seen, self._looked = found, now
        return self._still_s


def _acquire(
    bucket: Bucket, folder: str, owner: dict, made: Callable[[], bool], waiting: Callable[[str], None]
) -> str | None:
    still = _Stillness()
    while True:
        held, content = found = _last(bucket, folder)
        if still.look(found) > LAPSED_S or not held or content == _FREE:
            mine = _next(folder, held)
            if bucket.create(mine, _told(owner, 0)):
                return mine
        elif made():
            return None
        else:
            waiting(_said(content, "host") or "another machine")
        time.sleep(LOOK_S)


def _last(bucket: Bucket, folder: str) -> tuple[str, bytes]:
    """Return the path and content of a name's last lease; empty ones if there is none."""
    held = bucket.names(f"{folder}/")
    return (held[-1], bucket.get(held[-1]) or b"") if held else ("", b"")


def _next(folder: str, last: str) -> str:
    return f"{folder}/{int(last.rpartition('/')[2]) + 1 if last else 0:08d}"


def _renew(bucket: Bucket, mine: str, owner: dict, done: Event, lost: Callable[[], None] | None) -> None:
    number = 0
    while not done.wait(RENEW_S):
        number += 1
        with suppress(StoreError):  # the store is away: others cannot see the lease either
            # Who took it over has a later number, or has ended by now and deleted this one
            if lost and bucket.names(f"{mine.rpartition('/')[0]}/")[-1:] != [mine]:
                lost()
                return
            bucket.put(mine, _told(owner, number))


def _owner() -> dict:
    nonce = secrets.token_hex(8)
    return {
        "host": socket.gethostname(), "pid": os.getpid(), "nonce": nonce, "owner": os.environ.get(OWNER) or nonce,
    }  # fmt: skip


def _told(owner: dict, number: int) -> bytes:
    return json.dumps({**owner, "number": number}).encode()


def _said(content: bytes, what: str) -> str:
    """Return what a lease says; empty if it says nothing of it."""
    try:
        return str(json.loads(content)[what])
    except (ValueError, KeyError, TypeError):
        return ""
