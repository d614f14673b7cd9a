"""Photographs of a small scene whose truth is known: textured ground and flat roofs, cast ray by ray in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import cache, lru_cache
from itertools import product
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image
from PIL.TiffImagePlugin import IFDRational

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.transforms import apply, centres, invert, look_at
from tests.photos.photo_files import degrees

SIZE = (320, 240)
FOCAL_35MM = 30
FOCAL_PX = FOCAL_35MM / np.hypot(36, 24) * np.hypot(*SIZE)
ORIGIN = np.array([52.2, 21.0, 110.0])
STANDING = np.zeros(3)
_TEXELS_PER_M = 5
_HALF_M = 80


def poses(columns: int = 4, rows: int = 3, step_m: float = 12.0, seed: int = 0) -> np.ndarray:
    """Return cameras about 50 m above the ground in a lawn-mower flight, each tilted a little."""
    rng = np.random.default_rng(seed)
    found = []
    for row in range(rows):
        for column in range(columns)[:: 1 if row % 2 == 0 else -1]:
            at = np.array([(column - (columns - 1) / 2) * step_m, (row - (rows - 1) / 2) * step_m, 50.0])
            at += rng.normal(size=3) * 1.5
            found.append(look_at(at, at * [1, 1, 0] + np.append(rng.uniform(-10, 10, 2), 0)))
    return np.stack(found)


class LittleScene:
    """A ground and a dozen roofs."""

    def __init__(self, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        corners = rng.uniform(-45, 35, size=(12, 2))
        self.planes = [(0.0, np.array([-_HALF_M, -_HALF_M]), np.array([_HALF_M, _HALF_M]))]
        self.planes += [(rng.uniform(3, 12), low, low + rng.uniform(6, 14, 2)) for low in corners]
        self.textures = [_texture(rng) for _ in self.planes]

    def photograph(self, cam_from_world: np.ndarray, read_m: np.ndarray = STANDING) -> Image.Image:
        """Render one view, four rays to the pixel. read_m: how far the camera flies on from the first row to the last."""
        width, height = SIZE[0] * 2, SIZE[1] * 2
        v, u = np.mgrid[:height, :width] + 0.5
        rays = np.stack([(u - width / 2) / (2 * FOCAL_PX), (v - height / 2) / (2 * FOCAL_PX), np.ones_like(u)], axis=-1)
        rays = rays @ invert(cam_from_world)[:, :3].T
        centre = centres(cam_from_world) + read_m * ((np.arange(height) + 0.5) / height - 0.5)[:, None, None]
        nearest, grey = np.full(rays.shape[:2], np.inf), np.full(rays.shape[:2], 128.0)
        for (z, low, high), texture in zip(self.planes, self.textures, strict=True):
            # It looks to a camera that flies on as if it moved itself
            moved_m = np.abs(read_m) / 2
            there = _window(cam_from_world, np.append(low, z) - moved_m, np.append(high, z) + moved_m)
            depth = (z - centre[there[0], :, 2]) / rays[there][..., 2]
            xy = centre[there[0], :, :2] + depth[..., None] * rays[there][..., :2]
            hit = ((xy >= low) & (xy < high)).all(axis=-1) & (depth > 0) & (depth < nearest[there])
            texel = ((xy[hit] + _HALF_M) * _TEXELS_PER_M).astype(int) % len(texture)
            nearest[there][hit], grey[there][hit] = depth[hit], texture[texel[:, 1], texel[:, 0]]
        return Image.fromarray(grey.astype(np.uint8)).resize(SIZE, Image.Resampling.BOX).convert("RGB")


def _window(cam_from_world: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[slice, slice]:
    """Return the rows and columns of rays that may meet an upright box: all, where a corner is not before the camera."""
    corners = np.array([*product(*zip(low, high, strict=True))])
    x, y, z = apply(cam_from_world, corners).T
    if z.min() < 1:
        return np.s_[:], np.s_[:]
    u, v = 2 * FOCAL_PX * x / z + SIZE[0], 2 * FOCAL_PX * y / z + SIZE[1]
    return _span(v), _span(u)


def _span(at_px: np.ndarray) -> slice:
    return slice(max(int(at_px.min()) - 1, 0), max(int(at_px.max()) + 2, 0))


@cache
def little_scene(seed: int) -> LittleScene:
    return LittleScene(seed)


@lru_cache(maxsize=64)
def _photographed(seed: int, cam_from_world: bytes, read_m: bytes) -> Image.Image:
    """Return what `LittleScene.photograph` makes: flights that differ in what EXIF says show the same."""
    return little_scene(seed).photograph(np.frombuffer(cam_from_world).reshape(3, 4), np.frombuffer(read_m))


def write_flight(
    folder: Path,
    cam_from_world: np.ndarray,
    gps: bool = True,
    seed: int = 0,
    start: int = 0,
    noise_m: float = 0.0,
    focal_35mm: int | None = FOCAL_35MM,
    read_m: np.ndarray | None = None,
) -> Path:
    """Write the photographs of a flight as JPEGs with EXIF, of which `focal_35mm` may be a lie.

    read_m: how far each camera flies on while its rows are read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    positions = centres(cam_from_world) + rng.normal(size=(len(cam_from_world), 3)) * noise_m
    for i, (pose, place) in enumerate(zip(cam_from_world, geodetic_from_enu(positions, ORIGIN), strict=True), start):
        exif = _exif(i, place if gps else None, focal_35mm)
        read = STANDING if read_m is None else read_m[i - start]
        _photographed(seed, pose.tobytes(), read.tobytes()).save(folder / f"photo_{i}.jpg", quality=95, exif=exif)
    return folder


def _exif(number: int, place: Sequence[float] | np.ndarray | None, focal_35mm: int | None) -> Image.Exif:
    tag, exif = ExifTags.Base, Image.Exif()
    exif[tag.Make], exif[tag.Model] = "aug3d", "little scene"
    time = datetime(2024, 5, 1, 12, 0) + timedelta(seconds=2 * number)
    exif.get_ifd(ExifTags.IFD.Exif)[tag.DateTimeOriginal] = time.strftime("%Y:%m:%d %H:%M:%S")
    if focal_35mm is not None:
        exif.get_ifd(ExifTags.IFD.Exif)[tag.FocalLengthIn35mmFilm] = focal_35mm
    if place is not None:
        gps = ExifTags.GPS
        exif.get_ifd(ExifTags.IFD.GPSInfo).update(
            {
                gps.GPSLatitudeRef: "N",
                gps.GPSLatitude: degrees(place[0]),
                gps.GPSLongitudeRef: "E",
                gps.GPSLongitude: degrees(place[1]),
                gps.GPSAltitude: IFDRational(round(place[2] * 1000), 1000),
            }
        )
    return exif


def _texture(rng: np.random.Generator) -> np.ndarray:
    side = 2 * _HALF_M * _TEXELS_PER_M
    grey = np.zeros((side, side))
    for lump in (1, 2, 4, 8, 16):
        grain = rng.normal(size=(side // lump, side // lump)).repeat(lump, 0).repeat(lump, 1)
        grey += grain * lump**0.5
    return (128 + 9 * grey).clip(0, 255)
