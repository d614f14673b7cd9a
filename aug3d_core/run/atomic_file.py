"""Files that are whole even after a power cut."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def replacing(path: Path, part: Path) -> Iterator[BinaryIO]:
    """Open `part` to be written; it becomes `path` when the block ends without an error.

    After a kill or a power cut `path` is as before or whole: a rename may reach the disk before the bytes do, unless they are
    synced first.
    """
    try:
        with part.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)  # the disk may be full of it
        raise


def write_synced(path: Path, content: bytes) -> None:
    """Write a small file so that it is either old or new after a crash, never half."""
    with replacing(path, path.with_name(f".{path.name}.{os.getpid()}")) as file:
        file.write(content)
