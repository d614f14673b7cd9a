"""A full disk is told from other troubles, whichever library met it."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from aug3d_core.run.full_disk import disk_failure, disk_full, disk_of, free_bytes


def raised(error: BaseException, cause: BaseException) -> BaseException:
    try:
        raise error from cause
    except BaseException as caught:
        return caught


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "No space left on device"),
        OSError(errno.EDQUOT, "quota"),
        sqlite3.OperationalError("database or disk is full"),
        RuntimeError("write failed: No space left on device"),
        raised(ValueError("a wrapper"), OSError(errno.ENOSPC, "x")),
        ExceptionGroup("several", [ValueError("a"), OSError(errno.ENOSPC, "x")]),
    ],
)
def test_it_is_known_in_every_form(error: BaseException) -> None:
    assert disk_full(error)


@pytest.mark.parametrize("error", [OSError(errno.EACCES, "no"), ValueError("full"), sqlite3.OperationalError("locked")])
def test_other_troubles_are_others(error: BaseException) -> None:
    assert not disk_full(error)


def test_the_error_says_where_and_what_is_free(tmp_path: Path) -> None:
    error = disk_failure(tmp_path / "not" / "yet", "3 of 7 MiB written")
    assert str(tmp_path) in error.problem and "3 of 7 MiB" in error.problem
    assert f"now {free_bytes(tmp_path) / 2**20:.0f}"[:7] in error.remedy and "--home" in error.remedy


@pytest.mark.parametrize(
    ("files", "elsewhere"),
    [((), False), (("{home}/a",), False), (("{other}/a",), True), (("{home}/a", "{other}/b"), True),
     (("{other}/a", "{home}/b"), False), (("the render worker of 0000.npz",), False)],
)  # fmt: skip
def test_the_file_that_was_written_tells_which_disk_is_full(
    tmp_path: Path, small_disk: Callable[[int], Path], files: tuple[str, ...], elsewhere: bool
) -> None:
    other = small_disk(1)
    named = [file.format(home=tmp_path, other=other) for file in files]
    words: tuple[object, ...] = (errno.ENOSPC, os.strerror(errno.ENOSPC))
    if named:
        words = (*words, named[0], *(each for name in named[1:] for each in (None, name)))
    full, remedy = disk_of(f"a worker said: {OSError(*words)}", tmp_path)
    assert full == (other if elsewhere else tmp_path) and ("TMPDIR" in remedy) == elsewhere
