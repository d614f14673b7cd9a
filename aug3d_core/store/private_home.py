"""The home folder belongs to its owner alone: photographs, models, logs and tokens are in it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from aug3d_core.store import layout

_OURS = (
    layout.OBJECTS, layout.WORK, layout.LOCKS, layout.FAILURES, layout.SCENES, layout.COLLECTIONS, layout.BENCH,
    layout.STUDIES, layout.PREFECT, layout.SERVICES, layout.MLFLOW_ARTIFACTS, layout.MLFLOW_OUTBOX,
)  # fmt: skip


def make_private(home: Path) -> None:
    """Make the folder, closed to others; close one that is there if it holds nothing but what aug3d has put there.

    A folder that holds other things too, or is another user's, stays as it is. Raises OSError if it cannot be made.
    """
    if not home.exists():
        home.mkdir(mode=0o700, parents=True, exist_ok=True)
    with suppress(OSError):  # it cannot be changed: whether it can be used is told elsewhere
        found = home.stat()
        if found.st_uid == os.geteuid() and found.st_mode & 0o077 and all(map(_is_ours, home.iterdir())):
            home.chmod(0o700)


def _is_ours(path: Path) -> bool:
    return path.name in _OURS or path.name.startswith(layout.MLFLOW_DATABASE)
