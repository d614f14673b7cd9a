"""Where an export goes."""

from __future__ import annotations

from pathlib import Path

from aug3d_core.errors import UsageError


def check_empty(folder: Path) -> None:
    """Raise UsageError unless a folder is new or empty."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is not an empty folder", "name a new folder, so that nothing there is overwritten")
