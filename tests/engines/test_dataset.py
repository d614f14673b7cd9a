"""The stage `dataset` on a toy scene written as the outputs of the stages before it."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.dataset.batches import Wanted, check_groups, draw
from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.declared import DATASET_OF_PHOTOS
from aug3d_core.dataset.files import LEAK_AUDIT, SCENE_ZARR
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import REAL as REAL_SOURCE
from aug3d_core.dataset.scene import RENDERED, SPLITS
from aug3d_core.dataset.stage import run
from aug3d_core.depth.files import DEPTH_MAPS, geometric_map_name
from aug3d_core.domes.files import CAMERAS
from aug3d_core.geometry.depth_maps import write_map
from aug3d_core.geometry.masks import save_mask
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import apply, homogeneous, invert, look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.files import GROUPS
from aug3d_core.photos.files import image_name
from aug3d_core.rendering.config import RenderingConfig
from aug3d_core.rendering.files import RENDER_TABLE, SHARDS, shard_name
from aug3d_core.rendering.stage import run as render_views
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from aug3d_core.surface.files import BASELINE_MESH, BASELINE_RENDERS, MESH, MESH_SOURCES
from tests.same_files import assert_same_files
from tests.toy_scene import EXTENT_M, ROOF_M, toy_scene, toy_world

WIDTH, HEIGHT, REAL = 24, 16, 36
CONFIG = DatasetConfig(width_px=WIDTH, height_px=HEIGHT)


def silent(done: int, total: int, what: str) -> None:
    """Take no notice."""


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, WIDTH, HEIGHT)


@pytest.fixture
def inputs(scene, tmp_path):
    folders = {name: tmp_path / name for name in ("sfm", "grouping", "depth", "surface", "sampling", "rendering")}
    for folder in folders.values():
        folder.mkdir()
    write_sfm(scene, folders["sfm"])
    write_grouping(scene, folders["grouping"])
    write_depth(scene, folders["depth"])
    write_surface(scene, folders["surface"])
    write_renders(scene, folders["sampling"], folders["rendering"])
    (tmp_path / "out").mkdir()
    return folders


def write_sfm(scene, folder: Path) -> None:
    poses, size = invert(scene.world_from_cam[:REAL, :3]), np.tile([WIDTH, HEIGHT], (REAL, 1))
    views = Views(np.arange(REAL), poses, scene.intrinsics[:REAL], size)
    views.save(folder / VIEWS)
    rng = np.random.default_rng(0)
    xyz = np.column_stack(
        [rng.uniform(-EXTENT_M, EXTENT_M, (500, 2)), rng.uniform(0, ROOF_M, 500) * (rng.random(500) < 0.3)]
    )
    Points(xyz, np.zeros((500, 3), np.uint8), np.zeros(500)).save(folder / POINTS)
    point, view = (grid.ravel() for grid in np.meshgrid(np.arange(500), np.arange(REAL)))
    ahead = np.array([apply(poses[v], xyz[p : p + 1])[0, 2] > 0 for p, v in zip(point, view, strict=True)])
    Tracks(point[ahead], view[ahead], np.zeros((ahead.sum(), 2))).save(folder / TRACKS)
    (folder / VIEW_IMAGES).mkdir()
    for i in range(REAL):
        Image.fromarray(scene.images[i]).save(folder / VIEW_IMAGES / image_name(i))


def write_grouping(scene, folder: Path) -> None:
    roles = [SPLITS[code] for code in scene.splits[:REAL]]
    table = pd.DataFrame({"view": np.arange(REAL), "photo_id": np.arange(REAL), "role": roles})
    table.to_parquet(folder / SPLIT_TABLE)
    np.savez(folder / GROUPS, members=scene.groups["real"], test_members=scene.groups["test"])


def write_depth(scene, folder: Path) -> None:
    """Write depth as of photographs of twice the size, sure in their left half."""
    (folder / DEPTH_MAPS).mkdir(parents=True)
    for view in range(REAL):
        depth = scene.scaffold[view].astype(np.float32).repeat(2, axis=0).repeat(2, axis=1)
        depth[:, WIDTH:] = 0
        write_map(folder / DEPTH_MAPS / geometric_map_name(view), depth)


def write_surface(scene, folder: Path) -> None:
    for name in (MESH, BASELINE_MESH):
        toy_world(np.random.default_rng(0)).mesh().save(folder / name)
    role = np.array([SPLITS[code] for code in scene.splits[:REAL]])
    train, given = np.flatnonzero(role == "train").tolist(), np.flatnonzero(role != "target").tolist()
    (folder / MESH_SOURCES).write_text(json.dumps({"mesh": train, "baseline": given}))
    (folder / BASELINE_RENDERS).mkdir()
    for view, rgb, alpha in zip(scene.baseline_view, scene.baseline_images, scene.baseline_alpha, strict=True):
        image = Image.fromarray(np.dstack([rgb, alpha]))
        image.save(folder / BASELINE_RENDERS / image_name(int(view)))


def write_renders(scene, sampling: Path, rendering: Path) -> None:
    rows = np.flatnonzero(scene.source == RENDERED)
    ids = np.arange(len(rows))
    np.savez(
        sampling / CAMERAS,
        view_id=ids,
        dome_id=scene.dome_id[rows],
        world_from_cam=homogeneous(scene.world_from_cam[rows, :3]),
        intrinsics=scene.intrinsics[rows],
        size=np.tile([WIDTH, HEIGHT], (len(rows), 1)),
    )
    (rendering / SHARDS).mkdir()
    arrays = {"view_id": ids, "rgb": scene.images[rows], "alpha": scene.alpha[rows], "depth": scene.depth[rows]}
    np.savez(rendering / SHARDS / shard_name(0), **arrays)
    table = pd.DataFrame({"view_id": ids, "dome_id": scene.dome_id[rows], "shard": 0, "row": ids, "kept": True})
    table.to_parquet(rendering / RENDER_TABLE)


def test_the_packed_scene_is_the_scene(scene, inputs, tmp_path):
    outcome = run(inputs, CONFIG, tmp_path / "out", silent)
    packed = read(tmp_path / "out" / SCENE_ZARR)
    for name in ("images", "alpha", "source", "photo_id", "dome_id", "splits", "baseline_images"):
        assert np.array_equal(getattr(packed, name), getattr(scene, name)), name
    assert np.allclose(packed.world_from_cam, scene.world_from_cam)
    assert np.allclose(packed.intrinsics, scene.intrinsics)
    for name, members in scene.groups.items():
        assert np.array_equal(packed.groups[name], members), name
    assert outcome.metrics["real"] == REAL
    assert outcome.metrics["rendered"] == len(scene) - REAL
    told = packed.attributes["leak_audit"]
    assert told == json.loads((tmp_path / "out" / LEAK_AUDIT).read_text())
    assert outcome.metrics["leak_audit"] == told["state"] == "doubtful", "every photo of the toy sees every point"
    assert any("share of a target's points that training sees" in note for note in outcome.notes)
    assert outcome.metrics["leak_seen_share_max"] == 1
    assert (tmp_path / "out/contact_sheet.png").is_file()


def test_depth_is_exact_of_renders_and_by_stereo_of_training_photographs(scene, inputs, tmp_path):
    run(inputs, CONFIG, tmp_path / "out", silent)
    packed = read(tmp_path / "out" / SCENE_ZARR)
    assert np.array_equal(packed.depth[REAL:], scene.depth[REAL:])
    train = np.flatnonzero(scene.splits[:REAL] == SPLITS.index("train"))
    assert np.array_equal(packed.depth[train, :, : WIDTH // 2], scene.scaffold[train, :, : WIDTH // 2])
    assert not packed.depth[:REAL, :, WIDTH // 2 :].any(), "unknown where stereo is not sure"
    assert not packed.depth[:REAL][scene.splits[:REAL] != SPLITS.index("train")].any(), (
        "nothing is taught about the test"
    )


def test_masked_photographs_are_packed_with_holes_and_the_others_as_ever(scene, inputs, tmp_path):
    view = int(np.flatnonzero(scene.splits[:REAL] == SPLITS.index("train"))[0])
    used = np.ones((HEIGHT, WIDTH), bool)
    used[4:10, 3:9] = False
    save_mask(used, inputs["sfm"] / VIEW_MASKS / image_name(view))
    lorry = scene.images[view].copy()
    lorry[~used] = (255, 0, 255)
    Image.fromarray(lorry).save(inputs["sfm"] / VIEW_IMAGES / image_name(view))
    run(inputs, CONFIG, tmp_path / "out", silent)
    packed = read(tmp_path / "out" / SCENE_ZARR)
    assert np.array_equal(packed.alpha[view] == 255, used) and np.array_equal(packed.alpha[view] == 0, ~used)
    assert np.array_equal(packed.images[view][used], scene.images[view][used])
    assert not (packed.images[view] == (255, 0, 255)).all(axis=-1).any()
    assert not packed.depth[view][~used].any() and packed.depth[view][used].any()
    others = np.arange(len(scene)) != view
    assert np.array_equal(packed.images[others], scene.images[others]) and (packed.alpha[others] == 255).all()


def test_masks_that_leave_nothing_of_packed_photographs_are_refused(scene, inputs, tmp_path):
    used = np.zeros((HEIGHT, WIDTH), bool)
    used[0] = True  # beside the crop
    for photo_id in (7, 11):
        save_mask(used, inputs["sfm"] / VIEW_MASKS / image_name(photo_id))
    shutil.rmtree(inputs["rendering"])  # they are told before it is read
    small = DatasetConfig(width_px=24, height_px=8)
    with pytest.raises(InputError, match=r"leave nothing of 2 photos as they are packed, 24x8 px: 7, 11"):
        run(inputs, small, tmp_path / "out", silent)


def test_a_scaffold_is_the_depth_of_the_mesh_that_a_view_may_know(scene, inputs, tmp_path):
    flat = Mesh(np.array([[-900, -900, 0], [900, -900, 0], [0, 900, 0]], np.float32), np.zeros((3, 3), np.uint8),
                np.array([[0, 1, 2]], np.int32))  # fmt: skip
    flat.save(inputs["surface"] / BASELINE_MESH)
    run(inputs, CONFIG, tmp_path / "out", silent)
    packed = read(tmp_path / "out" / SCENE_ZARR)
    train = scene.splits == SPLITS.index("train")
    assert np.allclose(packed.scaffold[train].astype(float), scene.scaffold[train].astype(float), rtol=2e-3)
    ground = (packed.scaffold[~train].astype(float) - scene.scaffold[~train]) > 1
    assert 0.05 < ground.mean() < 0.9, (
        "the test block's is of the other mesh: where there are boxes, it sees the ground"
    )


def test_the_slab_and_bounds_hold_the_scene(scene, inputs, tmp_path):
    run(inputs, CONFIG, tmp_path / "out", silent)
    packed = read(tmp_path / "out" / SCENE_ZARR)
    assert packed.slab.low < 0
    assert ROOF_M * 0.95 < packed.slab.high < ROOF_M * 1.3
    rendered = packed.source == RENDERED
    depth = packed.depth[rendered].astype(float).reshape(rendered.sum(), -1)
    assert (packed.near_far[rendered, 0] < depth.min(axis=1) + 1).all()
    assert (packed.near_far[rendered, 1] > depth.max(axis=1) - 1).all()


def test_packing_repeats_to_the_byte(inputs, tmp_path):
    (tmp_path / "again").mkdir()
    run(inputs, CONFIG, tmp_path / "out", silent)
    run(inputs, CONFIG, tmp_path / "again", silent)
    assert_same_files(tmp_path / "out", tmp_path / "again")


def test_without_a_whole_dome_the_set_is_degraded_and_says_so(inputs, tmp_path):
    table = pd.read_parquet(inputs["rendering"] / RENDER_TABLE)
    table.assign(kept=False).to_parquet(inputs["rendering"] / RENDER_TABLE)
    outcome = run(inputs, CONFIG, tmp_path / "out", silent)
    assert outcome.state == "degraded"
    assert outcome.metrics["rendered"] == 0
    assert outcome.metrics["domes_dropped"] == 4
    assert any("photographs alone" in note for note in outcome.notes)


def test_without_virtual_views_the_set_is_of_photographs_alone_and_fine(inputs, tmp_path):
    """What rendering itself writes of an empty plan is what is packed."""
    with np.load(inputs["sampling"] / CAMERAS) as file:
        nothing = {name: file[name][:0] for name in file}
    np.savez(inputs["sampling"] / CAMERAS, **nothing)
    shutil.rmtree(inputs["rendering"])
    inputs["rendering"].mkdir()
    render_views(inputs, RenderingConfig(), inputs["rendering"], silent)
    outcome = run(inputs, CONFIG, tmp_path / "out", silent)
    assert outcome.state == "ok"
    assert any("photographs alone" in note for note in outcome.notes)
    assert (outcome.metrics["rendered"], outcome.metrics["groups_rendered"], outcome.metrics["domes_dropped"]) == (
        0,
        0,
        0,
    )
    packed = read(tmp_path / "out" / SCENE_ZARR)
    assert len(packed) == REAL
    assert packed.groups["rendered"].shape == (0, packed.groups["real"].shape[1])
    wanted = Wanted(2, 3, 0.5, None)
    check_groups([packed], wanted)
    drawn = draw([packed], wanted, np.random.default_rng(0))
    assert all((packed.source[group.inputs] == REAL_SOURCE).all() for group in drawn), "training draws from photographs"


def test_a_leak_stops_the_stage_and_names_the_view(scene, inputs, tmp_path):
    target = int(scene.groups["test"][0, 0])
    members = scene.groups["real"].copy()
    members[0, 1] = target
    np.savez(inputs["grouping"] / GROUPS, members=members, test_members=scene.groups["test"])
    with pytest.raises(InputError, match=f"holds target view {target}"):
        run(inputs, CONFIG, tmp_path / "out", silent)
    assert not (tmp_path / "out" / SCENE_ZARR).exists()


def test_a_split_of_other_views_is_refused(inputs, tmp_path):
    table = pd.read_parquet(inputs["grouping"] / SPLIT_TABLE)
    table.iloc[:-1].to_parquet(inputs["grouping"] / SPLIT_TABLE)
    with pytest.raises(InputError, match=r"split\.parquet has 35 rows for 36 views"):
        run(inputs, CONFIG, tmp_path / "out", silent)


def test_a_mesh_made_of_a_test_photo_is_refused(scene, inputs, tmp_path):
    target = int(scene.baseline_view[0])
    (inputs["surface"] / MESH_SOURCES).write_text(json.dumps({"mesh": [target], "baseline": []}))
    with pytest.raises(InputError, match=f"the data set leaks.*target photo {target}"):
        run(inputs, CONFIG, tmp_path / "out", silent)


def test_photographs_alone_are_packed_the_same_without_renders(inputs, tmp_path):
    (tmp_path / "alone").mkdir()
    run(inputs, CONFIG, tmp_path / "out", silent)
    alone = {name: inputs[name] for name in DATASET_OF_PHOTOS.inputs}
    outcome = run(alone, CONFIG, tmp_path / "alone", silent)
    both, photos = (read(tmp_path / name / SCENE_ZARR) for name in ("out", "alone"))
    assert len(photos) == REAL and np.array_equal(photos.images, both.images[:REAL])
    assert np.array_equal(photos.groups["test"], both.groups["test"]) and not photos.groups["rendered"].size
    assert outcome.metrics["rendered"] == 0 and not any("photographs alone" in note for note in outcome.notes)


def test_photographs_and_renders_that_are_enlarged_are_told_with_what_to_do(inputs, tmp_path):
    (tmp_path / "twice").mkdir()
    as_large = run(inputs, CONFIG, tmp_path / "out", silent)
    twice = run(inputs, DatasetConfig(width_px=2 * WIDTH, height_px=2 * HEIGHT), tmp_path / "twice", silent)
    assert not any("enlarged" in note for note in as_large.notes)
    photographs, renders = (note for note in twice.notes if "are enlarged 2 times for views of 48 x 32 px" in note)
    assert photographs.startswith("photographs") and "`dataset.width_px`" in photographs
    assert renders.startswith("renders") and "`sampling.width_px`" in renders


def test_a_photograph_of_the_sky_does_not_stop_the_stage(scene, inputs, tmp_path):
    """No point is before it, and it sees none: its pose was given."""
    views, tracks = Views.load(inputs["sfm"] / VIEWS), Tracks.load(inputs["sfm"] / TRACKS)
    eye = scene.world_from_cam[0, :3, 3]
    views.cam_from_world[0] = look_at(eye, eye + np.array([0, 1, 20]))
    views.save(inputs["sfm"] / VIEWS)
    seen = tracks.view != 0
    Tracks(tracks.point[seen], tracks.view[seen], tracks.xy[seen]).save(inputs["sfm"] / TRACKS)
    assert run(inputs, CONFIG, tmp_path / "out", silent).state == "ok"
    near, far = read(tmp_path / "out" / SCENE_ZARR).near_far[0]
    assert 0 < near < far < 10 * EXTENT_M
