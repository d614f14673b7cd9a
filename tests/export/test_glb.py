"""The model is what it was when another program opens it: Blender, whose importer turns it z up again."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aug3d_core.export.glb import MODEL, OFFSET, export_glb
from aug3d_core.geometry.geodesy import enu_from_geodetic
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.run.errors import DiskFull, StoreError, UsageError
from tests.export.full_disk import full_disk

ORIGIN = {"lat_deg": 46.9, "lon_deg": 7.5, "alt_m": 538.0}
FAR = np.array([5000.25, -3000.5, 20.0])  # where single precision has 0.5 mm left
XYZ = FAR + np.array([(0, 0, 0), (10, 0, 0), (10, 6, 0), (0, 6, 4)], float)
TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)])
RED, BLUE = (220, 20, 20), (20, 20, 220)
_OPEN = """
import bpy, json, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
[mesh] = [one for one in bpy.data.objects if one.type == "MESH"]
corners = [mesh.matrix_world @ vertex.co for vertex in mesh.data.vertices]
uv = [list(one.uv) for one in mesh.data.uv_layers[0].data] if mesh.data.uv_layers else []
images = [(list(one.size), list(one.pixels[:3])) for one in bpy.data.images if one.size[0]]
xyz, faces = [list(one) for one in corners], len(mesh.data.polygons)
print("FOUND" + json.dumps({"xyz": xyz, "faces": faces, "uv": uv, "images": images}))
"""


@pytest.fixture
def scene(tmp_path: Path) -> tuple[Path, Path]:
    """Write two triangles whose picture is red in its lower half and blue in its upper one."""
    sfm, surface = tmp_path / "sfm", tmp_path / "surface"
    sfm.mkdir()
    surface.mkdir()
    (sfm / "world.json").write_text(json.dumps({"metric": True, "unit": "m", "origin": ORIGIN}))
    picture = np.full((16, 32, 3), BLUE, np.uint8)
    picture[8:] = RED
    uv = np.array([[(0, 0), (1, 0), (1, 0.4)], [(0, 0.6), (1, 1), (0, 1)]], float)
    Mesh(XYZ.astype(np.float32), np.full((4, 3), RED, np.uint8), TRIANGLES).save(surface / "baseline_mesh.ply")
    TexturedMesh(XYZ, TRIANGLES, uv, picture).save(
        surface / "baseline_mesh_textured.npz", surface / "baseline_mesh_texture.png"
    )
    return sfm, surface


def opened(file: Path) -> dict:
    done = subprocess.run([sys.executable, "-c", _OPEN, str(file)], capture_output=True, text=True, timeout=300)
    assert "FOUND" in done.stdout, done.stderr[-2000:]
    return json.loads(done.stdout.partition("FOUND")[2].splitlines()[0])


def test_where_the_disk_is_full_it_is_named_and_nothing_is_left(
    scene: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(DiskFull, match=f"{tmp_path}/glb: .*No space left"):
        export_glb(*scene, tmp_path / "glb")
    assert not (tmp_path / "glb").exists()


def test_blender_finds_every_corner_where_it_was(scene: tuple[Path, Path], tmp_path: Path) -> None:
    written = export_glb(*scene, tmp_path / "glb")
    assert (written.triangles, written.texture_px) == (2, (32, 16)) and 0 < written.mib < 0.01
    found, offset = opened(tmp_path / "glb" / MODEL), json.loads((tmp_path / "glb" / OFFSET).read_text())
    xyz = np.array(found["xyz"]) + offset["middle_in_world"]
    assert np.linalg.norm(xyz[:, None] - XYZ, axis=-1).min(axis=1).max() < 1e-3
    assert len({tuple(np.round(one, 3)) for one in xyz}) == 4 and found["faces"] == 2
    assert enu_from_geodetic(np.array(offset["middle_lat_lon_alt"]), np.array([*ORIGIN.values()])) == pytest.approx(
        offset["middle_in_world"], abs=1e-3
    )


def test_the_picture_is_the_right_way_up(scene: tuple[Path, Path], tmp_path: Path) -> None:
    export_glb(*scene, tmp_path / "glb")
    found = opened(tmp_path / "glb" / MODEL)
    assert np.sort(np.array(found["uv"])[:, 1]) == pytest.approx([0, 0, 0.4, 0.6, 1, 1], abs=1e-5)
    [(size, lowest)] = found["images"]
    assert size == [32, 16] and lowest[0] > 0.7 > lowest[2], "Blender counts from the lower left, which is red"


def test_without_texture_the_corners_have_colours(scene: tuple[Path, Path], tmp_path: Path) -> None:
    (scene[1] / "baseline_mesh_textured.npz").unlink()
    written = export_glb(*scene, tmp_path / "glb")
    assert (written.triangles, written.texture_px) == (2, (0, 0))
    found = opened(tmp_path / "glb" / MODEL)
    assert len(found["xyz"]) == 4 and found["images"] == []


def test_without_gps_nothing_is_said_of_the_earth(scene: tuple[Path, Path], tmp_path: Path) -> None:
    (scene[0] / "world.json").write_text(json.dumps({"metric": False, "unit": "unit", "origin": None}))
    export_glb(*scene, tmp_path / "glb")
    assert json.loads((tmp_path / "glb" / OFFSET).read_text())["middle_lat_lon_alt"] is None


def test_an_altitude_that_nothing_told_is_null(scene: tuple[Path, Path], tmp_path: Path) -> None:
    told = {"metric": True, "unit": "m", "origin": ORIGIN | {"alt_m": None}}
    (scene[0] / "world.json").write_text(json.dumps(told))
    export_glb(*scene, tmp_path / "glb")
    lat, lon, alt = json.loads((tmp_path / "glb" / OFFSET).read_text())["middle_lat_lon_alt"]
    assert alt is None and (lat, lon) == pytest.approx((ORIGIN["lat_deg"], ORIGIN["lon_deg"]), abs=0.1)


def test_nothing_is_overwritten_and_what_is_missing_is_named(scene: tuple[Path, Path], tmp_path: Path) -> None:
    (tmp_path / "glb").mkdir()
    (tmp_path / "glb" / "mine").write_text("mine")
    with pytest.raises(UsageError, match="not an empty folder"):
        export_glb(*scene, tmp_path / "glb")
    (scene[0] / "world.json").unlink()
    with pytest.raises(StoreError, match=r"world.json is missing"):
        export_glb(*scene, tmp_path / "new")
