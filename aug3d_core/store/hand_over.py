"""Partial files of long work, in the shared store while it is made: whoever takes it over loses a shard at most."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket

PERIOD_S = 10.0


@contextmanager
def handing_over(bucket: Bucket, name: str, folder: Path, shards: Sequence[str]) -> Iterator[None]:
    """Bring what is there of a work folder that is not here; then share its shards again and again until the block ends.

    shards: patterns of files that are whole as soon as they have their name. After an error they stay for the next try.
    """
    top = f"{layout.WORK}/{name}/"
    if not folder.exists():
        _bring(bucket, top, folder)
    shared: set[tuple[str, int]] = set()
    done = threading.Event()

    def share() -> None:
        while not done.wait(PERIOD_S):
            with suppress(StoreError, OSError):  # the store is away, or a file went meanwhile: the next time
                _share(bucket, top, folder, shards, shared)

    sharing = threading.Thread(target=share, daemon=True)
    sharing.start()
    try:
        yield
    except BaseException:
        done.set()
        sharing.join()
        raise
    done.set()
    sharing.join()
    with suppress(StoreError):  # what is left is no more than in the way
        bucket.delete(bucket.names(top))


def _share(bucket: Bucket, top: str, folder: Path, shards: Sequence[str], shared: set[tuple[str, int]]) -> None:
    """Put what is new, the oldest first, as it was made: a file may say that the ones before it are there."""
    found = [(path.stat().st_mtime_ns, path) for pattern in shards for path in folder.glob(pattern)]
    names = {path.relative_to(folder).as_posix() for _, path in found}
    for mtime_ns, path in sorted(found):
        name = path.relative_to(folder).as_posix()
        if (name, mtime_ns) not in shared:
            bucket.put(f"{top}{name}", path)
            shared.add((name, mtime_ns))
    gone = {name for name, _ in shared} - names
    bucket.delete([f"{top}{name}" for name in gone])
    shared -= {each for each in shared if each[0] in gone}


def _bring(bucket: Bucket, top: str, folder: Path) -> None:
    names = [name for name in bucket.names(top) if ".." not in name.split("/")]
    if not names:
        return
    part = folder.with_name(f"{layout.GONE}{folder.name}-{os.getpid()}")
    shutil.rmtree(part, ignore_errors=True)
    for name in names:
        file = part / name.removeprefix(top)
        file.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # its owner lives, and took it away
            bucket.download(name, file)
    part.rename(folder)
