"""The folder that an export is written to."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.run.errors import UsageError


def check_empty(folder: Path) -> None:
    """Raise UsageError unless the folder is new or empty."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is not an empty folder", "name a new or empty folder")
