"""A full disk: told from other troubles, whichever library met it, and named with what is free."""

from __future__ import annotations

import errno
import os
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from aug3d_core.run.errors import DiskFull

NO_ROOM_BYTES = 8 * 2**20  # free space below which a failure that has no other name is the disk's
NO_ROOM_ERRORS = (errno.ENOSPC, errno.EDQUOT)  # also the exit codes of a stage that could not write why it ended
_MIB = 2**20
# What libraries say that keep only the words of the system's error; the last is SQLite's
_WORDS = (os.strerror(errno.ENOSPC), os.strerror(errno.EDQUOT), "database or disk is full")


def disk_full(error: BaseException) -> bool:
    """Say whether an error, or one that it came of, means that nothing more can be written."""
    return any(_means_it(one) for one in _came_of(error))


def says_disk_full(text: str) -> bool:
    """Say whether a text, such as the end of a log, tells of a full disk."""
    return any(words in text for words in _WORDS)


def free_bytes(path: Path) -> int:
    """Return what is free on the disk of a path, which need not exist yet."""
    there = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
    return shutil.disk_usage(there).free


def disk_remedy(folder: Path) -> str:
    """Return what to do about the full disk of a folder, with what is free there now."""
    return (
        f"free some space (now {free_bytes(folder) / _MIB:.0f} MiB free) or choose another disk with --home DIR, "
        "then run again: what is finished is kept"
    )


def disk_failure(folder: Path, said: str) -> DiskFull:
    """Return the typed error of a full disk. said: what could not be written, in the words of whoever tried."""
    return DiskFull(f"no space left on the disk of {folder.absolute()}: {said}", disk_remedy(folder))


def _came_of(error: BaseException | None) -> Iterator[BaseException]:
    seen: set[int] = set()
    waiting = [error]
    while waiting:
        one = waiting.pop()
        if one is None or id(one) in seen:
            continue
        seen.add(id(one))
        yield one
        waiting += [one.__cause__, one.__context__, *getattr(one, "exceptions", ())]


def _means_it(error: BaseException) -> bool:
    if isinstance(error, OSError) and error.errno in NO_ROOM_ERRORS:
        return True
    if isinstance(error, sqlite3.Error) and getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL:
        return True
    return says_disk_full(str(error))
