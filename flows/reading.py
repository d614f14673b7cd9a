"""What a command begins with that shows what is there: a home, and a version of a scene."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from aug3d_core.run.errors import UsageError
from aug3d_core.store import layout
from aug3d_core.store.scenes import newest_with, version_metrics
from aug3d_core.store.store import Store
from aug3d_core.store.version_name import find_version


def read_store(home: Path) -> Store:
    """Open the store of a home that is there; raises UsageError where there is none, and makes nothing.

    Where machines share a store a new home is made, for what the others made.
    """
    if not home.exists() and not os.environ.get(layout.SHARED_VARIABLE, "").strip():
        raise UsageError(
            f"there is no home folder {home}",
            "name the one that holds your scenes with --home DIR or AUG3D_HOME; aug3d demo and aug3d run make one",
        )
    return Store(home)


def version_with(store: Store, scene: str, *steps: str) -> dict[str, Any]:
    """Return the `metrics.json` of the version that is meant: of SCENE the newest that made these steps, else SCENE@VERSION.

    Where a later run ended before them, that is told on stderr.
    """
    if "@" in scene:
        return version_metrics(find_version(store, scene))
    metrics, note = newest_with(store, scene, *steps)
    if note:
        Console(stderr=True).print(f"[yellow]note[/] {escape(note)}", highlight=False, soft_wrap=True)
    return metrics
