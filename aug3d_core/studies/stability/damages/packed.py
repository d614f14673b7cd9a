"""Damage to the packed scene: bounds, slab and scaffold wrong, input views that lie, training in the dark."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import REAL, SPLITS, Scene
from aug3d_core.dataset.writer import write


def bounds_times(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Multiply near and far of every view."""
    scene = read(folder / SCENE_ZARR)
    _write(replace(scene, near_far=scene.near_far * dose), folder)


def unrelated(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Give this share of the views that the test predicts from the picture of the photograph that stands farthest away."""
    scene = read(folder / SCENE_ZARR)
    real = np.flatnonzero(scene.source == REAL)
    given = np.flatnonzero(scene.splits == SPLITS.index("support"))
    chosen = rng.permutation(given)[: round(dose * len(given))]
    at, images, fine = scene.world_from_cam[:, :3, 3], scene.images.copy(), scene.fine_images.copy()
    for view in chosen:
        farthest = real[np.linalg.norm(at[real] - at[view], axis=1).argmax()]
        images[view], fine[view] = scene.images[farthest], scene.fine_images[farthest]
    _write(replace(scene, images=images, fine_images=fine), folder)


def darker_training(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Make every view of training so many times darker; photographs of the test stay as they are."""
    scene = read(folder / SCENE_ZARR)
    dark = scene.splits == SPLITS.index("train")
    _write(_lit(scene, dark, 1 / dose), folder)


def brighter_inputs(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Make the views that the test predicts from so many times as bright."""
    scene = read(folder / SCENE_ZARR)
    _write(_lit(scene, scene.splits == SPLITS.index("support"), dose), folder)


def shifted_inputs(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Move the views that the test predicts from, each in a direction of its own, by this share of the height of flight."""
    scene = read(folder / SCENE_ZARR)
    given, poses = np.flatnonzero(scene.splits == SPLITS.index("support")), scene.world_from_cam.copy()
    way = rng.normal(size=(len(given), 3))
    poses[given, :3, 3] += dose * scene.scale * way / np.linalg.norm(way, axis=1, keepdims=True)
    _write(replace(scene, world_from_cam=poses), folder)


def raised_slab(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Raise the layer between ground and roofs by so many times its thickness."""
    scene = read(folder / SCENE_ZARR)
    up = dose * (scene.slab.high - scene.slab.low)
    slab = replace(scene.slab, low=scene.slab.low + up, high=scene.slab.high + up)
    _write(replace(scene, slab=slab), folder)


def raised_scaffold(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Bring the scaffold of every view nearer, by so many times the slab's thickness along the camera's z."""
    scene = read(folder / SCENE_ZARR)
    nearer = scene.scaffold.astype(float) - dose * (scene.slab.high - scene.slab.low)
    kept = (scene.scaffold > 0) & (nearer > 0)
    _write(replace(scene, scaffold=np.where(kept, nearer, 0).astype(np.float16)), folder)


def torn_scaffold(folder: Path, dose: float, rng: np.random.Generator) -> None:
    """Take this share of the scaffold of every view away, in round places."""
    scene = read(folder / SCENE_ZARR)
    y, x = np.mgrid[: scene.height_px, : scene.width_px]
    scaffold = scene.scaffold.copy()
    for depth in scaffold:
        middles = rng.random((20, 2)) * depth.shape
        order = np.min([np.hypot(y - v, x - u) for v, u in middles], axis=0)  # how early a pixel is lost
        depth.ravel()[np.argsort(order, axis=None)[: round(dose * order.size)]] = 0
    _write(replace(scene, scaffold=scaffold), folder)


def _lit(scene: Scene, views: Bool[np.ndarray, " n"], times: float) -> Scene:
    """Return the scene with some views so many times as bright."""
    lit = {name: getattr(scene, name).copy() for name in ("images", "fine_images")}
    for pictures in lit.values():
        pictures[views] = np.clip(np.rint(pictures[views] * times), 0, 255).astype(np.uint8)
    return replace(scene, **lit)


def _write(scene: Scene, folder: Path) -> None:
    shutil.rmtree(folder / SCENE_ZARR)
    write(scene, folder / SCENE_ZARR, DatasetConfig().shard_views)
