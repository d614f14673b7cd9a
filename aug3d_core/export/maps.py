"""A scene's mesh seen from straight above -> an orthophoto and a surface model for geographic programs, and its cameras.

The mesh is the one that judges the model, of all photographs but those held out, since it covers the ground of the test too.

Both pictures are cloud-optimised GeoTIFF. With GPS or control points they lie in the UTM zone of the scene (WGS 84); without,
in the scene's own world and units, and say so by having no reference system. Heights are metres on the datum of the GPS
altitudes, or of the control points; where nothing told altitudes, they count from the world's zero.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import rasterio
import rasterio.shutil
from jaxtyping import Float, UInt8
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.errors import RasterioError
from rasterio.transform import Affine
from rasterio.windows import Window

from aug3d_core.export.finished import MESH_FILES, altitude_told, mesh_of, required, world_of
from aug3d_core.export.target_folder import filling
from aug3d_core.export.utm import utm_from_world, zone_of
from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import PHOTO_TABLE, read_photos
from aug3d_core.report.top_view import frame_of
from aug3d_core.run.errors import StoreError
from aug3d_core.run.full_disk import NO_ROOM_BYTES, free_bytes
from aug3d_core.sfm.files import VIEWS, WORLD

ORTHOPHOTO, SURFACE_MODEL = "orthophoto.tif", "surface_model.tif"
CAMERAS, CAMERAS_KML = "cameras.geojson", "cameras.kml"
READ = {  # stage -> what `export_map` reads of its output
    "sfm": (VIEWS, WORLD),
    "surface": MESH_FILES,
    "photos": (PHOTO_TABLE,),
}
_KML = "http://www.opengis.net/kml/2.2"
_STRIP_ROWS, _BLOCK_PX = 256, 512
_FEW_PX = 500  # across and down: enough for a median
NO_HEIGHT = -9999.0
_ABOVE = "above_ground_m"  # of a camera, where nothing told altitudes
_CONTROL = "control"  # in `world.json`, where control points tell the world
_FITTED = 9  # places along each side of the scene that fit the grid of the map to the world
_STEEP_DEG = 45.0  # below the horizon: from here on the upper edge of a picture tells its heading better than the look
_NET = (12, 9)  # rays across and down a picture that tell how far off it shows the mesh
_MOST_PIXELS = 4  # times those of all photographs together: overlap leaves a map far fewer, unless most of it is empty
_LARGEST_OFF = 0.25  # of a pixel: so far the fit may be off, or the scene is too large to count as flat

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class MapWritten:
    """What was written. crs: such as EPSG:32632, "" without positions. by_control: control points tell the world, and not GPS.

    pixel: its side, in `unit`. covered: share of the picture that shows ground. heights_from_zero: nothing told altitudes, so
    that heights count from the world's zero.
    """

    crs: str
    by_control: bool
    unit: str
    pixel: float
    width_px: int
    height_px: int
    covered: float
    cameras: int
    heights_from_zero: bool = False


@dataclass(frozen=True)
class Grid:
    """The pixels of a map. crs: None in the scene's own world.

    world_from_map: world x, y of map coordinates (easting, northing, 1).
    """

    crs: CRS | None
    pixels: Affine
    width: int
    height: int
    world_from_map: Float[np.ndarray, "2 3"]

    def world_xy(self, top: int, rows: int) -> Float[np.ndarray, "r w 2"]:
        """Return where the middles of the pixels of some rows lie in the world."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, top + np.arange(rows) + 0.5)
        east, north = self.pixels.a * x + self.pixels.c, self.pixels.e * y + self.pixels.f
        return np.stack([east, north, np.ones_like(east)], axis=-1) @ self.world_from_map.T


def export_map(
    sfm: Path, surface: Path, photos: Path, folder: Path, progress: Progress = lambda *_: None
) -> MapWritten:
    """Write the map of a scene.

    Raises UsageError if the folder is not empty, StoreError if files are missing, or the scene is too large for one map.
    """
    with filling(folder):
        views, (world, origin), mesh = Views.load(required(sfm / VIEWS)), world_of(sfm), mesh_of(surface)
        grid = grid_over(mesh, views, origin)
        folder.mkdir(parents=True, exist_ok=True)
        covered = _write(mesh, grid, origin, folder, progress)
        unplaced = origin is not None and not altitude_told(world)
        _write_cameras(views, photos, origin, _ground(folder / SURFACE_MODEL) if unplaced else None, folder)
        crs = f"EPSG:{grid.crs.to_epsg()}" if grid.crs else ""
        by_control = world.get("up_from") == _CONTROL
        size = grid.pixels.a, grid.width, grid.height
        return MapWritten(crs, by_control, world["unit"], *size, covered, len(views), not altitude_told(world))


def grid_over(mesh: TexturedMesh | Mesh, views: Views, origin: Float[np.ndarray, " 3"] | None) -> Grid:
    """Lay pixels over the mesh, as large as the photographs show it; coarser where they would be far more than theirs."""
    at = centres(views.cam_from_world)
    on_ground = np.asarray(mesh.xyz[:, :2], float)
    frame = frame_of(on_ground, at[:, :2], 1)
    ends = np.maximum(frame.low, on_ground.min(axis=0)), np.minimum(frame.high, on_ground.max(axis=0))
    finest = np.sqrt((ends[1] - ends[0]).prod() / (_MOST_PIXELS * views.size.prod(axis=1).sum()))
    pixel = _round(max(_pixel_shown(mesh, views), float(finest)))
    side = np.linspace(0, 1, _FITTED)
    places = np.stack(np.meshgrid(*(low + side * (high - low) for low, high in zip(*ends, strict=True))), -1)
    places = places.reshape(-1, 2)
    crs, mapped = None, places
    if origin is not None:
        crs, mapped = zone_of(origin), utm_from_world(np.column_stack([places, np.zeros(len(places))]), origin)[:, :2]
    middle = mapped.mean(axis=0)  # eastings of millions would cost the fit its digits
    ones = np.ones((len(places), 1))
    fit, *_ = np.linalg.lstsq(np.hstack([mapped - middle, ones]), places, rcond=None)
    if np.abs(np.hstack([mapped - middle, ones]) @ fit - places).max() > _LARGEST_OFF * pixel:
        raise StoreError("the scene is too large to be drawn as one flat map", "run it in parts, and export each")
    world_from_map = np.column_stack([fit[:2].T, fit[2] - fit[:2].T @ middle])
    left, bottom = np.floor(mapped.min(axis=0) / pixel) * pixel
    right, top = np.ceil(mapped.max(axis=0) / pixel) * pixel
    width, height = round((right - left) / pixel), round((top - bottom) / pixel)
    return Grid(crs, Affine(pixel, 0, left, 0, -pixel, top), width, height, world_from_map)


def _pixel_shown(mesh: TexturedMesh | Mesh, views: Views) -> float:
    """Return how large a pixel of the photographs is on the mesh, in units of the world: the median over views.

    Of a view it is told by the median depth along a net of rays, since a picture may show little ground but a wall.
    """
    caster, net = Raycaster(np.asarray(mesh.xyz, float), mesh.triangles), np.array(_NET)
    shown = []
    for pose, intrinsics, size in zip(views.cam_from_world, views.intrinsics, views.size, strict=True):
        depth = caster.view(pose, intrinsics * np.tile(net / size, 2), net).distance
        if (hit := np.isfinite(depth)).any():
            shown.append(float(np.median(depth[hit])) / intrinsics[0])
    if not shown:
        raise StoreError("no photograph shows any of the mesh", "run the scene again, then export it")
    return float(np.median(shown))


def _round(pixel: float) -> float:
    """Return a size with two digits, rounded up but for what rays lack in precision."""
    power = 10.0 ** (np.floor(np.log10(pixel)) - 1)
    return float(np.ceil(pixel / power - 1e-3) * power)


def _write(
    mesh: TexturedMesh | Mesh, grid: Grid, origin: Float[np.ndarray, " 3"] | None, folder: Path, progress: Progress
) -> float:
    """Write both pictures strip by strip, so that memory does not grow with the scene; return the share that shows ground."""
    usual = {
        "driver": "GTiff", "width": grid.width, "height": grid.height, "crs": grid.crs, "transform": grid.pixels,
        "tiled": True, "blockxsize": _STRIP_ROWS, "blockysize": _STRIP_ROWS, "compress": "deflate", "BIGTIFF": "IF_SAFER",
    }  # fmt: skip
    parts = [folder / f".{name}.part" for name in (ORTHOPHOTO, SURFACE_MODEL)]
    seen, sums = 0, [0, 0]
    with (
        rasterio.open(parts[0], "w", count=4, dtype="uint8", photometric="RGB", alpha="unspecified", **usual) as photo,
        rasterio.open(parts[1], "w", count=1, dtype="float32", nodata=NO_HEIGHT, **usual) as model,
    ):
        photo.colorinterp = (ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha)
        for top, rgba, heights in strips(mesh, grid, origin):
            bands = np.ascontiguousarray(np.moveaxis(rgba, -1, 0)), heights[None]
            for number, (picture, band) in enumerate(zip((photo, model), bands, strict=True)):
                picture.write(band, window=_rows(grid.width, top, len(rgba)))
                sums[number] = zlib.crc32(band.data, sums[number])
            seen += int((rgba[..., 3] > 0).sum())
            progress(top + len(rgba), grid.height)
    for part, name, resampling, wanted in zip(
        parts, (ORTHOPHOTO, SURFACE_MODEL), ("average", "nearest"), sums, strict=True
    ):
        _copy_whole(part, folder / name, resampling, wanted)
        part.unlink()
    return seen / (grid.width * grid.height)


def _copy_whole(part: Path, file: Path, resampling: str, wanted: int) -> None:
    """Copy a picture as a cloud-optimised GeoTIFF, which has its name only once all of it was read back.

    GDAL keeps silent where the disk is full as it closes a file. wanted: checksum of all bands, strip by strip. Raises OSError
    (ENOSPC) where there is no room for it.
    """
    copied = file.with_name(f".{file.name}.copied")
    try:
        rasterio.shutil.copy(
            part,
            copied,
            driver="COG",
            compress="deflate",
            blocksize=_BLOCK_PX,
            BIGTIFF="IF_SAFER",
            overview_resampling=resampling,
        )
        if _sum_of(copied) != wanted:
            raise RasterioError(f"{file} does not hold what was written to it")
    except Exception as error:
        # GDAL removes its overviews before it tells that they had no room, so that some may be free again
        if free_bytes(file.parent) <= max(part.stat().st_size, NO_ROOM_BYTES):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file)) from error
        raise
    copied.replace(file)


def _sum_of(file: Path) -> int:
    """Return the checksum of all bands of a picture, strip by strip; its overviews are read, too."""
    with rasterio.open(file) as picture:
        levels, total = len(picture.overviews(1)), 0
        for window in _strips_of(picture):
            total = zlib.crc32(picture.read(window=window), total)
    for level in range(levels):
        with rasterio.open(file, overview_level=level) as overview:
            for window in _strips_of(overview):
                overview.read(window=window)
    return total


def _strips_of(picture: rasterio.DatasetReader) -> Iterator[Window]:
    for top in range(0, picture.height, _STRIP_ROWS):
        yield _rows(picture.width, top, min(_STRIP_ROWS, picture.height - top))


def _rows(width: int, top: int, rows: int) -> Window:
    return Window(0, top, width, rows)  # pyright: ignore[reportCallIssue]


def strips(
    mesh: TexturedMesh | Mesh, grid: Grid, origin: Float[np.ndarray, " 3"] | None
) -> Iterator[tuple[int, UInt8[np.ndarray, "r w 4"], Float[np.ndarray, "r w"]]]:
    """Yield the first row, the colours and the heights of strips: what straight rays from above meet first."""
    caster = Raycaster(np.asarray(mesh.xyz, float), mesh.triangles)
    above = float(mesh.xyz[:, 2].max()) + 1.0
    for top in range(0, grid.height, _STRIP_ROWS):
        xy = grid.world_xy(top, min(_STRIP_ROWS, grid.height - top))
        from_above = np.concatenate([xy, np.full((*xy.shape[:2], 1), above)], axis=-1)
        hits = caster.cast(from_above, np.array([0.0, 0.0, -1.0]))
        hit = hits.triangle >= 0
        rgba = np.zeros((*hit.shape, 4), np.uint8)
        colours = mesh.colour_at(hits.triangle[hit], hits.weights[hit])
        rgba[hit, :3], rgba[hit, 3] = np.rint(colours).clip(0, 255).astype(np.uint8), 255
        heights = np.full(hit.shape, NO_HEIGHT, np.float32)
        places = np.column_stack([xy[hit], above - hits.distance[hit]])
        heights[hit] = places[:, 2] if origin is None else geodetic_from_enu(places, origin)[:, 2]
        yield top, rgba, heights


def _ground(surface_model: Path) -> float:
    """Return the median height of a surface model."""
    with rasterio.open(surface_model) as model:
        return float(np.ma.median(model.read(1, out_shape=(_FEW_PX, _FEW_PX), masked=True)))


def _write_cameras(
    views: Views, photos: Path, origin: Float[np.ndarray, " 3"] | None, ground: float | None, folder: Path
) -> None:
    """Write where each photograph was taken, as points; in the world's units where no GPS tells where that is.

    KML knows places on earth alone, so it is written with GPS only. ground: its height above the world's zero where
    nothing told altitudes; points then have none, but a height above it.
    """
    table = read_photos(photos)
    names = dict(zip(table["photo_id"], table["name"], strict=True))
    at = centres(views.cam_from_world)
    where = at if origin is None else geodetic_from_enu(at, origin)[:, [1, 0, 2]]
    aboves: list[dict[str, float]] = [{} for _ in at]
    if ground is not None:
        where, aboves = where[:, :2], [{_ABOVE: round(max(0.0, float(z) - ground), 2)} for z in where[:, 2]]
    looks, yaws_deg = views.cam_from_world[:, 2, :3], headings_deg(views.cam_from_world)
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [round(float(value), 8) for value in place]},
            "properties": {
                **above,
                "name": names[photo],
                "yaw_deg": round(float(yaw_deg), 2) % 360,
                "pitch_deg": round(float(np.degrees(np.arcsin(np.clip(look[2], -1, 1)))), 2),
            },
        }
        for photo, place, above, look, yaw_deg in zip(
            views.photo_id.tolist(), where, aboves, looks, yaws_deg, strict=True
        )
    ]
    (folder / CAMERAS).write_text(json.dumps({"type": "FeatureCollection", "features": features}, indent=1))
    if origin is not None:
        ElementTree.ElementTree(_kml(features)).write(folder / CAMERAS_KML, encoding="utf-8", xml_declaration=True)


def headings_deg(cam_from_world: Float[np.ndarray, "n 3 4"]) -> Float[np.ndarray, " n"]:
    """Return where cameras look, clockwise from north (+y): the upper edge of the picture where they look steeply down.

    Straight down the viewing direction has no heading but that of the gimbal's noise.
    """
    look, upper = cam_from_world[:, 2, :3], -cam_from_world[:, 1, :3]
    east, north = np.where(look[:, 2:] < -np.sin(np.radians(_STEEP_DEG)), upper, look)[:, :2].T
    return np.degrees(np.arctan2(east, north))


def _kml(features: Sequence[Mapping[str, Any]]) -> ElementTree.Element:
    """Return the cameras as KML: a pin for each, and what its photograph looks at on a double click."""
    kml = ElementTree.Element("kml", xmlns=_KML)
    document = ElementTree.SubElement(kml, "Document")
    for feature in features:
        (lon, lat, *alt), told = feature["geometry"]["coordinates"], feature["properties"]
        height, mode = (alt[0], "absolute") if alt else (told[_ABOVE], "relativeToGround")
        mark = ElementTree.SubElement(document, "Placemark")
        ElementTree.SubElement(mark, "name").text = told["name"]
        _add(mark, "Camera", longitude=lon, latitude=lat, altitude=height, heading=told["yaw_deg"],
             tilt=round(90 + told["pitch_deg"], 2), altitudeMode=mode)  # fmt: skip
        _add(mark, "Point", altitudeMode=mode, coordinates=f"{lon},{lat},{height}")
    return kml


def _add(parent: ElementTree.Element, name: str, **values: str | float) -> None:
    element = ElementTree.SubElement(parent, name)
    for key, value in values.items():
        ElementTree.SubElement(element, key).text = str(value)
