"""Names that are safe as folders, experiment names and links."""

from __future__ import annotations

import re

from aug3d_core.run.errors import UsageError, shown

_SCENE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def check_scene_name(name: str) -> str:
    """Return the name if it can safely be a folder; raises UsageError."""
    if not _SCENE_NAME.fullmatch(name):
        raise UsageError(
            f"{shown(name)} is not a scene name",
            "use letters, digits, '-' and '_', at most 64, beginning with a letter or digit",
        )
    return name
