"""Pictures that no camera took: the orthophoto, the map or the screenshot that lies beside the photographs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from aug3d_core.photos.exif import Exif


@runtime_checkable
class Seen(Protocol):
    """A picture whose header was read; original_size: width and height in px, as stored."""

    @property
    def name(self) -> str: ...

    @property
    def exif(self) -> Exif: ...

    @property
    def original_size(self) -> tuple[int, int]: ...


def foreign_pictures(pictures: Sequence[Seen]) -> dict[str, str]:
    """Return which pictures no camera took, by name, and why that is believed.

    Such a one says nothing of a camera where most of the others do, and no other has its size: frames of a video, and
    photographs that lost their EXIF, share theirs.
    """
    silent = [one for one in pictures if one.exif.silent]
    if 2 * len(silent) >= len(pictures):
        return {}
    count = Counter(one.original_size for one in pictures)
    return {one.name: _reason(*one.original_size) for one in silent if count[one.original_size] == 1}


def _reason(width: int, height: int) -> str:
    return f"no photograph: its EXIF names no camera, time or place, and no other has its size ({width}x{height} px); a map?"
