"""The DTU layout, read back step by step as the original loader does, and with its matrices used as projections."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.linalg import rq

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.scene import Scene
from aug3d_core.dataset.writer import write
from aug3d_core.export.dtu import CATEGORY, FAR, NEAR, cameras, export_dtu
from aug3d_core.geometry.transforms import apply, invert, project
from aug3d_core.run.errors import DiskFull, InputError, UsageError
from tests.export.full_disk import full_disk
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A scene whose principal point is in no middle, and whose world is far from its origin."""
    toy = toy_scene(0, 16, 12)
    poses = toy.world_from_cam.copy()
    poses[:, :2, 3] += [500.0, -300.0]
    return replace(toy, world_from_cam=poses, intrinsics=toy.intrinsics + np.array([0, 0.5, 0.7, -0.3]))


@pytest.fixture(scope="module")
def exported(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dtu")
    write(scene, folder / SCENE_ZARR, shard_views=64)
    written = export_dtu(folder, folder / "out")
    assert written.views == sum(members.size for members in scene.groups.values())
    assert written.intrinsics_off_px == pytest.approx(0, abs=1e-9)
    return folder / "out"


def decomposed(projection: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (K, R, centre) of a 3 x 4 projection, with a positive diagonal in K."""
    k, rotation = rq(projection[:, :3])
    signs = np.diag(np.sign(np.diag(k)))
    k, rotation = k @ signs, signs @ rotation
    return k / k[2, 2], rotation, -np.linalg.solve(projection[:, :3], projection[:, 3])


def loaded(scan: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (images, world_from_cam scaled, mean K) of a scan, by the loader's steps: pictures in order of name, K, R and
    centre out of each projection, the centre moved and scaled, K averaged."""
    pictures = []
    for path in sorted((scan / "image").glob("*.png")):
        with Image.open(path) as image:
            pictures.append(np.asarray(image)[..., :3])
    stored = np.load(scan / "cameras.npz")
    poses, ks = [], []
    for i in range(len(pictures)):
        k, rotation, centre = decomposed(stored[f"world_mat_{i}"][:3])
        scale_mat = stored[f"scale_mat_{i}"]
        centre = (centre - scale_mat[:3, 3]) / np.diagonal(scale_mat[:3, :3])
        poses.append(np.column_stack([rotation.T, centre]))
        ks.append(k)
    return np.stack(pictures), np.stack(poses), np.mean(ks, axis=0)


def test_the_lists_name_every_group_once_and_test_apart(scene: Scene, exported: Path) -> None:
    lists = {name: (exported / CATEGORY / f"new_{name}.lst").read_text().split() for name in ("train", "val", "test")}
    assert sorted(chain(*lists.values())) == sorted(p.name for p in (exported / CATEGORY).iterdir() if p.is_dir())
    assert lists["test"] == [f"test_{i:05d}" for i in range(len(scene.groups["test"]))]
    assert lists["val"] == ["real_00009"]
    assert not any(name.startswith("test") for name in lists["train"])


@pytest.mark.parametrize("kind", ["real", "rendered", "test"])
def test_what_the_loader_sees_projects_as_the_scene_does(kind: str, scene: Scene, exported: Path) -> None:
    images, poses, k = loaded(exported / CATEGORY / f"{kind}_00000")
    members = scene.groups[kind][0]
    assert np.array_equal(images, scene.images[members])
    scale_mat = np.load(exported / CATEGORY / f"{kind}_00000" / "cameras.npz")["scale_mat_0"]
    points = scene.slab.c + np.random.default_rng(0).uniform([480, -320, 0], [520, -280, 9], (50, 3))
    scaled = (points - scale_mat[:3, 3]) / scale_mat[0, 0]
    for view, pose in zip(members, poses, strict=True):
        ours = project(apply(invert(scene.world_from_cam[view][:3]), points), scene.intrinsics[view])
        theirs = project(apply(invert(pose), scaled), np.array([k[0, 0], k[1, 1], k[0, 2], k[1, 2]]))
        np.testing.assert_allclose(theirs + 0.5, ours, atol=1e-6)  # their pixel centres are integers


def test_the_two_matrices_together_are_a_projection_of_scaled_points(scene: Scene) -> None:
    members = scene.groups["real"][0]
    found = cameras(scene, members, "scan")
    scaled = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 3))
    points = scaled * found["scale_mat_1"][0, 0] + found["scale_mat_1"][:3, 3]
    together = apply((found["world_mat_1"] @ found["scale_mat_1"])[:3], scaled)
    ours = project(apply(invert(scene.world_from_cam[members[1]][:3]), points), scene.intrinsics[members[1]])
    np.testing.assert_allclose(together[:, :2] / together[:, 2:] + 0.5, ours, atol=1e-6)


@pytest.mark.parametrize("kind", ["real", "rendered", "test"])
def test_all_that_views_show_lies_within_the_loader_s_bounds(kind: str, scene: Scene, exported: Path) -> None:
    scale = np.load(exported / CATEGORY / f"{kind}_00000" / "cameras.npz")["scale_mat_0"][0, 0]
    for view in scene.groups[kind][0]:
        near, far = scene.near_far[view]
        corner = np.linalg.norm(
            np.append((np.array([0, 0]) - scene.intrinsics[view, 2:]) / scene.intrinsics[view, :2], 1)
        )
        assert near / scale > NEAR
        assert far * corner / scale < FAR


def test_bounds_that_cannot_fit_are_refused(scene: Scene) -> None:
    bounds = scene.near_far.copy()
    bounds[scene.groups["real"][0, 2]] = [0.01, 5000.0]
    with pytest.raises(InputError, match=r"scan real_00000: near 0\.01 and far"):
        cameras(replace(scene, near_far=bounds), scene.groups["real"][0], "real_00000")


def test_cameras_that_differ_within_a_scan_are_measured(scene: Scene, tmp_path: Path) -> None:
    intrinsics = scene.intrinsics.copy()
    intrinsics[scene.groups["rendered"][0, 0], 0] += 4.0
    write(replace(scene, intrinsics=intrinsics), tmp_path / SCENE_ZARR, shard_views=64)
    assert export_dtu(tmp_path, tmp_path / "out").intrinsics_off_px == pytest.approx(4 * 5 / 6)


def test_nothing_is_overwritten(exported: Path) -> None:
    with pytest.raises(UsageError, match="not an empty folder"):
        export_dtu(exported.parent, exported)


def test_where_the_disk_is_full_it_is_named_and_nothing_is_left(
    exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "write_text", full_disk)
    with pytest.raises(DiskFull, match=f"{tmp_path}/out: .*No space left"):
        export_dtu(exported.parent, tmp_path / "out")
    assert not (tmp_path / "out").exists()
