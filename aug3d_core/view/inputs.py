"""Which photographs a view is predicted from, found in milliseconds: the rule of the test on a coarse grid of its pixels.

Test photographs are never among them, nor the photograph at whose pose the camera stands: what is shown there is a prediction.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.dataset.rays import pixel_rays
from aug3d_core.dataset.scene import REAL, SPLITS, Scene
from aug3d_core.geometry.transforms import invert

_STEP_PX = 8  # of the grid
_AROUND = 64  # photographs that look nearest to where the view looks: of these comes what is in view
_NEAR = 32  # photographs that stand nearest to where the view looks: of these its inputs are chosen
_ASIDE = 20.0  # times 1 - cosine, as the test's rule has it
_HIDDEN = 1.05  # times as far as its own scaffold says, on a coarse grid
_SAME, _SAME_RAD = 0.01, 0.01  # of the scene's scale, and a turn: the camera stands at a photograph's pose


@dataclass(frozen=True)
class Candidates:
    """What photographs show, coarsely. rows: of the scene. depth: of each at the middle of squares of `_STEP_PX`."""

    scene: Scene
    rows: Int[np.ndarray, " r"]
    cam_from_world: Float[np.ndarray, "r 3 4"]
    depth: Float[np.ndarray, "r y x"]
    points: tuple[Float[np.ndarray, "p 3"], ...]  # in the world, of each

    @classmethod
    def of(cls, scene: Scene) -> Candidates:
        """Take all photographs of a scene that are not its test."""
        rows = np.flatnonzero((scene.source == REAL) & (scene.splits != SPLITS.index("target")))
        half = _STEP_PX // 2
        depth = np.stack([scene.scaffold[int(row)][half::_STEP_PX, half::_STEP_PX] for row in rows]).astype(float)
        number, y, x = np.nonzero(depth)
        at_px = np.stack([x, y], axis=1) * _STEP_PX + half + 0.5
        rays = pixel_rays(scene, rows[number], at_px, slab_bounds=False)
        points = rays.origins + depth[number, y, x][:, None] * rays.directions
        of_each = np.split(points, np.searchsorted(number, np.arange(1, len(rows))))
        return cls(scene, rows, invert(scene.world_from_cam[rows, :3]), depth, tuple(of_each))

    def chosen(
        self, world_from_cam: Float[np.ndarray, "4 4"], intrinsics: Float[np.ndarray, " 4"], count: int
    ) -> Int[np.ndarray, " v"]:
        """Return so many rows of the scene, or fewer: only such as show something of the view; none if none does."""
        points = self._in_view(world_from_cam, intrinsics)
        if not len(points):
            return self.rows[:0]
        spot = np.median(points, axis=0)
        near = np.flatnonzero(~self._at(world_from_cam))
        away = np.linalg.norm(self._spots[near] - spot, axis=1)
        near = near[np.argsort(away, kind="stable")[:_NEAR]]
        worth = np.stack([self._worth(int(one), points, world_from_cam[:3, 3]) for one in near])
        picked, so_far = list[int](), np.zeros(len(points))
        for _ in range(min(count, len(near))):
            gained = np.maximum(worth - so_far, 0).sum(axis=1)
            gained[picked] = -1
            best = int(gained.argmax())
            if worth[best].sum() <= 0:
                break
            picked.append(best)
            so_far = np.maximum(so_far, worth[best])
        return self.rows[np.sort(near[picked])] if picked else self.rows[:0]

    def _in_view(
        self, world_from_cam: Float[np.ndarray, "4 4"], intrinsics: Float[np.ndarray, " 4"]
    ) -> Float[np.ndarray, "q 3"]:
        """Return the points of a grid of a view's pixels: on what photographs show there, or else on the ground."""
        scene, (fx, fy, cx, cy) = self.scene, intrinsics
        high, wide = scene.height_px // _STEP_PX, scene.width_px // _STEP_PX
        x, y = np.meshgrid(np.arange(wide), np.arange(high))
        at = (np.stack([x, y], axis=-1) + 0.5) * _STEP_PX
        in_cam = np.concatenate([(at - [cx, cy]) / [fx, fy], np.ones((high, wide, 1))], axis=-1)
        eye, directions = world_from_cam[:3, 3], in_cam @ world_from_cam[:3, :3].T
        depth = np.full((high, wide), np.inf)
        away = np.linalg.norm(self._spots - (eye + scene.scale * world_from_cam[:3, 2]), axis=1)
        around = np.concatenate([self.points[one] for one in np.argsort(away, kind="stable")[:_AROUND]])
        seen = (around - eye) @ world_from_cam[:3, :3]
        seen = seen[seen[:, 2] > 1e-6]
        column, row = np.floor((seen[:, :2] / seen[:, 2:] * [fx, fy] + [cx, cy]) / _STEP_PX).T
        inside = (column >= 0) & (column < wide) & (row >= 0) & (row < high)
        np.minimum.at(depth, (row[inside].astype(int), column[inside].astype(int)), seen[inside, 2])
        ground = scene.slab.meet(np.broadcast_to(eye, directions.shape), directions, 0.0)
        depth = np.where(np.isfinite(depth), depth, ground)
        known = np.isfinite(depth)
        return eye + depth[known][:, None] * directions[known]

    def _worth(
        self, number: int, points: Float[np.ndarray, "q 3"], eye: Float[np.ndarray, " 3"]
    ) -> Float[np.ndarray, " q"]:
        """Return how well a photograph shows points to one who stands at `eye`: 1 from there, 0 if it does not."""
        scene, row, turn = self.scene, int(self.rows[number]), self.cam_from_world[number]
        in_cam = points @ turn[:, :3].T + turn[:, 3]
        fx, fy, cx, cy = scene.intrinsics[row]
        z = np.where(in_cam[:, 2] > 1e-6, in_cam[:, 2], np.inf)
        x, y = in_cam[:, 0] / z * fx + cx, in_cam[:, 1] / z * fy + cy
        inside = np.isfinite(z) & (x >= 0) & (x < scene.width_px) & (y >= 0) & (y < scene.height_px)
        coarse = self.depth[number]
        rows = np.clip(np.where(inside, y, 0) // _STEP_PX, 0, coarse.shape[0] - 1).astype(int)
        columns = np.clip(np.where(inside, x, 0) // _STEP_PX, 0, coarse.shape[1] - 1).astype(int)
        nearest = coarse[rows, columns]
        hidden = (nearest > 0) & (z > _HIDDEN * nearest)
        there, here = points - scene.world_from_cam[row, :3, 3], points - eye
        cosine = (there * here).sum(axis=1) / np.linalg.norm(there, axis=1) / np.linalg.norm(here, axis=1)
        return np.where(inside & ~hidden, np.exp(_ASIDE * (cosine - 1)), 0.0)

    @cached_property
    def _spots(self) -> Float[np.ndarray, "r 3"]:
        """Return where photographs look: ahead, as far as the ground usually is."""
        poses = self.scene.world_from_cam[self.rows]
        return poses[:, :3, 3] + self.scene.scale * poses[:, :3, 2]

    def _at(self, world_from_cam: Float[np.ndarray, "4 4"]) -> Bool[np.ndarray, " r"]:
        """Return which photographs were taken from where the camera stands, looking the same way."""
        poses = self.scene.world_from_cam[self.rows]
        away = np.linalg.norm(poses[:, :3, 3] - world_from_cam[:3, 3], axis=1)
        ahead = np.clip(poses[:, :3, 2] @ world_from_cam[:3, 2], -1, 1)
        return (away < _SAME * self.scene.scale) & (np.arccos(ahead) < _SAME_RAD)
