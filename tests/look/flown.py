"""A flight over a flat ground of noise: pictures straight down, whose positions are known."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import ExifTags, Image

from aug3d_core.geometry.geodesy import geodetic_from_enu
from tests.photos.photo_files import degrees

SIZE_PX, FOCAL_35MM = (320, 240), 28.0
FOCAL_PX = FOCAL_35MM / np.hypot(36, 24) * np.hypot(*SIZE_PX)
HEIGHT_M, METRES = 60.0, 0.25  # of a pixel of the ground
WIDTH_M = HEIGHT_M * SIZE_PX[0] / FOCAL_PX
ORIGIN = np.array([47.0, 8.5, 400.0])


@dataclass(frozen=True)
class Shot:
    """A photograph before it is taken. yaw_deg: clockwise from north. told_m: by how much its GPS is wrong."""

    name: str
    east_m: float
    north_m: float
    yaw_deg: float = 0.0
    told_m: tuple[float, float] = (0.0, 0.0)
    time: datetime = datetime(2026, 5, 1, 12)


@cache
def ground() -> Image.Image:
    """Return the ground, north up, its middle at the origin."""
    rng, side = np.random.default_rng(0), 1400
    grey = np.zeros((side, side))
    for cells in (40, 160, 640):
        coarse = Image.fromarray(rng.integers(0, 256, (cells, cells), dtype=np.uint8))
        grey += np.asarray(coarse.resize((side, side), Image.Resampling.BICUBIC), float) / 3
    return Image.fromarray(grey.clip(0, 255).astype(np.uint8))


def lines(count: int = 4, each: int = 8, along: float = 0.7, across: float = 0.6, turning: bool = False) -> list[Shot]:
    """Fly lines to and fro; along, across: overlap. turning: the drone turns at their ends."""
    step_m, apart_m = (1 - along) * WIDTH_M * SIZE_PX[1] / SIZE_PX[0], (1 - across) * WIDTH_M
    shots = []
    for line in range(count):
        for i in range(each):
            at = i if line % 2 == 0 else each - 1 - i
            yaw = 180.0 if turning and line % 2 else 0.0
            place = (line - (count - 1) / 2) * apart_m, (at - (each - 1) / 2) * step_m
            time = Shot.time + timedelta(seconds=4 * len(shots))
            shots.append(Shot(f"shot_{len(shots):03d}.jpg", *place, yaw, time=time))
    return shots


def take(
    folder: Path,
    shots: list[Shot],
    gps: bool = True,
    xmp: Callable[[Shot], bytes] | None = None,
    changed: Callable[[Shot, Image.Image], Image.Image] = lambda shot, picture: picture,
) -> Path:
    """Write the photographs of a flight."""
    folder.mkdir(parents=True, exist_ok=True)
    for shot in shots:
        exif = Image.Exif()
        exif.update({ExifTags.Base.Model: "made up"})
        exif.get_ifd(ExifTags.IFD.Exif).update(
            {
                ExifTags.Base.FocalLengthIn35mmFilm: FOCAL_35MM,
                ExifTags.Base.DateTimeOriginal: f"{shot.time:%Y:%m:%d %H:%M:%S}",
            }
        )
        if gps:
            exif.get_ifd(ExifTags.IFD.GPSInfo).update(_position(shot))
        more: dict[str, Any] = {"xmp": xmp(shot)} if xmp else {}
        changed(shot, _picture(shot)).save(folder / shot.name, exif=exif, quality=92, **more)
    return folder


def _position(shot: Shot) -> dict[int, object]:
    enu_m = np.array([shot.east_m + shot.told_m[0], shot.north_m + shot.told_m[1], 0.0])
    lat, lon, alt = geodetic_from_enu(enu_m, ORIGIN)
    return {
        ExifTags.GPS.GPSLatitudeRef: "N",
        ExifTags.GPS.GPSLatitude: degrees(lat),
        ExifTags.GPS.GPSLongitudeRef: "E",
        ExifTags.GPS.GPSLongitude: degrees(lon),
        ExifTags.GPS.GPSAltitude: float(alt),
    }


def _picture(shot: Shot) -> Image.Image:
    yaw = np.radians(shot.yaw_deg)
    scale = HEIGHT_M / FOCAL_PX / METRES  # pixels of the ground in one of the picture
    right, up = np.array([np.cos(yaw), np.sin(yaw)]), np.array([np.sin(yaw), -np.cos(yaw)])  # on the ground's picture
    middle = np.array(ground().size) / 2 + np.array([shot.east_m, -shot.north_m]) / METRES
    corner = middle - scale * (right * SIZE_PX[0] / 2 - up * SIZE_PX[1] / 2)
    (ax, ay), (bx, by) = scale * right, -scale * up
    return ground().transform(
        SIZE_PX, Image.Transform.AFFINE, (ax, bx, corner[0], ay, by, corner[1]), Image.Resampling.BICUBIC
    )


def dji(shot: Shot) -> bytes:
    """Return the XMP of a DJI drone."""
    told = f'drone-dji:RelativeAltitude="+{HEIGHT_M:.2f}" drone-dji:GimbalYawDegree="{shot.yaw_deg:+.2f}"'
    return f'<x:xmpmeta><rdf:Description {told} drone-dji:GimbalPitchDegree="-90.00"/></x:xmpmeta>'.encode()


def pix4d(shot: Shot) -> bytes:
    """Return the XMP of a drone whose maker writes the names of Pix4D: its camera looks nearly straight down."""
    told = f'Camera:Yaw="{shot.yaw_deg:.1f}" Camera:Pitch="0.8"'
    return f'<x:xmpmeta><rdf:Description tiff:Make="senseFly" {told}/></x:xmpmeta>'.encode()


def without(shots: list[Shot], *lines_left_out: int, each: int = 8) -> Iterator[Shot]:
    """Yield the shots of the other lines."""
    yield from (shot for i, shot in enumerate(shots) if i // each not in lines_left_out)
