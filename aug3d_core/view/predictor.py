"""A trained model that stays loaded and predicts what a camera sees, one view after another.

A view is predicted as `aug3d predict` does, but from a scaffold that is made in milliseconds: the points of its inputs'
scaffolds, seen from there. While the camera moves, its holes are filled with the ground: the model need not search them.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional as F

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.new_views import only
from aug3d_core.dataset.on_disk import Cache
from aug3d_core.dataset.rays import pixel_rays
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import REAL, SPLITS, VIEW_ARRAYS, Scene
from aug3d_core.heads import saved
from aug3d_core.heads.head import Head
from aug3d_core.run.errors import InputError
from aug3d_core.view.finished import packed
from aug3d_core.view.inputs import Candidates
from aug3d_core.view.pictures import Predicted
from aug3d_core.view.poses import Pose, fov_of, intrinsics_of

_KEPT = 64  # photographs whose points stay in memory
_GROUPS = 8  # of inputs, whose pictures do
_EVERY = 97  # of the points, for the nearest and the farthest


class Predictor:
    """A model and the packed scene that it was trained on."""

    def __init__(self, scene: Scene, head: Head, input_views: int) -> None:
        self.scene, self.head, self.input_views = scene, head, input_views
        self._candidates = Candidates.of(scene)
        if not len(self._candidates.rows):
            raise InputError("the data set holds no photographs to predict from", "run the scene again")
        self._origin = scene.world_from_cam[self._candidates.rows, :3, 3].mean(axis=0)
        self._points: Callable[[int], Tensor] = lru_cache(_KEPT)(self._points_of)
        self._inputs: Callable[[tuple[int, ...], bool], Scene] = lru_cache(_GROUPS)(self._inputs_of)
        self._turn = threading.Lock()  # a film and the camera ask from two threads

    @classmethod
    def load(cls, dataset: Path, training: Path, input_views: int) -> Predictor:
        """Read a data set and a trained model; raises InputError if either is damaged."""
        # One core is the browser's: with a thread on each, they wait for each other, and a view takes many times as long
        torch.set_num_threads(max(1, len(os.sched_getaffinity(0)) - 1))
        return cls(read(packed(dataset), Cache()), saved.load(training), input_views)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of a view."""
        return self.scene.width_px, self.scene.height_px

    @property
    def fov_rad(self) -> float:
        """How high the usual photograph is, as an angle."""
        intrinsics = np.median(self.scene.intrinsics[self._candidates.rows], axis=0)
        return fov_of(intrinsics, self.scene.height_px)

    def predict(self, pose: Pose, quick: bool = False, half: bool = False) -> Predicted:
        """Predict what a camera sees; raises InputError if no photograph shows any of it.

        quick: fill what no scaffold shows with the ground. half: of half the width and height.
        """
        with self._turn, torch.inference_mode():
            begun = time.perf_counter()
            given = self._candidates.chosen(
                pose.world_from_cam, intrinsics_of(pose.fov_rad, self.size_px), self.input_views
            )
            if not len(given):
                raise InputError("no photograph shows what is in view", "move or turn towards the photographs")
            scene = self._with_view(given, pose, quick, half)
            view = self.head.predict_bare(scene, len(given), np.arange(len(given)))
            ids = tuple(int(one) for one in self.scene.photo_id[given])
            return Predicted(view.colour, view.depth, view.seen, ids, half, time.perf_counter() - begun)

    def _with_view(self, given: Int[np.ndarray, " v"], pose: Pose, quick: bool, half: bool) -> Scene:
        """Return the inputs, and the view without pixels as the last row; the pictures are those of `_inputs`, not copies."""
        small = self._inputs(tuple(map(int, given)), half)
        size_px = (small.width_px, small.height_px)
        intrinsics = intrinsics_of(pose.fov_rad, size_px)
        points = torch.cat([self._points(int(row)) for row in given])
        depth, along = self._seen_from(points, pose.world_from_cam, intrinsics, size_px)
        bare = depth == 0
        if not len(along) or (quick and bare.any()):
            ground = _ground(small, pose.world_from_cam, intrinsics)
            depth = np.where(bare, ground, depth) if quick else depth
            along = along if len(along) else ground[ground > 0]
        if not len(along):
            raise InputError("the view shows neither the ground nor anything else", "turn it down")
        added = {
            "scaffold": depth,
            "world_from_cam": pose.world_from_cam,
            "intrinsics": intrinsics,
            "near_far": near_far(small.slab, pose.world_from_cam, intrinsics, size_px, along),
            "source": REAL,
            "photo_id": -1,
            "dome_id": -1,
            "splits": SPLITS.index("target"),
        }
        arrays = {name: getattr(small, name).copy() for name in added}
        for name, value in added.items():
            arrays[name][-1] = value
        return replace(small, **arrays)

    def _inputs_of(self, given: tuple[int, ...], half: bool) -> Scene:
        """Return inputs, and a last row that holds nothing yet."""
        small = only(self.scene, np.array(given))
        small = halved(small) if half else small
        arrays = {name: getattr(small, name) for name in VIEW_ARRAYS}
        longer = {name: np.concatenate([one, np.zeros_like(one[:1])]) for name, one in arrays.items()}
        return replace(small, **longer)

    def _points_of(self, row: int) -> Float[Tensor, "p 3"]:
        """Return the points of a photograph's pixels that have a scaffold, from the middle of all cameras."""
        depth = self.scene.scaffold[row].astype(float)
        y, x = np.nonzero(depth)
        rays = pixel_rays(self.scene, np.full(len(x), row), np.stack([x, y], axis=1) + 0.5, slab_bounds=False)
        points = rays.origins + depth[y, x][:, None] * rays.directions
        return torch.from_numpy((points - self._origin).astype(np.float32))

    def _seen_from(
        self,
        points: Float[Tensor, "p 3"],
        world_from_cam: Float[np.ndarray, "4 4"],
        intrinsics: Float[np.ndarray, " 4"],
        size_px: tuple[int, int],
    ) -> tuple[Float[np.ndarray, "h w"], Float[np.ndarray, " s"]]:
        """Return the depth of the nearest point at each pixel, 0 for none, and some of the depths in view.

        Gaps of a pixel or two are closed with what lies nearest, as `with_scaffold` does.
        """
        width, height = size_px
        rotation = torch.from_numpy(world_from_cam[:3, :3].astype(np.float32))
        eye = torch.from_numpy((world_from_cam[:3, 3] - self._origin).astype(np.float32))
        in_cam = (points - eye) @ rotation
        in_cam = in_cam[in_cam[:, 2] > 1e-6]
        z = in_cam[:, 2]
        fx, fy, cx, cy = (float(one) for one in intrinsics)
        x, y = in_cam[:, 0] / z * fx + cx, in_cam[:, 1] / z * fy + cy
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        place, z = (y[inside].long() * width + x[inside].long()), z[inside]
        nearest = torch.full((height * width,), torch.inf).scatter_reduce_(0, place, z, "amin").view(1, height, width)
        closed = F.max_pool2d(-F.max_pool2d(-nearest, 3, 1, 1), 3, 1, 1)[0]
        depth = torch.where(closed.isfinite(), closed, torch.zeros_like(closed))
        return depth.numpy().astype(float), z[::_EVERY].numpy().astype(float)


def halved(scene: Scene) -> Scene:
    """Return a scene at half the width and height; a last odd row or column is left out."""
    high, wide = scene.height_px // 2, scene.width_px // 2

    def mean(pictures: np.ndarray) -> np.ndarray:
        cut = pictures[:, : 2 * high, : 2 * wide].astype(np.float32)
        blocks = cut.reshape(len(cut), high, 2, wide, 2, *cut.shape[3:])
        return np.rint(blocks.mean(axis=(2, 4))).astype(np.uint8)

    every_other = (slice(None), slice(0, 2 * high, 2), slice(0, 2 * wide, 2))
    return replace(
        scene,
        images=mean(scene.images),
        fine_images=scene.images[:, : 2 * high, : 2 * wide],
        alpha=mean(scene.alpha),
        depth=scene.depth[every_other],
        scaffold=scene.scaffold[every_other],
        intrinsics=scene.intrinsics / 2,
        baseline_images=scene.baseline_images[every_other],
        baseline_alpha=scene.baseline_alpha[every_other],
    )


def _ground(
    scene: Scene, world_from_cam: Float[np.ndarray, "4 4"], intrinsics: Float[np.ndarray, " 4"]
) -> Float[np.ndarray, "h w"]:
    """Return the depth of the ground plane in a view; 0 where it shows none."""
    fx, fy, cx, cy = intrinsics
    y, x = np.mgrid[: scene.height_px, : scene.width_px] + 0.5
    directions = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], axis=-1) @ world_from_cam[:3, :3].T
    depth = scene.slab.meet(np.broadcast_to(world_from_cam[:3, 3], directions.shape), directions, 0.0)
    return np.where(np.isfinite(depth), np.minimum(depth, np.finfo(np.float16).max), 0.0)
