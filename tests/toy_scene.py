"""A toy scene with exact images, depths and poses: boxes on textured ground, ray-cast in numpy in a second.

It is a packed data set at once, so that the data set and the model can be tested without any other stage.
Colour is a function of the point in the world alone, so every view agrees with every other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aug3d_core.dataset.bounds import near_far
from aug3d_core.dataset.scene import FINER, REAL, RENDERED, SPLITS, Scene, no_fine_images
from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import homogeneous, invert, look_at

EXTENT_M, ALTITUDE_M, ROOF_M = 60.0, 45.0, 10.0


@dataclass(frozen=True)
class ToyWorld:
    """Boxes (centre x, y, half width x, y, height) on the plane z = 0, and a colour for every point."""

    boxes: Float[np.ndarray, "b 5"]
    texture: Float[np.ndarray, "s s s2 3"]

    def cast(
        self, origins: Float[np.ndarray, "r 3"], directions: Float[np.ndarray, "r 3"]
    ) -> tuple[Float[np.ndarray, "r 3"], Float[np.ndarray, " r"]]:
        """Return the colour in [0, 1] and the t of the first hit of each ray; all rays must point down."""
        t = -origins[:, 2] / directions[:, 2]
        with np.errstate(divide="ignore"):
            inverse = 1 / directions
        for x, y, half_x, half_y, height in self.boxes:
            low, high = np.array([x - half_x, y - half_y, 0.0]), np.array([x + half_x, y + half_y, height])
            a, b = (low - origins) * inverse, (high - origins) * inverse
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            t = np.where((enter < leave) & (enter > 0) & (enter < t), enter, t)
        return self.colour(origins + t[:, None] * directions), t

    def mesh(self) -> Mesh:
        """Return the ground and the boxes as triangles, grey."""
        corners = np.array([(x, y, z) for z in (0, 1) for y in (-1, 1) for x in (-1, 1)], float)
        quads = [(4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
        sides = np.array([three for a, b, c, d in quads for three in ((a, b, c), (a, c, d))])
        xyz, triangles = [corners[:4] * [10 * EXTENT_M, 10 * EXTENT_M, 0]], [np.array([(0, 1, 3), (0, 3, 2)])]
        for x, y, half_x, half_y, height in self.boxes:
            triangles.append(sides + sum(map(len, xyz)))
            xyz.append(corners * [half_x, half_y, height] + [x, y, 0])
        points = np.concatenate(xyz).astype(np.float32)
        return Mesh(points, np.full(points.shape, 128, np.uint8), np.concatenate(triangles).astype(np.int32))

    def colour(self, points_in_world: Float[np.ndarray, "r 3"]) -> Float[np.ndarray, "r 3"]:
        """Interpolate the texture, a periodic grid with a vertex every 4 m."""
        cell = points_in_world / 4.0
        floor = np.floor(cell).astype(int)
        part = cell - floor
        out = np.zeros((len(cell), 3))
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, part, 1 - part), axis=1)
            index = (floor + corner) % np.array(self.texture.shape[:3])
            out += weight[:, None] * self.texture[index[:, 0], index[:, 1], index[:, 2]]
        return out


def toy_world(rng: np.random.Generator, boxes: int = 24) -> ToyWorld:
    """Scatter boxes of several sizes and heights over the extent."""
    centre = rng.uniform(-EXTENT_M / 2, EXTENT_M / 2, (boxes, 2))
    half, height = rng.uniform(2, 5, (boxes, 2)), rng.uniform(3, ROOF_M, (boxes, 1))
    return ToyWorld(np.hstack([centre, half, height]), rng.uniform(0.05, 0.95, (32, 32, 16, 3)))


def toy_scene(
    seed: int, width_px: int, height_px: int, members: int = 6, cells: int = 2, world: ToyWorld | None = None
) -> Scene:
    """Fly a drone over a toy world (6 x 6 real views, its last two columns the test block) and render cells^2 domes."""
    rng = np.random.default_rng(seed)
    world = world or toy_world(rng)
    slab = Slab(0.0, 0.0, 0.0, -0.5, ROOF_M + 0.5)
    grid = np.linspace(-EXTENT_M / 2, EXTENT_M / 2, 6)
    look = np.array([(x, y, 0.0) for x in grid for y in grid]) + rng.uniform(-1, 1, (36, 3)) * [1, 1, 0]
    eye = look + rng.uniform(-1, 1, (36, 3)) * [12, 12, 3] + [0, 0, ALTITUDE_M]
    domes = np.array([(x, y) for x in np.linspace(-15, 5, cells) for y in np.linspace(-15, 15, cells)])
    for x, y in domes:
        turn = np.linspace(0, 2 * np.pi, members, endpoint=False) + rng.uniform(0, 1)
        look = np.vstack([look, np.tile([x, y, 0.0], (members, 1))])
        ring = np.stack([x + 18 * np.cos(turn), y + 18 * np.sin(turn), np.full(members, ALTITUDE_M)], axis=1)
        eye = np.vstack([eye, ring])
    return _pack(world, slab, eye, look, (width_px, height_px), members)


def _pack(
    world: ToyWorld, slab: Slab, eye: np.ndarray, look: np.ndarray, size_px: tuple[int, int], members: int
) -> Scene:
    n, real, (width, height) = len(eye), 36, size_px
    poses = homogeneous(invert(np.stack([look_at(e, p) for e, p in zip(eye, look, strict=True)])))
    intrinsics = np.tile([0.9 * width, 0.9 * width, width / 2, height / 2], (n, 1))
    shot = [_shoot(world, pose, k, width, height) for pose, k in zip(poses, intrinsics, strict=True)]
    colours, depths = (np.stack(part) for part in zip(*shot, strict=True))
    fine = [
        _shoot(world, pose, FINER * k, FINER * width, FINER * height)[0]
        for pose, k in zip(poses[:real], intrinsics, strict=False)
    ]
    column = np.arange(real) // 6
    role = np.where(column == 3, "gap", np.where(column < 3, "train", "support"))
    role[(column > 3) & (np.arange(real) % 3 == 1)] = "target"
    distance = np.linalg.norm(look[:real, None] - look[None, :real], axis=-1)
    bounds = [near_far(slab, poses[i], intrinsics[i], size_px, depths[i].ravel()) for i in range(n)]
    targets = np.flatnonzero(role == "target")
    source = np.where(np.arange(n) < real, REAL, RENDERED).astype(np.uint8)
    return Scene(
        images=np.rint(colours * 255).astype(np.uint8),
        fine_images=np.concatenate(
            [np.rint(np.stack(fine) * 255).astype(np.uint8), no_fine_images(n - real, size_px)[:]]
        ),
        alpha=np.full((n, height, width), 255, np.uint8),
        depth=np.where(source[:, None, None] == RENDERED, depths, 0).astype(np.float16),
        scaffold=depths.astype(np.float16),
        world_from_cam=poses,
        intrinsics=intrinsics,
        near_far=np.array(bounds),
        source=source,
        photo_id=np.where(source == REAL, np.arange(n), -1).astype(np.int32),
        dome_id=np.where(source == REAL, -1, (np.arange(n) - real) // members).astype(np.int32),
        splits=np.array([SPLITS.index(r) for r in [*role, *["train"] * (n - real)]], np.uint8),
        groups={
            "real": _nearest(distance, np.flatnonzero(role == "train"), np.flatnonzero(role == "train"), members),
            "rendered": np.arange(real, n, dtype=np.int32).reshape(-1, members),
            "test": _nearest(distance, targets, np.append(targets, np.flatnonzero(role == "support")), members),
        },
        baseline_view=targets.astype(np.int32),
        baseline_images=np.rint(colours[targets] * 255).astype(np.uint8),
        baseline_alpha=np.full((len(targets), height, width), 255, np.uint8),
        slab=slab,
        scale=ALTITUDE_M,
        attributes={"leak_audit": {"state": "pass"}},
    )


def _shoot(
    world: ToyWorld, pose: np.ndarray, intrinsics: np.ndarray, width: int, height: int
) -> tuple[np.ndarray, np.ndarray]:
    fx, fy, cx, cy = intrinsics
    v, u = np.mgrid[:height, :width] + 0.5
    directions = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    colour, depth = world.cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)
    return colour.reshape(height, width, 3), depth.reshape(height, width)


def _nearest(distance: np.ndarray, centres: np.ndarray, allowed: np.ndarray, members: int) -> np.ndarray:
    """Return each centre followed by the allowed views that look nearest to it; no other centre if some are barred."""
    rows = []
    for centre in centres:
        others = [v for v in allowed if v != centre and (len(allowed) == len(centres) or v not in centres)]
        rows.append([centre, *sorted(others, key=lambda v, c=centre: distance[c, v])[: members - 1]])
    return np.array(rows, np.int32)
