"""What a file holds, as a short text."""

from __future__ import annotations

import hashlib
from pathlib import Path

from aug3d_core.run.regular_file import opened


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a regular file; raises OSError for anything else."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
