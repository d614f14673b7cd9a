"""Points are where they were when others open them: a reader of LAS headers written here, and Open3D."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import lazrs
import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.warp import transform

from aug3d_core.export import points
from aug3d_core.export.maps import SURFACE_MODEL, export_map
from aug3d_core.export.points import LAZ, PLY, export_points
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.geodesy import enu_from_geodetic, geodetic_from_enu
from aug3d_core.run import full_disk
from aug3d_core.run.errors import DiskFull, StoreError, UsageError
from tests.export.test_maps import write_scene

ORIGIN = {"lat_deg": 46.9, "lon_deg": 7.5, "alt_m": 538.0}
SYDNEY = {"lat_deg": -33.9, "lon_deg": 151.2, "alt_m": 20.0}
_OPEN = """
import json, sys
import numpy as np
import open3d
cloud = open3d.io.read_point_cloud(sys.argv[1])
arrays = {name: np.asarray(getattr(cloud, name)).tolist() for name in ("points", "normals", "colors")}
print("FOUND" + json.dumps(arrays))
"""


@dataclass(frozen=True)
class Las:
    """What a LAZ holds, read by the tables of the LAS 1.4 specification."""

    version: tuple[int, int]
    form: int
    step: tuple[float, ...]
    ends: np.ndarray  # lowest and highest x, y, z of the header
    counted: tuple[int, int]  # all points, those that are the first return
    records: dict[tuple[str, int], bytes]
    xyz: np.ndarray
    rgb: np.ndarray
    returns: set[int]


def read_las(path: Path) -> Las:
    data = path.read_bytes()
    assert data[:4] == b"LASF" and struct.unpack_from("<H", data, 6)[0] & 0b10000, "reference systems are text"
    size, first, vlrs, form, length = struct.unpack_from("<HIIBH", data, 94)
    numbers = struct.unpack_from("<12d", data, 131)
    count, by_return = struct.unpack_from("<Q", data, 247)[0], struct.unpack_from("<Q", data, 255)[0]
    assert form & 0x80, "the points are compressed"
    records, at = {}, size
    for _ in range(vlrs):
        _, user, number, long, _ = struct.unpack_from("<H16sHH32s", data, at)
        records[user.rstrip(b"\0").decode(), number] = data[at + 54 : at + 54 + long]
        at += 54 + long
    raw = np.zeros(count * length, np.uint8)
    laz = records["laszip encoded", 22204]
    with path.open("rb") as file:
        file.seek(first)
        lazrs.LasZipDecompressor(file, laz).decompress_many(raw)  # pyright: ignore[reportAttributeAccessIssue]
    layout = np.dtype({"names": ["xyz", "returns", "rgb"], "formats": [("<i4", 3), "u1", ("<u2", 3)],
                       "offsets": [0, 14, 30], "itemsize": length})  # fmt: skip
    found = raw.view(layout)
    ends = np.array([numbers[7::2], numbers[6::2]])
    return Las(
        (data[24], data[25]), form & 0x7F, numbers[:3], ends, (count, by_return), records,
        found["xyz"] * numbers[:3] + numbers[3:6], found["rgb"], set(found["returns"].tolist()),
    )  # fmt: skip


@pytest.fixture
def scene(tmp_path: Path) -> tuple[Path, Path]:
    """Write 1,001 points within some hundred metres."""
    sfm, depth = tmp_path / "sfm", tmp_path / "depth"
    sfm.mkdir()
    depth.mkdir()
    world(sfm, ORIGIN)
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(1001, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    xyz = (rng.normal(size=(1001, 3)) * [300, 200, 10]).astype(np.float32)
    Fused(xyz, normals.astype(np.float32), rng.integers(0, 256, (1001, 3), np.uint8), np.full(1001, 3, np.uint8)).save(
        depth / "baseline_fused.npz"
    )
    return sfm, depth


def world(sfm: Path, origin: dict | None) -> None:
    unit = "m" if origin else "scene unit"
    (sfm / "world.json").write_text(json.dumps({"metric": bool(origin), "unit": unit, "origin": origin}))


def fused_of(scene: tuple[Path, Path]) -> Fused:
    return Fused.load(scene[1] / "baseline_fused.npz")


@pytest.mark.parametrize("origin", [ORIGIN, SYDNEY], ids=["north", "south"])
def test_every_point_is_on_earth_where_it_was(
    scene: tuple[Path, Path], tmp_path: Path, origin: dict, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(points, "_PART", 137)  # in many parts
    world(scene[0], origin)
    told, fused = export_points(*scene, tmp_path / "points"), fused_of(scene)
    las = read_las(tmp_path / "points" / LAZ)
    epsg = 32632 if origin is ORIGIN else 32756
    assert (told.points, told.crs, told.unit) == (1001, f"EPSG:{epsg}", "m") and told.step <= 1e-3
    assert (las.version, las.form, las.step) == ((1, 4), 7, (told.step,) * 3)
    assert las.counted == (1001, 1001) and las.returns == {0x11}
    crs = CRS.from_wkt(las.records["LASF_Projection", 2112].rstrip(b"\0").decode())
    assert crs.to_epsg() == epsg
    lon, lat = transform(crs, "EPSG:4326", las.xyz[:, 0], las.xyz[:, 1])[:2]
    found = enu_from_geodetic(np.column_stack([lat, lon, las.xyz[:, 2]]), np.array([*origin.values()]))
    assert np.linalg.norm(found - fused.xyz, axis=1).max() < 1e-3
    assert (las.rgb == fused.rgb.astype(int) * 256).all()
    assert np.abs(las.ends - [las.xyz.min(axis=0), las.xyz.max(axis=0)]).max() < 1e-9


def test_open3d_finds_positions_normals_and_colours_in_the_scenes_world(
    scene: tuple[Path, Path], tmp_path: Path
) -> None:
    export_points(*scene, tmp_path / "points")
    words = [sys.executable, "-c", _OPEN, str(tmp_path / "points" / PLY)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert "FOUND" in done.stdout, done.stderr[-2000:]
    found, fused = json.loads(done.stdout.partition("FOUND")[2]), fused_of(scene)
    assert (np.array(found["points"], np.float32) == fused.xyz).all()
    assert np.abs(np.array(found["normals"]) - fused.normals).max() < 1e-6
    assert (np.rint(np.array(found["colors"]) * 255) == fused.rgb).all()


@pytest.mark.parametrize("size", [0.002, 1.0, 7000.0])
def test_without_gps_the_points_are_in_the_scenes_own_world(
    scene: tuple[Path, Path], tmp_path: Path, size: float
) -> None:
    world(scene[0], None)
    fused = fused_of(scene)
    xyz = (fused.xyz * (size / 1000)).astype(np.float32)
    Fused(xyz, fused.normals, fused.rgb, fused.views).save(scene[1] / "baseline_fused.npz")
    told = export_points(*scene, tmp_path / "points")
    las = read_las(tmp_path / "points" / LAZ)
    assert (told.crs, told.unit) == ("", "scene unit") and ("LASF_Projection", 2112) not in las.records
    assert np.abs(las.xyz - xyz).max() <= min(1e-3, max(1e-6 * np.ptp(xyz, axis=0).max(), 1e-9))


def test_where_gps_told_no_altitudes_heights_count_from_the_worlds_zero_and_it_is_told(
    scene: tuple[Path, Path], tmp_path: Path
) -> None:
    assert not export_points(*scene, tmp_path / "told").heights_from_zero
    world(scene[0], ORIGIN | {"alt_m": None})
    told = export_points(*scene, tmp_path / "points")
    assert told.heights_from_zero and told.crs == "EPSG:32632"
    height, xyz = read_las(tmp_path / "points" / LAZ).xyz[:, 2], fused_of(scene).xyz.astype(float)
    dips_m = (xyz[:, :2] ** 2).sum(axis=1) / (2 * 6_371_000)  # the earth's, beneath the world's plane
    assert height == pytest.approx(xyz[:, 2] + dips_m, abs=5e-3)


def test_heights_are_those_of_the_surface_model(scene: tuple[Path, Path], tmp_path: Path) -> None:
    sfm, surface, photos = write_scene(tmp_path / "map_scene")
    xyz = np.array([(-30, -30, 0), (30, 20, 0), (3, -4, 12)], np.float32)
    Fused(
        xyz, np.tile(np.array([0, 0, 1], np.float32), (3, 1)), np.zeros((3, 3), np.uint8), np.full(3, 2, np.uint8)
    ).save(scene[1] / "baseline_fused.npz")
    export_map(sfm, surface, photos, tmp_path / "map")
    export_points(sfm, scene[1], tmp_path / "points")
    las = read_las(tmp_path / "points" / LAZ)
    with rasterio.open(tmp_path / "map" / SURFACE_MODEL) as model:
        heights = np.array([*model.sample(las.xyz[:, :2])])[:, 0]
    assert heights == pytest.approx(las.xyz[:, 2], abs=2e-3)
    assert las.xyz[:, 2] == pytest.approx(
        geodetic_from_enu(xyz.astype(float), np.array([*ORIGIN.values()]))[:, 2], abs=1e-3
    )


def test_where_the_disk_is_full_it_is_named_and_nothing_is_left(
    scene: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise lazrs.LazrsError("IoError: Failed to call seek")

    monkeypatch.setattr(points, "_records", refused)
    monkeypatch.setattr(full_disk, "free_bytes", lambda of: 0 if (of / PLY).exists() else 2**40)
    with pytest.raises(DiskFull, match=f"{tmp_path}/points: IoError"):
        export_points(*scene, tmp_path / "points")
    assert not (tmp_path / "points").exists()


def test_nothing_is_overwritten_and_what_is_missing_is_named(scene: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "points").mkdir()
    (tmp_path / "points" / "mine").write_text("mine")
    with pytest.raises(UsageError, match="not an empty folder"):
        export_points(*scene, tmp_path / "points")
    fused = fused_of(scene)
    none = Fused(fused.xyz[:0], fused.normals[:0], fused.rgb[:0], fused.views[:0])
    none.save(scene[1] / "baseline_fused.npz")
    with pytest.raises(StoreError, match="no fused points"):
        export_points(*scene, tmp_path / "new")
    (scene[1] / "baseline_fused.npz").unlink()
    with pytest.raises(StoreError, match=r"baseline_fused.npz is missing"):
        export_points(*scene, tmp_path / "new")
    assert not (tmp_path / "new").exists()
