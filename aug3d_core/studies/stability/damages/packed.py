"""Damage to the packed scene: near and far wrong, input views that show something else, training in the dark."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

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
    at, images = scene.world_from_cam[:, :3, 3], scene.images.copy()
    for view in chosen:
        farthest = real[np.linalg.norm(at[real] - at[view], axis=1).argmax()]
        images[view] = scene.images[farthest]
    _write(replace(scene, images=images), folder)


def darker_training(folder: Path, dose: float, _rng: np.random.Generator) -> None:
    """Make every view of training so many times darker; photographs of the test stay as they are."""
    scene = read(folder / SCENE_ZARR)
    dark = scene.splits == SPLITS.index("train")
    images = scene.images.copy()
    images[dark] = np.rint(images[dark] / dose).astype(np.uint8)
    _write(replace(scene, images=images), folder)


def _write(scene: Scene, folder: Path) -> None:
    shutil.rmtree(folder / SCENE_ZARR)
    write(scene, folder / SCENE_ZARR, DatasetConfig().shard_views)
