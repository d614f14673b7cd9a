from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pycolmap
import pytest
from PIL import Image

from aug3d_core.depth import fusion
from aug3d_core.depth import stage as depth_stage
from aug3d_core.depth.cameras import Camera, camera_of, depth_sizes
from aug3d_core.depth.config import DepthConfig
from aug3d_core.depth.files import (
    BASELINE_FUSED,
    DENSE_WORKSPACE,
    DEPTH_MAPS,
    DEPTH_SHEET,
    FUSED,
    MADE_OF,
    NORMAL_MAPS,
    RAW,
    WORKSPACE_DEPTH_MAPS,
    WORKSPACE_NORMAL_MAPS,
    geometric_map_name,
)
from aug3d_core.depth.job import DepthJob, PhotoTask
from aug3d_core.depth.launch import run_jobs
from aug3d_core.depth.reuse import made_of
from aug3d_core.depth.stage import assist, run
from aug3d_core.geometry.depth_maps import read_map
from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.masks import save_mask, used_pixels
from aug3d_core.geometry.transforms import apply, project
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.run.errors import InputError
from aug3d_core.run.files import EARLIER
from aug3d_core.run.helper_process import WorkerDied
from aug3d_core.run.stage import Inputs, Outcome
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEW_MASKS, VIEWS
from aug3d_core.split.files import SPLIT_TABLE
from tests.engines.little_scene import FOCAL_PX, SIZE, LittleScene, poses

ROLES = ["train"] * 8 + ["gap", "support", "support", "target"]
MAP_PX = 240
QUICK_PX = 96  # where only bytes are compared
SCENE = LittleScene()


def true_depth(camera: Camera) -> np.ndarray:
    """Depth of the nearest of the scene's flat pieces; NaN beside them all."""
    directions = camera.rays @ camera.cam_from_world[:, :3]
    centre = -camera.cam_from_world[:, 3] @ camera.cam_from_world[:, :3]
    nearest = np.full(directions.shape[:2], np.inf)
    for z, low, high in SCENE.planes:
        depth = (z - centre[2]) / directions[..., 2]
        xy = centre[:2] + depth[..., None] * directions[..., :2]
        hit = ((xy >= low) & (xy < high)).all(axis=-1) & (depth < nearest)
        nearest[hit] = depth[hit]
    return np.where(np.isfinite(nearest), nearest, np.nan)


def true_views() -> Views:
    count = len(ROLES)
    intrinsics = np.array([FOCAL_PX, FOCAL_PX, SIZE[0] / 2, SIZE[1] / 2])
    return Views(np.arange(count), poses(), np.tile(intrinsics, (count, 1)), np.tile(SIZE, (count, 1)))


def sparse(views: Views) -> tuple[Points, Tracks]:
    """Points that views really see: where a coarse grid of rays meets the scene, by depth test."""
    rng = np.random.default_rng(0)
    z, low, high = (np.array([piece[i] for piece in SCENE.planes]) for i in range(3))
    piece = np.repeat(np.arange(len(z)), 60)
    xyz = np.column_stack([low[piece] + rng.random((len(piece), 2)) * (high - low)[piece], z[piece]])
    point, view, xy = [], [], []
    for index in range(len(views)):
        camera = camera_of(views, index, views.size[index])
        there = apply(camera.cam_from_world, xyz)
        pixel = project(there, camera.intrinsics)
        inside = np.flatnonzero(((pixel >= 0) & (pixel < SIZE)).all(axis=1))
        x, y = pixel[inside].astype(int).T
        seen = inside[np.abs(true_depth(camera)[y, x] / there[inside, 2] - 1) < 0.01]
        point.append(seen), view.append(np.full(len(seen), index)), xy.append(pixel[seen])
    order = np.lexsort((np.concatenate(view), np.concatenate(point)))
    tracks = Tracks(*(np.concatenate(part)[order] for part in (point, view, xy)))
    return Points(xyz, np.full((len(xyz), 3), 128, np.uint8), np.zeros(len(xyz))), tracks


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    sfm, grouping = tmp_path_factory.mktemp("sfm"), tmp_path_factory.mktemp("grouping")
    (sfm / VIEW_IMAGES).mkdir()
    views = true_views()
    for index, pose in enumerate(views.cam_from_world):
        SCENE.photograph(pose).save(sfm / VIEW_IMAGES / image_name(index))
    points, tracks = sparse(views)
    views.save(sfm / VIEWS), points.save(sfm / POINTS), tracks.save(sfm / TRACKS)
    pd.DataFrame({"view": range(12), "photo_id": range(12), "role": ROLES}).to_parquet(grouping / SPLIT_TABLE)
    return {"sfm": sfm, "grouping": grouping}


def find_depth(inputs: Inputs, out: Path, **config: object) -> Outcome:
    return run(inputs, DepthConfig.model_validate({"max_px": MAP_PX, **config}), out, lambda *_: None)


@pytest.fixture(scope="module")
def found(inputs: Inputs, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    out = tmp_path_factory.mktemp("depth")
    return out, find_depth(inputs, out)


@pytest.fixture(scope="module")
def quick(inputs: Inputs, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    out = tmp_path_factory.mktemp("quick")
    return out, find_depth(inputs, out, max_px=QUICK_PX)


@pytest.fixture
def changed(inputs: Inputs, tmp_path: Path) -> Callable[[str], Inputs]:
    """Return the inputs with the photographs of one role blacked out."""

    def black_out(role: str) -> Inputs:
        sfm = tmp_path / "sfm"
        shutil.copytree(inputs["sfm"], sfm)
        for index in np.flatnonzero(np.array(ROLES) == role).tolist():
            Image.new("RGB", SIZE).save(sfm / VIEW_IMAGES / image_name(index))
        return {"sfm": sfm, "grouping": inputs["grouping"]}

    return black_out


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_depth_is_exact_to_a_fraction_of_a_plane(found: tuple[Path, Outcome]) -> None:
    out, _ = found
    views = true_views()
    for index in (1, 5):
        depth = read_map(out / DEPTH_MAPS / geometric_map_name(index))
        camera = camera_of(views, index, np.array(depth.shape[::-1]))
        error = np.abs(depth / true_depth(camera) - 1)[depth > 0]
        assert (depth > 0).mean() > 0.75
        assert np.median(error) < 0.001, "5 cm at 50 m, where a pixel is 25 cm wide"
        assert (error < 0.01).mean() > 0.95


def test_normals_point_up_and_towards_the_camera(found: tuple[Path, Outcome]) -> None:
    out, _ = found
    normal = read_map(out / NORMAL_MAPS / geometric_map_name(5))
    known = normal.any(axis=-1)
    np.testing.assert_allclose(np.linalg.norm(normal[known], axis=-1), 1, atol=1e-5)
    camera = camera_of(true_views(), 5, np.array(known.shape[::-1]))
    assert ((normal * camera.rays).sum(axis=-1)[known] < 0).all()
    up = normal[known] @ true_views().cam_from_world[5][:, 2]
    assert np.median(up) > 0.98


def test_fused_points_lie_on_the_scene_and_face_up(found: tuple[Path, Outcome]) -> None:
    out, outcome = found
    fused, baseline = Fused.load(out / FUSED), Fused.load(out / BASELINE_FUSED)
    assert outcome.metrics["points"] == len(fused.xyz) < len(baseline.xyz) == outcome.metrics["baseline_points"]
    off = np.abs(fused.xyz[:, 2, None] - np.array([z for z, _, _ in SCENE.planes])).min(axis=1)
    assert np.median(off) < 0.1
    assert np.median(fused.normals[:, 2]) > 0.98
    assert fused.views.min() >= 2
    assert outcome.state == "ok"


def test_spare_photographs_are_neither_swept_nor_compared_with(inputs: Inputs, tmp_path: Path) -> None:
    """The same files come out as if they had never been taken."""
    spare, made = [2, 5], {}
    for name, roles in (("spare", {2: "spare", 5: "spare"}), ("never", {2: "", 5: ""})):
        grouping, out = tmp_path / name / "grouping", tmp_path / name / "depth"
        grouping.mkdir(parents=True), out.mkdir()
        table = pd.DataFrame({"view": range(12), "role": [roles.get(view, ROLES[view]) for view in range(12)]})
        table[table["role"] != ""].to_parquet(grouping / SPLIT_TABLE)
        outcome = find_depth({**inputs, "grouping": grouping}, out, max_px=64)
        made[name] = files(out)
        assert outcome.metrics["photos"] == 9, "eight for training, but two, and those of gap and support"
        assert not any((out / DEPTH_MAPS / geometric_map_name(view)).exists() for view in spare)
    assert made["spare"] == made["never"]


def test_fusion_takes_no_more_than_a_share_of_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own default is to load every map."""
    asked = []

    def fuse(ply: Path, *_: object, options: pycolmap.StereoFusionOptions, **__: object) -> None:
        asked.append(options)
        raise InterruptedError

    monkeypatch.setattr(pycolmap, "stereo_fusion", fuse)
    (tmp_path / "stereo").mkdir()
    with pytest.raises(InterruptedError):
        fusion.fuse(tmp_path, true_views(), [0, 1, 2])
    assert asked[0].use_cache
    assert 0 < asked[0].cache_size < psutil.virtual_memory().total / 2**30


def test_colmap_reads_the_workspace(found: tuple[Path, Outcome]) -> None:
    out, _ = found
    model = pycolmap.Reconstruction(out / DENSE_WORKSPACE / "sparse")
    assert model.num_images() == 11
    assert model.compute_mean_reprojection_error() < 1e-6, "pixels, cameras and poses fit the points"
    for image in model.images.values():
        path = out / DEPTH_MAPS / f"{image.name}.geometric.bin"
        camera = model.camera(image.camera_id)
        assert read_map(path).shape == (camera.height, camera.width)


def test_targets_are_never_used(quick: tuple[Path, Outcome], changed: Callable[[str], Inputs], tmp_path: Path) -> None:
    find_depth(changed("target"), tmp_path / "out", max_px=QUICK_PX)
    assert files(tmp_path / "out") == files(quick[0])


def test_train_points_come_from_train_photos_alone(
    quick: tuple[Path, Outcome], changed: Callable[[str], Inputs], tmp_path: Path
) -> None:
    find_depth(changed("support"), tmp_path / "out", max_px=QUICK_PX)
    before, after = files(quick[0]), files(tmp_path / "out")
    assert after[FUSED] == before[FUSED]
    assert after[BASELINE_FUSED] != before[BASELINE_FUSED]
    for index in range(8):
        name = f"{DEPTH_MAPS}/{geometric_map_name(index)}"
        assert after[name] == before[name]


def test_only_maps_that_a_change_touches_are_made_again(
    quick: tuple[Path, Outcome], changed: Callable[[str], Inputs], tmp_path: Path
) -> None:
    """Maps of train photographs are made of train photographs alone; the bytes are those of a run without earlier maps."""
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "00").symlink_to(quick[0])
    inputs = changed("support")
    fresh = find_depth(inputs, tmp_path / "fresh", max_px=QUICK_PX)
    grown = find_depth({**inputs, EARLIER: tmp_path / "earlier"}, tmp_path / "grown", max_px=QUICK_PX)
    assert files(tmp_path / "grown") == files(tmp_path / "fresh")
    assert (fresh.metrics["photos_reused"], grown.metrics["photos_reused"]) == (0, 8)
    again = find_depth({**inputs, EARLIER: tmp_path}, tmp_path / "again", max_px=QUICK_PX)
    assert (again.metrics["photos_reused"], again.metrics["seconds_per_photo"]) == (again.metrics["photos"], None)
    assert files(tmp_path / "again") == files(tmp_path / "fresh")


@pytest.mark.parametrize("part", ["pose", "image", "mask", "range"])
def test_maps_are_known_by_all_that_they_are_made_of(inputs: Inputs, tmp_path: Path, part: str) -> None:
    """Of the views 0 <- 1 <- 2 and 3 <- 4, a change of the second changes the digests of the first three."""
    shutil.copytree(inputs["sfm"], tmp_path / "sfm")
    views, images, masks = true_views(), tmp_path / "sfm" / VIEW_IMAGES, tmp_path / "sfm" / VIEW_MASKS
    sizes = depth_sizes(views, QUICK_PX)
    listed = {0: (1,), 1: (2,), 2: (1,), 3: (4,), 4: (3,)}
    tasks = [
        PhotoTask(view=view, sources=others, others=others, depth=(40, 60), height=(0, 10))
        for view, others in listed.items()
    ]
    before = made_of(tasks, views, sizes, images, masks)
    if part == "pose":
        views.cam_from_world[1, 0, 3] += 1e-9
    elif part == "image":
        Image.new("RGB", SIZE).save(images / image_name(1))
    elif part == "mask":
        save_mask(np.zeros(SIZE[::-1], bool), masks / image_name(1))
    else:
        tasks[1] = tasks[1].model_copy(update={"height": (0, 11)})
    after = made_of(tasks, views, sizes, images, masks)
    assert {view for view in before if before[view] != after[view]} == {0, 1, 2}


def test_the_number_of_workers_changes_nothing(
    quick: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(depth_stage, "WORKERS", 1)
    find_depth(inputs, tmp_path, max_px=QUICK_PX)
    assert files(tmp_path) == files(quick[0])


def test_killed_in_both_steps_it_goes_on_and_ends_in_the_same_bytes(
    found: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path
) -> None:
    """What a try has made is not made again: the raw maps keep their time until the comparison ends."""
    photos = found[1].metrics["photos"]
    assert isinstance(photos, int)
    times: list[dict[str, int]] = []
    for at in (4, photos + 4):

        def kill(done: int, total: int, what: str, at: int = at) -> None:
            if done == at:
                times.append({file.name: file.stat().st_mtime_ns for file in (tmp_path / RAW).glob("[!.]*.planes")})
                for child in psutil.Process().children():
                    if "aug3d_core.depth.worker" in child.cmdline():
                        child.kill()

        with pytest.raises(WorkerDied, match="SIGKILL"):
            run(inputs, DepthConfig(max_px=MAP_PX), tmp_path, kill)
    assert 1 < len(times[0]) < photos == len(times[1])
    assert times[0].items() <= times[1].items()
    outcome = find_depth(inputs, tmp_path)
    assert files(tmp_path) == files(found[0])
    assert outcome.metrics == found[1].metrics | {"seconds_per_photo": None}


@pytest.mark.parametrize("lost", [0, 1])
def test_stopped_at_fusing_it_sweeps_and_compares_no_photo_again(
    lost: int, quick: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But where a map that was compared is lost, as with the machine that made it: its raw maps are gone already."""

    def stop(*_: object) -> None:
        raise InterruptedError

    with monkeypatch.context() as patched, pytest.raises(InterruptedError):
        patched.setattr(depth_stage, "fuse_to", stop)
        find_depth(inputs, tmp_path, max_px=QUICK_PX)
    assert not [*(tmp_path / RAW).glob("*.bin")], "they take as much of the disk as all the rest"
    made = sorted((tmp_path / NORMAL_MAPS).iterdir())
    for file in made[:lost]:
        file.unlink()
    times = [file.stat().st_mtime_ns for file in made[lost:]]
    outcome = find_depth(inputs, tmp_path, max_px=QUICK_PX)
    assert [file.stat().st_mtime_ns for file in made[lost:]] == times
    assert (outcome.metrics["seconds_per_photo"] is None) == (not lost)
    assert files(tmp_path) == files(quick[0])


def test_what_another_machine_has_swept_is_used_and_the_bytes_are_the_same(
    quick: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path
) -> None:
    photos = quick[1].metrics["photos"]
    told: list[int] = []
    assist(inputs, DepthConfig(max_px=QUICK_PX), tmp_path, lambda done, total, what: told.append(done))
    assert len(list((tmp_path / RAW).glob("[!.]*.planes"))) == len(told) == photos
    times = {file.name: file.stat().st_mtime_ns for file in (tmp_path / RAW).iterdir()}
    assist(inputs, DepthConfig(max_px=QUICK_PX), tmp_path, lambda *_: None)
    assert times == {file.name: file.stat().st_mtime_ns for file in (tmp_path / RAW).iterdir()}
    assert find_depth(inputs, tmp_path, max_px=QUICK_PX).metrics["seconds_per_photo"] is None
    assert files(tmp_path) == files(quick[0])


def cuda(monkeypatch: pytest.MonkeyPatch, devices: int) -> None:
    """Take this pycolmap for one that was built with CUDA: others lack the function that counts devices."""
    monkeypatch.setattr(pycolmap, "has_cuda", True)
    monkeypatch.setattr(pycolmap, "get_num_cuda_devices", lambda: devices, raising=False)


def test_patch_match_without_cuda_is_refused(inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pycolmap, "has_cuda", False)
    with pytest.raises(InputError, match=r"depth\.engine=patch_match cannot run: this pycolmap was built without CUDA"):
        find_depth(inputs, tmp_path, engine="patch_match")


def test_patch_match_needs_a_gpu_that_is_there(inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cuda(monkeypatch, devices=0)
    with pytest.raises(InputError, match="no CUDA GPU is visible"):
        find_depth(inputs, tmp_path, engine="patch_match")


def test_a_gpu_does_not_change_how_depth_is_found(
    quick: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cuda(monkeypatch, devices=1)
    assert find_depth(inputs, tmp_path, max_px=QUICK_PX).metrics["engine"] == quick[1].metrics["engine"] == "sweep"


def shared_by(inputs: Inputs, sfm: Path, kept: Callable[[Tracks], np.ndarray]) -> Inputs:
    """Return the inputs with only some of the observations."""
    shutil.copytree(inputs["sfm"], sfm)
    tracks = Tracks.load(sfm / TRACKS)
    chosen = kept(tracks)
    Tracks(tracks.point[chosen], tracks.view[chosen], tracks.xy[chosen]).save(sfm / TRACKS)
    return {"sfm": sfm, "grouping": inputs["grouping"]}


def test_a_photo_that_overlaps_with_none_has_no_depth_and_is_told(inputs: Inputs, tmp_path: Path) -> None:
    lonely = shared_by(inputs, tmp_path / "sfm", lambda tracks: tracks.view != 3)
    outcome = find_depth(lonely, tmp_path / "out", max_px=96)
    assert outcome.state == "degraded"
    assert "1 photos share too few points with any other and have no depth: 3" in outcome.notes
    assert not (tmp_path / "out" / DEPTH_MAPS / geometric_map_name(3)).exists()
    assert outcome.metrics["photos"] == 10


def beside_the_others(inputs: Inputs, sfm: Path) -> Inputs:
    """Return the inputs with train view 3 overlapping only with views that are not for training."""
    return shared_by(inputs, sfm, lambda tracks: (tracks.view >= 8) | ((tracks.view == 3) == (tracks.point % 2 == 0)))


def test_a_train_photo_that_overlaps_with_no_other_has_no_depth_and_confirms_none(
    inputs: Inputs, tmp_path: Path
) -> None:
    aside = beside_the_others(inputs, tmp_path / "sfm")
    outcome = find_depth(aside, tmp_path / "out", max_px=96)
    assert "1 photos share too few points with any other and have no depth: 3" in outcome.notes
    assert outcome.metrics["photos"] == 10


def test_patch_match_gets_what_the_workspace_holds_and_its_maps_are_fused(
    found: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lists are COLMAP's, and it dies of a name that its model lacks; the maps are the sweep's."""
    aside = beside_the_others(inputs, tmp_path / "sfm")

    def stand_in(workspace: Path) -> None:
        held = {image.name for image in pycolmap.Reconstruction(workspace / "sparse").images.values()}
        lines = (workspace / "stereo/patch-match.cfg").read_text().splitlines()
        sources = {name: set(listed.split(", ")) for name, listed in zip(lines[::2], lines[1::2], strict=True)}
        assert sources.keys() == held == {image_name(index) for index in range(11) if index != 3}
        assert set().union(*sources.values()) <= held
        train = {image_name(index) for index in range(8)}
        assert all(sources[name] <= train for name in train & held)
        for folder in (WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS):
            for index in set(range(11)) - {3}:
                name = geometric_map_name(index)
                shutil.copy(found[0] / DENSE_WORKSPACE / folder / name, workspace / folder)
                (workspace / folder / name.replace("geometric", "photometric")).touch()

    cuda(monkeypatch, devices=1)
    monkeypatch.setattr(depth_stage, "patch_match", stand_in)
    outcome = find_depth(aside, tmp_path / "out", sources=10, engine="patch_match")
    assert (outcome.metrics["engine"], outcome.metrics["photos"]) == ("patch_match", 10)
    maps = [*(tmp_path / "out" / DENSE_WORKSPACE).rglob("*.bin")]
    assert len([file for file in maps if "geometric" in file.name]) == 20
    assert not [file for file in maps if "photometric" in file.name], "nobody reads them"
    off = np.abs(Fused.load(tmp_path / "out" / FUSED).xyz[:, 2, None] - [z for z, _, _ in SCENE.planes]).min(axis=1)
    assert np.median(off) < 0.1


LORRY = (slice(60, 140), slice(40, 160))  # rows and columns of what moves along with the camera


def with_lorry(inputs: Inputs, folder: Path, colour: int = 1) -> Inputs:
    """Return the inputs with a thing in each photograph but one, masked."""
    sfm = shutil.copytree(inputs["sfm"], folder)
    used = np.ones(SIZE[::-1], bool)
    used[LORRY] = False
    pattern = np.random.default_rng(colour).integers(0, 256, (80, 120, 1), dtype=np.uint8)
    for file in sorted((sfm / VIEW_IMAGES).iterdir())[1:]:
        with Image.open(file) as image:
            pixels = np.array(image)
        pixels[LORRY] = pattern
        Image.fromarray(pixels).save(file)
        save_mask(used, sfm / VIEW_MASKS / file.name)
    return {"sfm": sfm, "grouping": inputs["grouping"]}


def depth_in_lorry(out: Path, index: int) -> np.ndarray:
    depth = read_map(out / DEPTH_MAPS / geometric_map_name(index))
    used = np.ones(SIZE[::-1], bool)
    used[LORRY] = False
    return depth[~np.asarray(Image.fromarray(used).resize(depth.shape[::-1], Image.Resampling.NEAREST))]


def test_what_is_masked_has_no_depth_and_does_not_matter(
    found: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path
) -> None:
    """Whatever stands there, every map and every fused point is the same."""
    outcome = find_depth(with_lorry(inputs, tmp_path / "one"), tmp_path / "out")
    find_depth(with_lorry(inputs, tmp_path / "two", colour=2), tmp_path / "other")
    some, other = files(tmp_path / "out"), files(tmp_path / "other")
    assert {name for name in some if some[name] != other[name]} == {DEPTH_SHEET, MADE_OF}
    for index in range(1, 11):
        assert (depth_in_lorry(tmp_path / "out", index) > 0).mean() < 0.06, "but for its rim, half of a pixel wide"
    assert (depth_in_lorry(tmp_path / "out", 0) > 0).mean() > 0.2, "it has no mask, and others see some of it"
    assert (depth_in_lorry(found[0], 5) > 0).mean() > 0.5
    assert outcome.metrics["consistent_share"] == pytest.approx(found[1].metrics["consistent_share"], abs=0.08)
    off = np.abs(Fused.load(tmp_path / "out" / FUSED).xyz[:, 2, None] - [z for z, _, _ in SCENE.planes]).min(axis=1)
    assert np.median(off) < 0.1


def test_patch_match_sees_nothing_of_what_is_masked_and_its_depth_there_is_dropped(
    found: tuple[Path, Outcome], inputs: Inputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    masked = with_lorry(inputs, tmp_path / "sfm")

    def stand_in(workspace: Path) -> None:
        with Image.open(workspace / "images" / image_name(4)) as image:
            used = used_pixels(masked["sfm"] / VIEW_MASKS / image_name(4), image.size)
            assert used is not None
            assert not np.asarray(image)[~used].any()
            assert np.asarray(image)[used].any()
        for folder in (WORKSPACE_DEPTH_MAPS, WORKSPACE_NORMAL_MAPS):
            shutil.copytree(found[0] / DENSE_WORKSPACE / folder, workspace / folder, dirs_exist_ok=True)

    cuda(monkeypatch, devices=1)
    monkeypatch.setattr(depth_stage, "patch_match", stand_in)
    find_depth(masked, tmp_path / "out", engine="patch_match")
    for index in range(11):
        name = geometric_map_name(index)
        depth, normals = (read_map(tmp_path / "out" / folder / name) for folder in (DEPTH_MAPS, NORMAL_MAPS))
        used = used_pixels(masked["sfm"] / VIEW_MASKS / image_name(index), depth.shape[::-1])
        before = read_map(found[0] / DEPTH_MAPS / name)
        np.testing.assert_array_equal(depth, before if used is None else np.where(used, before, 0))
        assert used is None or not normals[~used].any()


def test_photos_without_any_overlap_are_refused(inputs: Inputs, tmp_path: Path) -> None:
    nothing = shared_by(inputs, tmp_path / "sfm", lambda tracks: tracks.view == 0)
    with pytest.raises(InputError, match="no photograph shares enough points with another"):
        find_depth(nothing, tmp_path / "out")


def test_a_worker_that_dies_says_its_last_words(inputs: Inputs, tmp_path: Path) -> None:
    job = DepthJob(
        step="sweep",
        views=tmp_path / "missing.npz",
        images=tmp_path,
        masks=tmp_path,
        raw=tmp_path,
        workspace=tmp_path,
        max_px=96,
        plane_step_px=2.0,
        tasks=(),
    )
    with pytest.raises(WorkerDied, match=r"missing\.npz"):
        run_jobs([job], lambda: None)


@pytest.mark.parametrize("part", [1, 3, 1000])
def test_the_photographs_of_points_are_counted_in_parts_of_any_size(
    part: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts, rng = [2, 5, 3, 300, 2, 2, 7], np.random.default_rng(0)
    numbers = [number for count in counts for number in (count, *rng.integers(0, 400, count))]
    (tmp_path / "vis").write_bytes(np.uint64(len(counts)).tobytes() + np.array(numbers, "<u4").tobytes())
    monkeypatch.setattr(fusion, "_PART", part)
    assert fusion._read_counts(tmp_path / "vis", len(counts)).tolist() == [2, 5, 3, 255, 2, 2, 7]
