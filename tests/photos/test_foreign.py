"""A map beside the photographs is told from photographs that lost their EXIF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from math import nan

import pytest

from aug3d_core.photos.exif import Exif
from aug3d_core.photos.foreign import foreign_pictures

SILENT = Exif("unknown 320x240", nan, "none", nan, nan, nan, None, 1)
CAMERA = Exif("DJI FC300S 320x240", 300.0, "35mm", 46.0, -92.0, 200.0, datetime(2016, 6, 23), 1)
USUAL, OTHER = (1024, 576), (1865, 1085)


@dataclass(frozen=True)
class Picture:
    name: str
    exif: Exif
    original_size: tuple[int, int]


def pictures(*kinds: tuple[Exif, tuple[int, int]]) -> Sequence[Picture]:
    return [Picture(f"{i}.jpg", exif, size) for i, (exif, size) in enumerate(kinds)]


def test_a_picture_of_no_camera_and_of_a_size_of_its_own_is_foreign() -> None:
    found = foreign_pictures(pictures(*[(CAMERA, USUAL)] * 4, (SILENT, OTHER), (SILENT, (300, 200))))
    assert list(found) == ["4.jpg", "5.jpg"]
    assert "(1865x1085 px)" in found["4.jpg"]


@pytest.mark.parametrize(
    "kinds",
    [
        [(CAMERA, USUAL)] * 4 + [(SILENT, USUAL)],  # lost its EXIF
        [(CAMERA, USUAL)] * 4 + [(SILENT, OTHER)] * 2,  # frames of a video
        [(SILENT, USUAL)] * 4 + [(SILENT, OTHER)],  # a set without EXIF tells nothing
        [(CAMERA, USUAL)] * 4 + [(CAMERA, OTHER)],  # another camera
    ],
)
def test_photographs_are_not(kinds: list[tuple[Exif, tuple[int, int]]]) -> None:
    assert foreign_pictures(pictures(*kinds)) == {}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("camera", "Canon 320x240"),
        ("focal_source", "35mm"),
        ("lat_deg", 46.0),
        ("time", datetime(2016, 6, 23)),
    ],
)
def test_whatever_only_a_camera_knows_makes_it_a_photograph(field: str, value: object) -> None:
    told = Exif(**{**vars(SILENT), field: value})
    assert foreign_pictures(pictures(*[(CAMERA, USUAL)] * 4, (told, OTHER))) == {}
