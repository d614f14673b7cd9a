"""Folders that are named by the time, so that names sort."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path


def timed_folder(parent: Path, prefix: str = "") -> Path:
    """Create a folder that nobody else has, named by a prefix and the time in UTC to the millisecond; return it."""
    parent.mkdir(parents=True, exist_ok=True)
    while True:
        folder = parent / (prefix + datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%S.%f")[:-3])
        try:
            folder.mkdir()
        except FileExistsError:  # somebody else's of the same millisecond
            time.sleep(1e-3)
        else:
            return folder
