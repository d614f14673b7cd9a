"""Damage: bits rot on a disk while a file's size and time stay as they were, so only a digest tells."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from aug3d_core.run.errors import StoreError
from aug3d_core.store.record import FileEntry

THREADS = 2  # hash 2 GB/s, which few disks give
_BLOCK = 1 << 20
_SEEN: dict[tuple[int, ...], str] = {}  # digests of what this process has read, by the identity of the file


class DamagedError(StoreError):
    """Files of an object are not what was written. aside: where the object lies now, None if it had to stay."""

    def __init__(self, problem: str, remedy: str, aside: Path | None) -> None:
        super().__init__(problem, remedy)
        self.aside = aside


@dataclass(frozen=True)
class Fault:
    """What is wrong with a file of an object. name: relative to the folder of the files."""

    name: str
    what: str

    def __str__(self) -> str:
        return f"{self.name} {self.what}"


def sha256_of(path: Path, on_bytes: Callable[[int], None] = lambda count: None) -> str:
    """Return the SHA-256 of a file. It is read the first time in a process, and again once it was written to or replaced."""
    with path.open("rb", buffering=0) as file:
        stat = os.fstat(file.fileno())
        identity = (stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
        if identity not in _SEEN:
            digest, block = hashlib.sha256(), memoryview(bytearray(min(_BLOCK, stat.st_size + 1)))
            while count := file.readinto(block):
                digest.update(block[:count])
                on_bytes(count)
            _SEEN[identity] = digest.hexdigest()
        else:
            on_bytes(stat.st_size)
    return _SEEN[identity]


def faults(
    folder: Path, entries: Mapping[str, FileEntry], on_bytes: Callable[[int], None] = lambda count: None
) -> list[Fault]:
    """Return what is wrong with these files of an object, nothing if they are whole; `on_bytes` is called from threads.

    Raises StoreError where the disk does not let us tell.
    """

    def one(item: tuple[str, FileEntry]) -> Fault | None:
        name, entry = item
        what = fault(folder / name, entry, on_bytes)
        return Fault(name, what) if what else None

    if len(entries) < 2:
        found = map(one, entries.items())
        return [each for each in found if each]
    with ThreadPoolExecutor(THREADS) as pool:
        return [each for each in pool.map(one, entries.items()) if each]


def fault(path: Path, entry: FileEntry, on_bytes: Callable[[int], None] = lambda count: None) -> str:
    """Return what is wrong with a file, "" if it is whole; raises StoreError where the disk does not let us tell."""
    try:
        size_bytes = path.stat().st_size
        if size_bytes != entry.size_bytes:
            return f"has {size_bytes} bytes, not {entry.size_bytes}"
        return "" if sha256_of(path, on_bytes) == entry.sha256 else "holds other bytes than were written"
    except (FileNotFoundError, NotADirectoryError):
        return "is missing"
    except OSError as error:
        raise unreadable(path, error) from error


def unreadable(path: Path, error: OSError) -> StoreError:
    """Return the error of a file that the disk does not give."""
    return StoreError(
        f"{error.filename or path} cannot be read: {error.strerror}",
        "see that you may read it and that its disk is well, then try again",
    )


def listed(found: list[Fault]) -> str:
    """Name the first faults, and count the others."""
    more = f" (and {len(found) - 1} others)" if len(found) > 1 else ""
    return f"{found[0]}{more}"
