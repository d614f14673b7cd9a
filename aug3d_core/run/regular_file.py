"""Open what a user named: regular files alone, of a stated size.

A pipe without a writer blocks whoever opens it, and a device need not end. Both can stand behind a link with the name of a
photograph. Errors are OSErrors, which the readers of files turn into their own words.
"""

from __future__ import annotations

import errno
import io
import json
import os
import stat
from pathlib import Path
from typing import Any

MOST_TEXT_BYTES = 512 * 2**20  # of poses, settings and clouds; 100,000 posed photographs take a tenth of it
_LONGEST_NUMBER = 300  # digits; more do not fit into a float


class IrregularFileError(OSError):
    """What has the name is a pipe, a socket or a device."""


def opened(path: Path) -> io.BufferedReader:
    """Open a regular file to read, without waiting; raises OSError, IrregularFileError among them."""
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        what = "a folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "a pipe, a socket or a device"
        os.close(handle)
        raise IrregularFileError(errno.EINVAL, f"it is no file but {what}", str(path))
    return os.fdopen(handle, "rb")


def content(path: Path, most_bytes: int | None = None) -> bytes:
    """Return what is in a regular file; raises OSError, also for one that is larger than it may be."""
    with opened(path) as file:
        if most_bytes is not None and os.fstat(file.fileno()).st_size > most_bytes:
            raise OSError(errno.EFBIG, f"it is larger than {most_bytes / 2**20:g} MiB", str(path))
        return file.read()


def json_content(path: Path) -> Any:
    """Return what a JSON file says; raises OSError, or ValueError for what is no JSON, is nested too deeply, or is no number.

    Integers that no float holds become infinite, as JSON's larger floats do: readers refuse both as not finite.
    """
    try:
        return json.loads(content(path, MOST_TEXT_BYTES), parse_int=_integer)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _integer(digits: str) -> float:
    return int(digits) if len(digits) <= _LONGEST_NUMBER else float(digits)
