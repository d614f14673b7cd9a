"""A finished scene in a store, made of the toy world: what `aug3d view` reads, and a network that learned nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from PIL import Image

from aug3d_core.dataset.scene import REAL, SPLITS, Scene
from aug3d_core.dataset.writer import write
from aug3d_core.domes.cameras import Cameras
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import invert
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.heads import saved
from aug3d_core.heads.head import build
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.photos.files import image_name
from aug3d_core.run.files import FILES
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from tests.toy_scene import toy_scene, toy_world

SIZE_PX = (64, 48)
CONFIG = SweepConfig(planes=8, fine_planes=3, features=4, crop_px=32, start="random")
_FIELDS = {
    "recipe": "r", "config": {"input_views": 3}, "inputs": {}, "versions": {}, "metrics": {}, "state": "ok", "notes": (),
    "series": {}, "pictures": {}, "seconds": 1.0, "peak_mib": 1.0,
}  # fmt: skip


def finished_scene(home: Path, name: str = "toy", without: tuple[str, ...] = ()) -> Scene:
    """Write a scene into a store, and return what its data set holds. without: steps that its run did not come to."""
    (scene, mesh), store, records = _toy(), Store(home), {}
    for stage, fill in _STAGES.items():
        if stage not in without:
            files = store.work_dir(stage, "k") / FILES
            files.mkdir(parents=True)
            fill(files, scene, mesh)
            records[stage] = store.commit(store.work_dir(stage, "k"), stage, "k", _FIELDS)
    version = new_version(store, name)
    write_metrics(version, {"scene": name, "paths": version_paths(store, version, records)})
    return scene


@cache
def _toy() -> tuple[Scene, Mesh]:
    world = toy_world(np.random.default_rng(0))
    return toy_scene(0, *SIZE_PX, world=world), world.mesh()


def _views(scene: Scene) -> Views:
    real = np.flatnonzero(scene.source == REAL)
    poses = invert(scene.world_from_cam[real, :3])
    return Views(real, poses, scene.intrinsics[real], np.tile(SIZE_PX, (len(real), 1)))


def _photos(files: Path, scene: Scene, _mesh: Mesh) -> None:
    ids = np.flatnonzero(scene.source == REAL)
    table = pd.DataFrame({"photo_id": ids, "name": [f"drone_{one}.jpg" for one in ids]})
    table.to_parquet(files / "photos.parquet")


def _sfm(files: Path, scene: Scene, mesh: Mesh) -> None:
    views = _views(scene)
    views.save(files / "views.npz")
    points = mesh.xyz[4:].astype(float)
    Points(points, np.full(points.shape, 200, np.uint8), np.full(len(points), 0.5)).save(files / "points.npz")
    seen = np.arange(len(points))
    Tracks(seen, seen % len(views), np.zeros((len(points), 2))).save(files / "tracks.npz")
    (files / "images").mkdir()
    for row in range(len(views)):
        Image.fromarray(scene.images[row]).save(files / "images" / image_name(row))


def _grouping(files: Path, scene: Scene, _mesh: Mesh) -> None:
    real = np.flatnonzero(scene.source == REAL)
    roles = [SPLITS[scene.splits[row]] for row in real]
    pd.DataFrame({"view": real, "role": roles}).to_parquet(files / "split.parquet")
    with (files / "groups.npz").open("wb") as file:
        np.savez(file, members=scene.groups["real"], test_members=scene.groups["test"])


def _sampling(files: Path, scene: Scene, _mesh: Mesh) -> None:
    rows = np.flatnonzero(scene.source != REAL)
    size = np.tile(SIZE_PX, (len(rows), 1))
    poses, intrinsics = scene.world_from_cam[rows], scene.intrinsics[rows]
    Cameras(rows, scene.dome_id[rows], poses, intrinsics, size).save(files / "cameras.npz")


def _surface(files: Path, _scene: Scene, mesh: Mesh) -> None:
    mesh.save(files / "baseline_mesh.ply")


def _dataset(files: Path, scene: Scene, _mesh: Mesh) -> None:
    write(replace(scene, attributes={}), files / "scene.zarr", shard_views=16)


def _training(files: Path, _scene: Scene, _mesh: Mesh) -> None:
    torch.manual_seed(0)
    saved.save(build(CONFIG), files)


_STAGES = {
    "photos": _photos,
    "sfm": _sfm,
    "grouping": _grouping,
    "sampling": _sampling,
    "surface": _surface,
    "dataset": _dataset,
    "training": _training,
}
