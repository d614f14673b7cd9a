"""A full disk: told from other troubles, whichever library met it; whose disk it is, what is free there, what to do."""

from __future__ import annotations

import errno
import os
import re
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
# The words of an OSError that names files; the last is the one that was written
_NO_ROOM_FOR = re.compile(rf"\[Errno (?:{'|'.join(map(str, NO_ROOM_ERRORS))})\] .*'(/[^']*)'")


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


def no_room(path: Path) -> bool:
    """Say whether so little is free on the disk of a path that a failure which has no other name is the disk's."""
    try:
        return free_bytes(path) <= NO_ROOM_BYTES
    except OSError:  # what cannot be looked at has a trouble of its own
        return False


# Below: `said` is what could not be written, in the words of whoever tried.


def disk_failure(home: Path, said: str) -> DiskFull:
    """Return the typed error of the full disk of the home."""
    return DiskFull(f"no space left on the disk of {home.absolute()}: {said}", _home_remedy(home))


def target_full(target: Path, said: str) -> DiskFull:
    """Return the typed error of the full disk of a path beside the home."""
    return DiskFull(
        f"no space left on the disk of {target.absolute()}: {said}",
        f"free some space there ({_free(target)}) or name a folder on another disk, then run again",
    )


def disk_of(said: str, folder: Path) -> tuple[Path, str]:
    """Return a folder on the disk that is full, and what to do about it: `folder`, unless what was said names a file elsewhere.

    folder: in the home. The words may have come from another process.
    """
    named = _NO_ROOM_FOR.search(said)
    there = next(parent for parent in Path(named[1]).parents if parent.is_dir()) if named else folder
    if there.stat().st_dev == folder.stat().st_dev:
        return folder, _home_remedy(folder)
    return there, (
        f"free some space there ({_free(there)}) or, if it is for temporary files, set TMPDIR to a folder on another disk, "
        "then run again: what is finished is kept"
    )


def _home_remedy(folder: Path) -> str:
    return (
        f"free some space ({_free(folder)}) or choose another disk with --home DIR, "
        "then run again: what is finished is kept"
    )


def _free(path: Path) -> str:
    return f"now {free_bytes(path) / _MIB:.0f} MiB free"


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
