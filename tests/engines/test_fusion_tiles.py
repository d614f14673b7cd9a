"""Fusion in tiles of ground is fusion: as many points, at the same places, once at borders, however often it was killed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from PIL import Image
from scipy.spatial import KDTree

from aug3d_core.depth.cameras import camera_of, depth_sizes
from aug3d_core.depth.files import FUSED, FUSED_TILES, WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS
from aug3d_core.depth.fusion import _read_counts, _read_ply, fuse
from aug3d_core.depth.fusion_tiles import Dense, FusionPlan, _cut, _cut_views, _world_of, fuse_to, plan_fusion
from aug3d_core.depth.workspace import write_workspace
from aug3d_core.geometry.depth_maps import read_map, write_map
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import EVERYWHERE, leaves
from aug3d_core.geometry.transforms import apply, project
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from tests.engines.test_depth import MAP_PX, SCENE, sparse, true_depth, true_views

EVERY = [*range(12)]
MOST = 150_000  # of 12 x 240 x 180 pixels: four tiles


@pytest.fixture(scope="module")
def dense(tmp_path_factory: pytest.TempPathFactory) -> Dense:
    """True depth of the little scene, a hole in each map, and the last view's empty."""
    photos, workspace = tmp_path_factory.mktemp("photos"), tmp_path_factory.mktemp("workspace")
    views, (points, tracks) = true_views(), sparse(true_views())
    for index, pose in enumerate(views.cam_from_world):
        SCENE.photograph(pose).save(photos / image_name(index))
    made = Dense(workspace, views, depth_sizes(views, MAP_PX), points, tracks)
    write_workspace(workspace, views, made.sizes, points, tracks, photos, photos / "masks", EVERY)
    for view in EVERY:
        depth = np.nan_to_num(true_depth(made.camera(view))).astype(np.float32)
        depth[50:60, 70:90] = 0
        depth *= view < 11
        up = np.broadcast_to(views.cam_from_world[view, :, 2], (*depth.shape, 3)).astype(np.float32)
        write_map(made.map_path(WORKSPACE_DEPTH_MAPS, view), depth)
        write_map(made.map_path(WORKSPACE_NORMAL_MAPS, view), up)
    return made


@pytest.fixture(scope="module")
def whole(dense: Dense) -> Fused:
    return fuse(dense.workspace, dense.views, EVERY)


@pytest.fixture(scope="module")
def tiled(dense: Dense, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tiled") / FUSED
    assert fuse_to(path, dense, EVERY, most=MOST) == (len(Fused.load(path).xyz), 4)
    return path


@pytest.fixture(scope="module")
def plan(dense: Dense) -> FusionPlan:
    return plan_fusion(dense, EVERY, MOST)


def test_a_scene_below_the_limit_has_the_bytes_of_one_fusion(dense: Dense, whole: Fused, tmp_path: Path) -> None:
    whole.save(tmp_path / "whole.npz")
    assert fuse_to(tmp_path / FUSED, dense, EVERY) == (len(whole.xyz), 1)
    assert (tmp_path / FUSED).read_bytes() == (tmp_path / "whole.npz").read_bytes()
    assert not (tmp_path / FUSED_TILES).exists()


def test_points_lie_where_pixels_see_them_whichever_way_the_camera_is_turned(tmp_path: Path) -> None:
    """On a slope, so that half a pixel aside is seen: from straight above flat ground nobody would."""
    slope, headings = np.array([-0.5, 0.0, 1.0]), np.radians([0, 180, 90])
    down = np.array([[(np.cos(h), np.sin(h), 0), (np.sin(h), -np.cos(h), 0), (0, 0, -1)] for h in headings])
    at = np.array([[x, 0, 50.0] for x in (-4, 0, 4)])
    pose = np.concatenate([down, -np.einsum("vij,vj->vi", down, at)[..., None]], axis=-1)
    views = Views(np.arange(3), pose, np.tile([60.0, 60, 32, 24], (3, 1)), np.tile([64, 48], (3, 1)))
    xyz = np.array([[2.0 * x, 2.0 * y, x] for x in range(-3, 4) for y in range(-3, 4)])
    view, point = np.tile(range(3), len(xyz)), np.repeat(range(len(xyz)), 3)
    xy = project(apply(pose[view], xyz[point][:, None])[:, 0], views.intrinsics[0])
    points = Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    dense = Dense(tmp_path / "workspace", views, views.size, points, Tracks(point, view, xy))
    for photo in range(3):
        Image.new("RGB", (64, 48)).save(tmp_path / image_name(photo))
    write_workspace(dense.workspace, views, dense.sizes, points, dense.tracks, tmp_path, tmp_path / "masks", [0, 1, 2])
    for photo in range(3):
        normal = np.broadcast_to(down[photo] @ slope / np.linalg.norm(slope), (48, 64, 3)).astype(np.float32)
        depth = -(slope @ at[photo]) / (dense.camera(photo).rays @ down[photo] @ slope)
        write_map(dense.map_path(WORKSPACE_DEPTH_MAPS, photo), depth.astype(np.float32))
        write_map(dense.map_path(WORKSPACE_NORMAL_MAPS, photo), normal)
    for most, tiles in ((10_000, 1), (3_000, 4)):
        assert fuse_to(tmp_path / FUSED, dense, [0, 1, 2], most=most)[1] == tiles
        fused = Fused.load(tmp_path / FUSED)
        assert np.abs(fused.xyz @ slope).max() < 0.001, "a pixel is 0.8 wide"
        assert len(fused.xyz) > 2000


def test_tiles_hold_the_points_of_the_whole_in_their_order(
    dense: Dense, whole: Fused, tiled: Path, plan: FusionPlan
) -> None:
    fused = Fused.load(tiled)
    assert np.isclose(len(fused.xyz), len(whole.xyz), rtol=0.02)
    inside = np.stack([tile.ground.holds(fused.xyz) for tile in leaves(plan.tiles)])
    assert (inside.sum(axis=0) == 1).all()
    assert (np.diff(inside.argmax(axis=0)) >= 0).all()
    off = np.abs(fused.xyz[:, 2, None] - np.array([z for z, _, _ in SCENE.planes])).min(axis=1)
    assert np.median(off) < 0.05
    assert fused.views.min() >= 2
    assert np.median(fused.normals[:, 2]) > 0.99
    colours = [np.median(points.rgb[:, 0]) for points in (fused, whole)]
    assert abs(np.subtract(*colours)) < 2
    far = KDTree(whole.xyz).query(fused.xyz)[0]
    assert np.percentile(far, 99) < 0.5, "no more than a pixel or two on the ground, 24 cm"


def test_no_point_at_a_border_is_lost_or_doubled(whole: Fused, tiled: Path, plan: FusionPlan) -> None:
    fused, border = Fused.load(tiled), plan.tiles
    near = [np.abs(points.xyz[:, border.axis] - border.at) < 1.0 for points in (fused, whole)]
    assert np.isclose(near[0].sum(), near[1].sum(), rtol=0.04)
    alone = [np.asarray(KDTree(p.xyz).query(p.xyz[n], 2)[0])[:, 1] for p, n in zip((fused, whole), near, strict=True)]
    assert np.isclose(np.median(alone[0]), np.median(alone[1]), rtol=0.1)
    assert (alone[0] < 0.03).mean() < (alone[1] < 0.03).mean() + 0.03


def test_a_tile_is_given_all_views_that_show_some_of_it_and_few_others(dense: Dense, plan: FusionPlan) -> None:
    missing, many = 0, plan_fusion(dense, EVERY, MOST // 4)
    for tile in leaves(many.tiles):
        around = tile.ground.grown(plan.margin)
        showing = {
            view
            for view in EVERY
            if around.holds(
                _world_of(read_map(dense.map_path(WORKSPACE_DEPTH_MAPS, view)), dense.camera(view))[2]
            ).any()
        }
        given = many.reaching(around)
        assert showing <= set(given)
        assert len(given) <= len(showing) + 2
        missing += len(EVERY) - len(given)
    assert missing > 32, "the view that is empty, and those that see other tiles"


def test_a_cut_map_shows_the_same_places(dense: Dense, plan: FusionPlan, tmp_path: Path) -> None:
    ground = next(leaves(plan.tiles)).ground
    for part in (WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS, "images"):
        (tmp_path / part).mkdir(parents=True)
    view = plan.reaching(ground)[1]
    window = _cut(dense, view, ground, tmp_path)
    assert window is not None
    views, tracks = _cut_views(dense, {view: window})
    cut = Dense(tmp_path, views, views.size, dense.points, tracks)
    depth = read_map(cut.map_path(WORKSPACE_DEPTH_MAPS, 0))
    assert depth.size < 0.9 * MAP_PX**2 * 3 / 4
    xyz = _world_of(read_map(dense.map_path(WORKSPACE_DEPTH_MAPS, view)), dense.camera(view))[2]
    np.testing.assert_allclose(_world_of(depth, camera_of(views, 0, views.size[0]))[2], xyz[ground.holds(xyz)])
    seen = dense.tracks.view == view
    np.testing.assert_allclose(tracks.xy, dense.tracks.xy[seen] * 0.75 - window[:2])
    assert _cut(dense, view, EVERYWHERE.halves(0, -1e4)[0], tmp_path) is None


def test_a_killed_fusion_goes_on_with_the_tiles_that_are_done(dense: Dense, tiled: Path, tmp_path: Path) -> None:
    def kill(done: int, tiles: int) -> None:
        assert tiles == 4
        if done == 2:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        fuse_to(tmp_path / FUSED, dense, EVERY, kill, MOST)
    folder = tmp_path / FUSED_TILES / "fused"
    times = {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}
    assert [*sorted(times)] == ["00000.npz", "00001.npz"]
    fuse_to(tmp_path / FUSED, dense, EVERY, most=MOST)
    assert times.items() <= {file.name: file.stat().st_mtime_ns for file in folder.iterdir()}.items()
    assert (tmp_path / FUSED).read_bytes() == tiled.read_bytes()


def test_maps_without_any_depth_are_no_points(dense: Dense, tmp_path: Path) -> None:
    assert fuse_to(tmp_path / FUSED, dense, [11], most=1) == (0, 1)
    assert len(Fused.load(tmp_path / FUSED).xyz) == 0


@pytest.mark.parametrize("left", [0, 26, 27, 27 * 3 + 5])
def test_points_that_a_full_disk_cut_short_are_refused(tmp_path: Path, left: int) -> None:
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nend_header\n"
    (tmp_path / "fused.ply").write_bytes(head + bytes(left))
    with pytest.raises(OSError, match="No space left"):
        _read_ply(tmp_path / "fused.ply")
    (tmp_path / "fused.ply").write_bytes(head + bytes(4 * 27))
    assert len(_read_ply(tmp_path / "fused.ply")) == 4


@pytest.mark.parametrize("left", [0, 7, 8, 10, 8 + 4 * 4, 8 + 4 * 5, 8 + 4 * 7, 8 + 4 * 8, 8 + 4 * 12 - 1])
def test_counts_that_a_full_disk_cut_short_are_refused(tmp_path: Path, left: int) -> None:
    numbers = [3, 0, 1, 2, 2, 0, 1, 4, 0, 1, 2, 3]
    whole = np.uint64(3).tobytes() + np.array(numbers, "<u4").tobytes()
    (tmp_path / "vis").write_bytes(whole)
    assert _read_counts(tmp_path / "vis", 3).tolist() == [3, 2, 4]
    (tmp_path / "vis").write_bytes(whole[:left])
    with pytest.raises(OSError, match=r"No space left.*vis"):
        _read_counts(tmp_path / "vis", 3)


def test_fusion_leaves_nothing_beside_its_maps_even_where_it_was_killed_before(
    dense: Dense, monkeypatch: pytest.MonkeyPatch
) -> None:
    def kill(ply: Path, *_: object, **__: object) -> None:
        killed.append(ply)
        raise InterruptedError

    killed: list[Path] = []
    with monkeypatch.context() as patched, pytest.raises(InterruptedError):
        patched.setattr(pycolmap, "stereo_fusion", kill)
        fuse(dense.workspace, dense.views, EVERY[:2])
    as_it_was = {*dense.workspace.rglob("*")}
    killed[0].parent.mkdir()
    killed[0].write_bytes(b"ply")
    assert dense.workspace in killed[0].parents
    fuse(dense.workspace, dense.views, EVERY[:2])
    assert {*dense.workspace.rglob("*")} == as_it_was
