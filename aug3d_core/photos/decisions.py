"""How many photographs are worth using."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from aug3d_core.photos.config import PhotosConfig
from aug3d_core.run.stage import Decision


def decisions(metrics: Mapping[str, Any], config: PhotosConfig) -> Iterator[Decision]:
    """Yield how many photographs are used, if redundant ones were to be left out."""
    if not config.least_motion:
        return
    kept, redundant = metrics["photos"], metrics["redundant"]
    yield Decision(
        field="photos.worth_using",
        value=f"{kept:.0f} of {kept + redundant:.0f}",
        measured=f"{redundant:.0f} show what the one before them shows",
        rule=f"those whose picture moves by {config.least_motion:.0%} of its width or more",
        saves=f"{redundant / (kept + redundant):.0%} of the photographs" if redundant else "",
    )
