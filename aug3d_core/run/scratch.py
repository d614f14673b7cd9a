"""Folders that a stage needs only while it works, in its own output: on the disk that is watched, and named when it is full."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def scratch_folder(path: Path) -> Iterator[Path]:
    """Make an empty folder and delete it when the block ends.

    What a killed try has left of it goes first, so its name must be the same in every try: else that would be an output.
    """
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir()
    try:
        yield path
    finally:
        shutil.rmtree(path)
