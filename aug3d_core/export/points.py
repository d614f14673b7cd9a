"""A scene's fused points -> `points.laz` for programs that read surveys, and `points.ply` for those that train splats.

The points are those that depth maps agree on: of all photographs but those held out for the test, as the mesh that judges the
model. The PLY keeps the scene's world, in which the cameras of the other exports stand. The LAZ lies in the UTM zone of the
scene where GPS told, else in the scene's own world, and then says nothing of the earth. Where GPS told no altitudes, heights
count from the world's zero. Both are written part by part, so that memory does not grow with the scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
from jaxtyping import Float
from laspy.vlrs.known import WktCoordinateSystemVlr

from aug3d_core.depth.files import BASELINE_FUSED
from aug3d_core.export.finished import altitude_told, required, world_of
from aug3d_core.export.target_folder import filling
from aug3d_core.export.utm import utm_from_world, zone_of
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.stored_points import StoredPoints
from aug3d_core.run.errors import StoreError
from aug3d_core.sfm.files import WORLD

LAZ, PLY = "points.laz", "points.ply"
READ = {"sfm": (WORLD,), "depth": (BASELINE_FUSED,)}  # stage -> files
_PART = 1_000_000  # points at a time
_FORMAT, _VERSION = 7, "1.4"  # of LAS: the smallest with colours that takes a reference system as text
_COARSEST = 1e-3  # unit of whole numbers in the LAZ; finer in a small scene
_DIGITS = 6  # of the scene's extent that they hold
_TO_16_BIT = 256  # LAS wants colours of 16 bit, made like this
_VERTEX = np.dtype([("xyz", "<f4", 3), ("normal", "<f4", 3), ("rgb", "u1", 3)])


@dataclass(frozen=True)
class PointsWritten:
    """What was written. crs: such as EPSG:32632, "" without positions. step: to which coordinates of the LAZ are rounded.

    heights_from_zero: nothing told altitudes, so that heights count from the world's zero.
    """

    points: int
    crs: str
    unit: str
    step: float
    heights_from_zero: bool = False


def export_points(sfm: Path, depth: Path, folder: Path) -> PointsWritten:
    """Write the points; raises UsageError if the folder is not empty, StoreError if files are missing or hold no points."""
    with filling(folder):
        (world, origin), fused = world_of(sfm), required(depth / BASELINE_FUSED)
        count, low, high = _extent(fused)
        step = min(_COARSEST, 10.0 ** (np.floor(np.log10(max(float((high - low).max()), _COARSEST))) - _DIGITS))
        folder.mkdir(parents=True, exist_ok=True)
        with (
            (folder / PLY).open("wb") as ply,
            laspy.open(
                folder / LAZ, "w", header=_header(low, origin, step), laz_backend=laspy.LazBackend.LazrsParallel
            ) as laz,
        ):
            ply.write(_ply_header(count))
            for part in StoredPoints.open(fused).parts(_PART):
                ply.write(_vertices(part).tobytes())
                laz.write_points(_records(part, laz.header, origin))
        crs = "" if origin is None else f"EPSG:{zone_of(origin).to_epsg()}"
        return PointsWritten(count, crs, world["unit"], step, not altitude_told(world))


def _extent(fused: Path) -> tuple[int, Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return how many points there are, and their lowest and highest coordinates in the world."""
    parts = [
        (len(part.xyz), part.xyz.min(axis=0), part.xyz.max(axis=0)) for part in StoredPoints.open(fused).parts(_PART)
    ]
    if not parts:
        raise StoreError("the scene has no fused points", "run it again with photographs that overlap more")
    counts, lows, highs = zip(*parts, strict=True)
    return sum(counts), np.min(lows, axis=0).astype(float), np.max(highs, axis=0).astype(float)


def _header(low: Float[np.ndarray, " 3"], origin: Float[np.ndarray, " 3"] | None, step: float) -> laspy.LasHeader:
    header = laspy.LasHeader(version=_VERSION, point_format=_FORMAT)
    header.generating_software = "aug3d"
    header.offsets, header.scales = np.floor(_placed(low[None], origin)[0]), np.full(3, step)
    header.global_encoding.wkt = True  # formats from 6 on know no other way to name a reference system
    if origin is not None:
        header.vlrs.append(WktCoordinateSystemVlr(zone_of(origin).to_wkt(version="WKT1_GDAL")))
    return header


def _placed(xyz: Float[np.ndarray, "n 3"], origin: Float[np.ndarray, " 3"] | None) -> Float[np.ndarray, "n 3"]:
    """Return where places of the world are in the LAZ."""
    return xyz.astype(float) if origin is None else utm_from_world(xyz.astype(float), origin)


def _records(
    part: Fused, header: laspy.LasHeader, origin: Float[np.ndarray, " 3"] | None
) -> laspy.ScaleAwarePointRecord:
    records = laspy.ScaleAwarePointRecord.zeros(len(part.xyz), header=header)
    records.x, records.y, records.z = _placed(part.xyz, origin).T
    records.red, records.green, records.blue = part.rgb.T.astype(np.uint16) * _TO_16_BIT
    records.return_number[:] = records.number_of_returns[:] = 1  # numbers begin at 1; readers complain of 0
    return records


def _vertices(part: Fused) -> np.ndarray:
    vertices = np.empty(len(part.xyz), _VERTEX)
    vertices["xyz"], vertices["normal"], vertices["rgb"] = part.xyz, part.normals, part.rgb
    return vertices


def _ply_header(points: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {points}"]
    lines += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii")
