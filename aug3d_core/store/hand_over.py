"""Partial files of long work, in the shared store while it is made: whoever takes it over loses a shard at most.

Where machines that have nothing else to do help, their shards come here by the same road.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import Path
from threading import Event

from aug3d_core.run.beside import beside
from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket

# What is whole is shared at once, so that little is lost with its maker; a look costs this machine a list of a folder. A look
# for what others share costs a request.
PUT_S, TAKE_S = 1.0, 5.0


@contextmanager
def handing_over(
    bucket: Bucket, name: str, folder: Path, shards: Sequence[str], helped: bool = False
) -> Iterator[Callable[[], float]]:
    """Bring what is there of a work folder that is not here; then share its shards again and again until the block ends.

    shards: patterns of files that are whole as soon as they have their name, in the order in which they are written. helped:
    bring also, all the while, what others make (`helping`). Yields a function that returns what that cost them [processor s].
    After an error the shards stay for the next try.
    """
    exchange = _Exchange(bucket, name, folder, shards)
    exchange.begin()

    with _again_and_again(lambda: exchange.put(owner=True), exchange.take if helped else None):
        yield exchange.spent_by_others
    with suppress(StoreError):  # what is left is no more than in the way
        bucket.delete([*bucket.names(exchange.top), *bucket.names(exchange.costs)])


@contextmanager
def helping(bucket: Bucket, name: str, folder: Path, shards: Sequence[str]) -> Iterator[Callable[[float], None]]:
    """Take part in work that another machine hands over: bring what there is and will be, and share what is made here.

    Yields a function to tell what that cost [processor s].
    """
    exchange = _Exchange(bucket, name, folder, shards)
    exchange.begin()

    with _again_and_again(lambda: exchange.put(owner=False), exchange.take):
        yield exchange.tell_spent
    exchange.put(owner=False)


class _Exchange:
    """The shards of one object, between a work folder and the store."""

    def __init__(self, bucket: Bucket, name: str, folder: Path, shards: Sequence[str]) -> None:
        self.top, self.costs = f"{layout.WORK}/{name}/", f"{layout.WORK}/{name}.costs/"
        self._bucket, self._folder, self._shards = bucket, folder, shards
        self._put: set[tuple[str, int]] = set()  # name and time of each file that was put
        self._seen: set[str] = set()  # what was brought, or put: where it is gone since, it is gone for a reason

    def begin(self) -> None:
        """Bring all that is there, if nothing is here."""
        if self._folder.exists():
            return
        part = self._folder.with_name(f"{layout.GONE}{self._folder.name}-{os.getpid()}")
        shutil.rmtree(part, ignore_errors=True)
        names = []
        for name in self._names():
            (part / name).parent.mkdir(parents=True, exist_ok=True)
            if self._download(name, part / name):
                names.append(name)
        if names:
            part.rename(self._folder)
        for name in names:
            self._is_here(name)

    def put(self, *, owner: bool) -> None:
        """Put what is new, the oldest first, as it was made: a file may say that the ones before it are there.

        owner: what is gone here goes there too, also what others put.
        """
        found = [(path.stat().st_mtime_ns, path) for pattern in self._shards for path in self._folder.glob(pattern)]
        names = {path.relative_to(self._folder).as_posix() for _, path in found}
        for mtime_ns, path in sorted(found):
            name = path.relative_to(self._folder).as_posix()
            if (name, mtime_ns) not in self._put:
                self._bucket.put(f"{self.top}{name}", path)
                self._put.add((name, mtime_ns))
                self._seen.add(name)
        if owner:
            gone = {name for name, _ in self._put} - names
            self._bucket.delete([f"{self.top}{name}" for name in gone])
            self._put = {each for each in self._put if each[0] not in gone}

    def take(self) -> None:
        """Bring what is new there, in the order of the patterns; where its folder is not, or no more, it is not wanted."""
        new = [name for name in self._names() if name not in self._seen]
        with tempfile.TemporaryDirectory(dir=self._folder.parents[1], prefix=layout.GONE) as scratch:
            files = {name: Path(scratch) / str(number) for number, name in enumerate(new)}
            there = [name for name, file in files.items() if self._download(name, file)]
            for pattern in self._shards:
                for name in [each for each in there if fnmatchcase(each, pattern)]:
                    with suppress(FileNotFoundError, FileExistsError):
                        os.link(files[name], self._folder / name)
                        self._is_here(name)
                    self._seen.add(name)

    def spent_by_others(self) -> float:
        """Return what others say that their part has cost [processor s]."""
        told = (self._bucket.get(name) for name in self._bucket.names(self.costs))
        return sum(float(json.loads(one)) for one in told if one)

    def tell_spent(self, cpu_seconds: float) -> None:
        """Tell what a part has cost [processor s]."""
        self._bucket.put(f"{self.costs}{secrets.token_hex(8)}", json.dumps(cpu_seconds).encode())

    def _is_here(self, name: str) -> None:
        self._put.add((name, (self._folder / name).stat().st_mtime_ns))
        self._seen.add(name)

    def _names(self) -> list[str]:
        names = (name.removeprefix(self.top) for name in self._bucket.names(self.top))
        return [name for name in names if not {"", ".", ".."} & {*name.split("/")}]

    def _download(self, name: str, file: Path) -> bool:
        try:
            self._bucket.download(f"{self.top}{name}", file)
        except FileNotFoundError:  # its owner lives, and took it away
            file.unlink(missing_ok=True)
            return False
        return True


def _again_and_again(put: Callable[[], None], take: Callable[[], None] | None) -> AbstractContextManager[None]:
    """Put what is new here, and more seldom take what is new there, from a thread, while a block runs."""

    def work(over: Event) -> None:
        took_s = time.monotonic()
        while not over.wait(PUT_S):
            with suppress(StoreError, OSError):  # the store is away, or a file went meanwhile: the next time
                put()
                if take and time.monotonic() - took_s >= TAKE_S:
                    take()
                    took_s = time.monotonic()

    return beside(work)
