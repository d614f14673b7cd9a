"""Which code made a result."""

from __future__ import annotations

import subprocess
from functools import lru_cache
from pathlib import Path

from aug3d_core import __version__


@lru_cache
def code_version() -> str:
    """Return the git commit of this checkout, marked `-dirty` if it was changed, or the package's version outside of one."""
    folder = Path(__file__).parent
    try:
        described = subprocess.run(
            ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"],
            capture_output=True,
            text=True,
            timeout=10,
        )
    except (OSError, subprocess.TimeoutExpired):
        return __version__
    return described.stdout.strip() or __version__
