"""What is where on a map: places known by their coordinates on earth are found there, by colour and by height."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import rasterio
import rasterio.shutil
from PIL import Image
from rasterio.errors import RasterioError
from rasterio.warp import transform
from rasterio.windows import Window
from scipy.spatial.transform import Rotation

from aug3d_core.advice.choice import pose
from aug3d_core.export import maps
from aug3d_core.export.maps import (
    CAMERAS,
    CAMERAS_KML,
    ORTHOPHOTO,
    SURFACE_MODEL,
    MapWritten,
    export_map,
    grid_over,
    headings_deg,
)
from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import DiskFull, StoreError, UsageError

ORIGIN = {"lat_deg": 46.9, "lon_deg": 7.5, "alt_m": 538.0}
HALF_M, ROOF_M, HIGH_M = 40.0, 12.0, 100.0
FLAG = np.array([(-30.0, -30.0), (-30.0, 30.0), (30.0, -30.0), (30.0, 30.0)])  # places in the middle of a quarter
COLOURS = np.array([(200, 30, 30), (30, 200, 30), (30, 30, 200), (200, 200, 30)], np.uint8)


def squares(*of: tuple[float, float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return level squares (x, y, half a side, height)."""
    xyz = np.concatenate(
        [[(x - h, y - h, z), (x + h, y - h, z), (x + h, y + h, z), (x - h, y + h, z)] for x, y, h, z in of]
    )
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * i for i in range(len(of))])
    return xyz, triangles


@pytest.fixture
def scene(tmp_path: Path) -> tuple[Path, Path, Path]:
    return write_scene(tmp_path)


def write_scene(where: Path) -> tuple[Path, Path, Path]:
    """Write a scene of a square of four colours with a roof in its middle, and four cameras above it."""
    sfm, surface, photos = (where / name for name in ("sfm", "surface", "photos"))
    for folder in (sfm, surface, photos):
        folder.mkdir(parents=True)
    at = np.array([(-20.0, -20, HIGH_M), (20, -20, HIGH_M), (20, 20, HIGH_M), (-20, 20, HIGH_M)])
    poses = np.stack([look_at(eye, eye * [1, 1, 0] + [0, 0.01, 0]) for eye in at])
    Views(np.arange(4), poses, np.tile([500.0, 500, 320, 240], (4, 1)), np.tile([640, 480], (4, 1))).save(
        sfm / "views.npz"
    )
    world(sfm, ORIGIN)
    xyz, triangles = squares((0, 0, HALF_M, 0), (0, 0, 10, ROOF_M))
    picture = np.zeros((400, 400, 3), np.uint8)
    picture[200:, :200], picture[:200, :200], picture[200:, 200:], picture[:200, 200:] = COLOURS
    uv = (xyz[:, :2] + HALF_M) / (2 * HALF_M)
    Mesh(xyz.astype(np.float32), np.zeros((8, 3), np.uint8), triangles).save(surface / "baseline_mesh.ply")
    TexturedMesh(xyz, triangles, uv[triangles], picture).save(
        surface / "baseline_mesh_textured.npz", surface / "baseline_mesh_texture.png"
    )
    pd.DataFrame({"photo_id": range(4), "name": [f"{i}.jpg" for i in range(4)]}).to_parquet(photos / "photos.parquet")
    return sfm, surface, photos


def world(sfm: Path, origin: dict | None) -> None:
    unit = "m" if origin else "unit"
    (sfm / "world.json").write_text(json.dumps({"metric": bool(origin), "unit": unit, "origin": origin}))


def written(scene: tuple[Path, Path, Path], folder: Path) -> MapWritten:
    return export_map(*scene, folder)


def on_earth(places: np.ndarray, origin: dict) -> tuple[np.ndarray, ...]:
    """Return longitude, latitude and altitude."""
    lat, lon, alt = geodetic_from_enu(places, np.array([*origin.values()])).T
    return lon, lat, alt


@pytest.mark.parametrize(
    "origin", [ORIGIN, {"lat_deg": -33.9, "lon_deg": 151.2, "alt_m": 20.0}], ids=["north", "south"]
)
def test_places_on_earth_have_their_colour_and_height(
    scene: tuple[Path, Path, Path], tmp_path: Path, origin: dict
) -> None:
    world(scene[0], origin)
    told = written(scene, tmp_path / "map")
    zone = 32 if origin is ORIGIN else 56
    assert told.crs == f"EPSG:{32600 + zone if origin['lat_deg'] > 0 else 32700 + zone}" and told.unit == "m"
    assert told.pixel == pytest.approx(HIGH_M / 500, rel=0.1) and told.covered > 0.9
    lon, lat, _ = on_earth(np.column_stack([FLAG, np.zeros(4)]), origin)
    with (
        rasterio.open(tmp_path / "map" / ORTHOPHOTO) as photo,
        rasterio.open(tmp_path / "map" / SURFACE_MODEL) as model,
    ):
        east, north = transform("EPSG:4326", photo.crs, lon, lat)[:2]
        found = np.array([*photo.sample(zip(east, north, strict=True))])
        assert (found[:, :3] == COLOURS).all() and (found[:, 3] == 255).all()
        ground = np.array([*model.sample(zip(east, north, strict=True))])[:, 0]
        assert ground == pytest.approx(origin["alt_m"], abs=0.01)
        assert photo.overviews(1) == [] or photo.overviews(1)[0] == 2
        assert photo.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"


def test_edges_lie_within_half_a_pixel(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    told = written(scene, tmp_path / "map")
    with rasterio.open(tmp_path / "map" / SURFACE_MODEL) as model:
        heights = model.read(1)
        row, column = np.nonzero(heights > ORIGIN["alt_m"] + ROOF_M / 2)
        east, north = map(np.asarray, model.xy(row, column))
        lon, lat = transform(model.crs, "EPSG:4326", [east.mean()], [north.mean()])[:2]
        true_lon, true_lat, _ = on_earth(np.array([[0.0, 0.0, 0.0]]), ORIGIN)
        off_m = np.array([(lon[0] - true_lon[0]) * np.cos(np.radians(46.9)), lat[0] - true_lat[0]]) * 111_320
        assert np.abs(off_m).max() < told.pixel / 2
        assert len(row) * told.pixel**2 == pytest.approx(400, rel=0.02), "a roof of 20 x 20 m"
        assert heights.max() == pytest.approx(ORIGIN["alt_m"] + ROOF_M, abs=0.01)


def test_cameras_are_points_on_earth(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    written(scene, tmp_path / "map")
    features = json.loads((tmp_path / "map" / CAMERAS).read_text())["features"]
    lon, lat, alt = on_earth(np.array([[-20.0, -20.0, HIGH_M]]), ORIGIN)
    assert features[0]["geometry"]["coordinates"] == pytest.approx([lon[0], lat[0], alt[0]], abs=1e-6)
    assert [one["properties"]["name"] for one in features] == ["0.jpg", "1.jpg", "2.jpg", "3.jpg"]
    assert all(one["properties"]["pitch_deg"] == pytest.approx(-90, abs=0.1) for one in features)
    assert all(one["properties"]["yaw_deg"] == pytest.approx(0, abs=0.1) for one in features)


@pytest.mark.parametrize("down_deg", [90.0, 80.0, 50.0, 44.0, 10.0])
@pytest.mark.parametrize("yaw_deg", [0.0, 40.0, -160.0])
def test_noise_of_the_gimbal_turns_no_heading(down_deg: float, yaw_deg: float) -> None:
    rng = np.random.default_rng(0)
    poses = np.stack([pose(np.zeros(3), yaw_deg, -down_deg) for _ in range(20)])
    noise = Rotation.from_rotvec(rng.uniform(-0.5, 0.5, (20, 3)), degrees=True).as_matrix()
    off_deg = headings_deg(noise @ poses) - yaw_deg
    assert np.abs((off_deg + 180) % 360 - 180).max() < 2


@pytest.mark.parametrize("up_from", ["gps", "control"])
def test_what_tells_the_world_is_told_by_name(scene: tuple[Path, Path, Path], tmp_path: Path, up_from: str) -> None:
    told = json.loads((scene[0] / "world.json").read_text())
    (scene[0] / "world.json").write_text(json.dumps(told | {"up_from": up_from}))
    assert written(scene, tmp_path / "map").by_control == (up_from == "control")


def test_a_map_may_be_larger_than_a_plain_tiff(
    scene: tuple[Path, Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, copy = list[dict](), rasterio.shutil.copy

    def copied(*files: Path, **options: object) -> None:
        asked.append(options)
        copy(*files, **options)

    monkeypatch.setattr(rasterio.shutil, "copy", copied)
    written(scene, tmp_path / "map")
    assert [one["BIGTIFF"] for one in asked] == ["IF_SAFER"] * 2


def lost_at_the_end(part: Path, copied: Path) -> None:
    os.truncate(copied, copied.stat().st_size * 9 // 10)


def lost_in_the_middle(part: Path, copied: Path) -> None:
    size = copied.stat().st_size
    with copied.open("r+b") as file:
        file.seek(size // 2)
        file.write(bytes(size // 4))


def lost_before_it_was_copied(part: Path, copied: Path) -> None:
    with rasterio.open(part, "r+") as picture:
        picture.write(np.zeros((1, 40, 40), picture.dtypes[0]), [1], window=Window(60, 60, 40, 40))  # type: ignore[call-arg]
    copied.unlink()
    rasterio.shutil.copy(part, copied, driver="COG", compress="deflate")


@pytest.mark.parametrize("full", [True, False])
@pytest.mark.parametrize("lost", [lost_at_the_end, lost_in_the_middle, lost_before_it_was_copied])
@pytest.mark.parametrize("name", [ORTHOPHOTO, SURFACE_MODEL])
def test_a_picture_that_gdal_lost_some_of_in_silence_is_not_called_written(
    name: str,
    lost: Callable[[Path, Path], None],
    full: bool,
    scene: tuple[Path, Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    copy = rasterio.shutil.copy

    def losing(part: Path, copied: Path, **options: object) -> None:
        copy(part, copied, **options)
        if name in part.name:
            monkeypatch.setattr(rasterio.shutil, "copy", copy)
            lost(part, copied)

    monkeypatch.setattr(rasterio.shutil, "copy", losing)
    monkeypatch.setattr(maps, "free_bytes", lambda _: 0 if full else 2**40)
    with pytest.raises(DiskFull if full else RasterioError) as told:
        written(scene, tmp_path / "map")
    assert not (tmp_path / "map").exists()
    assert not full or f"{tmp_path / 'map' / name}'" in str(told.value)


def test_an_error_of_gdal_is_the_full_disks_where_the_copy_had_no_room(
    scene: tuple[Path, Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(part: Path, *_: object, **__: object) -> None:
        size = part.stat().st_size
        monkeypatch.setattr(maps, "free_bytes", lambda _: size)  # once it has removed its overviews
        monkeypatch.setattr(maps, "NO_ROOM_BYTES", 0)
        raise SystemError("Unknown GDAL Error")

    monkeypatch.setattr(rasterio.shutil, "copy", refused)
    with pytest.raises(DiskFull, match="No space left"):
        written(scene, tmp_path / "map")


def test_without_gps_the_map_is_in_the_scenes_own_world(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    world(scene[0], None)
    told = written(scene, tmp_path / "map")
    assert (told.crs, told.unit) == ("", "unit")
    with rasterio.open(tmp_path / "map" / ORTHOPHOTO) as photo:
        assert photo.crs is None
        assert (np.array([*photo.sample(FLAG)])[:, :3] == COLOURS).all()


def test_a_mesh_without_texture_has_its_own_colours(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    (scene[1] / "baseline_mesh_textured.npz").unlink()
    xyz, triangles = squares((0, 0, HALF_M, 0))
    Mesh(xyz.astype(np.float32), np.full((4, 3), (9, 80, 7), np.uint8), triangles).save(scene[1] / "baseline_mesh.ply")
    written(scene, tmp_path / "map")
    picture = np.asarray(Image.open(tmp_path / "map" / ORTHOPHOTO))  # another program
    assert (picture[picture[..., 3] > 0][:, :3] == (9, 80, 7)).all()


def test_what_no_ray_meets_is_left_empty(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    (scene[1] / "baseline_mesh_textured.npz").unlink()
    xyz, triangles = squares((-25, 0, 10, 0), (25, 0, 10, 3))
    Mesh(xyz.astype(np.float32), np.zeros((8, 3), np.uint8), triangles).save(scene[1] / "baseline_mesh.ply")
    told = written(scene, tmp_path / "map")
    assert told.covered == pytest.approx(800 / (70 * 20), rel=0.1)
    with rasterio.open(tmp_path / "map" / SURFACE_MODEL) as model:
        heights = model.read(1, masked=True)
        assert heights.mask.mean() == pytest.approx(1 - told.covered, abs=1e-6)


def test_nothing_is_overwritten_and_what_is_missing_is_named(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    (tmp_path / "map").mkdir()
    (tmp_path / "map" / "mine.txt").write_text("mine")
    with pytest.raises(UsageError, match="not an empty folder"):
        written(scene, tmp_path / "map")
    (scene[1] / "baseline_mesh.ply").unlink()
    with pytest.raises(StoreError, match=r"baseline_mesh.ply is missing"):
        written(scene, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_scene_too_large_for_a_flat_map_is_refused(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    (scene[1] / "baseline_mesh_textured.npz").unlink()
    views = Views.load(scene[0] / "views.npz")
    far = views.cam_from_world.copy()
    far[2, :, 3] -= far[2, :, :3] @ [400_000.0, 0, 0]
    Views(views.photo_id, far, views.intrinsics, views.size).save(scene[0] / "views.npz")
    xyz, triangles = squares((0, 0, 200_000.0, 0))
    Mesh(xyz.astype(np.float32), np.zeros((4, 3), np.uint8), triangles).save(scene[1] / "baseline_mesh.ply")
    with pytest.raises(StoreError, match="too large"):
        written(scene, tmp_path / "map")


def test_cameras_are_pins_in_kml_where_gps_told(scene: tuple[Path, Path, Path], tmp_path: Path) -> None:
    written(scene, tmp_path / "map")
    marks = ElementTree.parse(tmp_path / "map" / CAMERAS_KML).findall(".//{*}Placemark")
    assert [mark.findtext("{*}name") for mark in marks] == ["0.jpg", "1.jpg", "2.jpg", "3.jpg"]
    found = [float(one) for one in marks[1].findtext("{*}Point/{*}coordinates", "").split(",")]
    assert found == pytest.approx(np.ravel(on_earth(np.array([[20.0, -20.0, HIGH_M]]), ORIGIN)), abs=1e-6)
    assert marks[0].findtext("{*}Point/{*}altitudeMode") == "absolute"
    assert float(marks[0].findtext("{*}Camera/{*}tilt", "")) == pytest.approx(0, abs=0.1), "straight down"
    world(scene[0], None)
    written(scene, tmp_path / "nowhere")
    assert not (tmp_path / "nowhere" / CAMERAS_KML).exists()


def test_where_gps_told_no_altitudes_no_height_is_said_to_be_one(
    scene: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    assert not written(scene, tmp_path / "told").heights_from_zero
    world(scene[0], ORIGIN | {"alt_m": None})
    raised = Views.load(scene[0] / "views.npz")
    raised.cam_from_world[0, :, 3] = -raised.cam_from_world[0, :, :3] @ [-20.0, -20.0, -5.0]
    raised.save(scene[0] / "views.npz")  # below the ground, as poses may be
    told = written(scene, tmp_path / "map")
    assert told.heights_from_zero and told.crs == "EPSG:32632"
    lon, lat, _ = on_earth(np.array([[20.0, -20.0, HIGH_M]]), ORIGIN | {"alt_m": 0.0})
    features = json.loads((tmp_path / "map" / CAMERAS).read_text())["features"]
    assert features[1]["geometry"]["coordinates"] == pytest.approx([lon[0], lat[0]], abs=1e-7), "without altitude"
    for mark, height in zip(
        ElementTree.parse(tmp_path / "map" / CAMERAS_KML).findall(".//{*}Placemark"), (0, *[HIGH_M] * 3), strict=True
    ):
        for place in (mark.find("{*}Point"), mark.find("{*}Camera")):
            assert place is not None and place.findtext("{*}altitudeMode") == "relativeToGround"
        assert float(mark.findtext("{*}Camera/{*}altitude", "")) == pytest.approx(height, abs=0.1)
        assert float(mark.findtext("{*}Point/{*}coordinates", "").split(",")[2]) == pytest.approx(height, abs=0.1)
    with rasterio.open(tmp_path / "map" / SURFACE_MODEL) as model:
        assert model.read(1, masked=True).max() == pytest.approx(ROOF_M, abs=0.01), "above the world's zero"


def flat(half: float, height: float = 0.0) -> Mesh:
    xyz, triangles = squares((0, 0, half, height))
    return Mesh(xyz.astype(np.float32), np.zeros((4, 3), np.uint8), triangles)


def looking(eyes: np.ndarray, targets: np.ndarray) -> Views:
    """Return cameras of 3000 px focal length."""
    poses = np.stack([look_at(eye, target) for eye, target in zip(eyes, targets, strict=True)])
    count = len(eyes)
    return Views(
        np.arange(count), poses, np.tile([3000.0, 3000, 2000, 1500], (count, 1)), np.tile([4000, 3000], (count, 1))
    )


@pytest.mark.parametrize("high", [17.0, 90.0, 111.0, 433.0])
def test_straight_down_a_pixel_is_height_by_focal_length(high: float) -> None:
    level = -537.7  # of the ground; not one that single precision knows
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 4) * high, np.linspace(-0.5, 0.5, 3) * high)
    eyes = np.column_stack([x.ravel(), y.ravel(), np.full(12, high + level)])
    grid = grid_over(flat(0.8 * high, level), looking(eyes, eyes + np.array([0, 1e-3, -high])), None)
    wanted = high / 3000
    digit = 10.0 ** (np.floor(np.log10(wanted)) - 1)
    assert 0.99 * wanted <= grid.pixels.a < wanted + 0.99 * digit, "rounded up to two digits"


@pytest.mark.parametrize("above_middle", [-1.4, 0.0, 1e-6, 2.0])
def test_a_ring_about_a_house_gets_pixels_of_its_walls_however_high_it_was_flown(above_middle: float) -> None:
    corners = np.array([(x, y, z) for z in (-3, 3) for x, y in ((-6, -5), (6, -5), (6, 5), (-6, 5))], np.float32)
    walls = [(i, (i + 1) % 4, (i + 1) % 4 + 4) for i in range(4)] + [(i, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    house = Mesh(corners, np.zeros((8, 3), np.uint8), np.array(walls))
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    eyes = np.column_stack([15 * np.cos(turn), 15 * np.sin(turn), np.full(24, above_middle)])
    grid = grid_over(house, looking(eyes, eyes * [0, 0, 1]), None)
    assert (15 - 7.9) / 3000 <= grid.pixels.a <= (15 - 5) / 3000 * 1.1


def test_a_map_has_not_far_more_pixels_than_the_photographs_together() -> None:
    eyes = np.array([(-40, -40, 0.01), (40, -40, 0.01), (40, 40, 0.01), (-40, 40, 0.01)])
    views = looking(eyes, eyes * [1, 1, 0] + [0, 1e-5, 0])
    grid = grid_over(flat(60.0), views, None)
    assert grid.width * grid.height <= 4.1 * views.size.prod(axis=1).sum()
    assert grid.pixels.a == pytest.approx(np.sqrt(120**2 / (4 * 4 * 4000 * 3000)), rel=0.05), "and no fewer"


def test_photographs_that_show_nothing_of_the_mesh_are_refused() -> None:
    eyes = np.array([(-4.0, -4, 10), (4, 4, 10)])
    with pytest.raises(StoreError, match="shows any of the mesh"):
        grid_over(flat(60.0), looking(eyes, eyes * [1, 1, 2] + np.array([0, 1e-3, 0])), None)
