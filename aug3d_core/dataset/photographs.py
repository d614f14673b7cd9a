"""Registered photographs as a scene, with nothing else made of them: to predict from, not to train on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.by_view import OnDemand
from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.images import fit
from aug3d_core.dataset.on_disk import Cache
from aug3d_core.dataset.real import packed_pictures, seen_depths
from aug3d_core.dataset.scale import ground_distance
from aug3d_core.dataset.scene import GROUPS, REAL, SPLITS, Scene
from aug3d_core.dataset.slab import Slab, slab_of
from aug3d_core.geometry.transforms import homogeneous, invert
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.run.errors import InputError
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS


def usual_slab(points_in_world: Float[np.ndarray, "p 3"]) -> Slab:
    """Return the slab as the stage `dataset` measures it unless told otherwise."""
    usual = DatasetConfig()
    return slab_of(points_in_world, usual.outlier_share, usual.margin_share)


def scene_of_photographs(sfm: Path, size_px: tuple[int, int]) -> Scene:
    """Return all photographs that have a pose, at a size (width, height), over the ground that their points show.

    Each is read when it is asked for, and held while there is room.
    """
    views, points, tracks = Views.load(sfm / VIEWS), Points.load(sfm / POINTS), Tracks.load(sfm / TRACKS)
    if not len(views):
        raise InputError("no photograph has a pose", "give photographs that overlap")
    slab, count = usual_slab(points.xyz), len(views)
    fits = [fit(int(w), int(h), *size_px) for w, h in views.size]
    intrinsics = np.array([f.intrinsics(k) for f, k in zip(fits, views.intrinsics, strict=True)])
    poses = homogeneous(invert(views.cam_from_world))
    cache = Cache()
    images, fine, alpha = (_held(one, i, cache) for i, one in enumerate(packed_pictures(sfm, views, fits)))
    nothing = np.zeros(size_px[::-1], np.float16)
    unknown: Any = OnDemand(count, nothing.shape, np.float16, lambda _: nothing)
    bounds = np.array(
        [
            near_far(slab, pose, lens, size_px, depths)
            for pose, lens, depths in zip(poses, intrinsics, seen_depths(views, points, tracks), strict=True)
        ]
    )
    return Scene(
        images=images,
        fine_images=fine,
        alpha=alpha,
        depth=unknown,
        scaffold=unknown,
        world_from_cam=poses,
        intrinsics=intrinsics,
        near_far=bounds,
        source=np.full(count, REAL, np.uint8),
        photo_id=views.photo_id.astype(np.int32),
        dome_id=np.full(count, -1, np.int32),
        splits=np.full(count, SPLITS.index("support"), np.uint8),
        groups={name: np.zeros((0, 1), np.int32) for name in GROUPS},
        baseline_view=np.zeros(0, np.int32),
        baseline_images=np.zeros((0, *nothing.shape, 3), np.uint8),
        baseline_alpha=np.zeros((0, *nothing.shape), np.uint8),
        slab=slab,
        scale=ground_distance(slab, poses, intrinsics, bounds, size_px),
    )


def _held(pictures: OnDemand, number: int, cache: Cache) -> Any:
    """Return pictures that are read once while the cache has room; `number` tells them from others in it."""

    def get(view: int) -> np.ndarray:
        found = cache.get(number, view)
        if found is None:
            found = pictures[view]
            cache.put(number, view, found)
        return found

    return OnDemand(len(pictures), pictures.shape[1:], pictures.dtype, get)
