"""Rays against a triangle mesh: images of it, occlusion, distances.

Cameras are COLMAP's (x right, y down, z forward) with pixel centres at half-integers; depth is along z, not along the
ray. Everything is shifted to the mesh's own centre first, because Embree works in float32.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import open3d as o3d
from jaxtyping import Bool, Float, Int, UInt8

from aug3d_core.geometry.transforms import invert


@runtime_checkable
class Coloured(Protocol):
    """A mesh that knows its colours: per vertex, or by a texture."""

    def colour_at(self, triangle: Int[np.ndarray, " p"], weights: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Return the colours (0 to 255) at barycentric places."""
        ...


@dataclass(frozen=True)
class Render:
    """What a camera sees of a mesh."""

    rgb: UInt8[np.ndarray, "h w 3"]  # 0 where nothing is hit
    alpha: UInt8[np.ndarray, "h w"]  # 255 or 0
    depth: Float[np.ndarray, "h w"]  # along z, world units; 0 where nothing is hit


@dataclass(frozen=True)
class Hits:
    """First intersections of rays."""

    distance: Float[np.ndarray, " *r"]  # in lengths of the ray's direction; inf where nothing is hit
    triangle: Int[np.ndarray, " *r"]  # -1 where nothing is hit
    weights: Float[np.ndarray, "*r 3"]  # barycentric, one for each corner
    normal: Float[np.ndarray, "*r 3"]  # unit, of the triangle; its side is the winding's


class Raycaster:
    """A mesh prepared for rays; building it once pays for many casts."""

    def __init__(self, xyz: Float[np.ndarray, "v 3"], triangles: Int[np.ndarray, "t 3"]) -> None:
        self._origin = xyz.mean(axis=0, dtype=np.float64)
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            _tensor((xyz - self._origin).astype(np.float32)),
            _tensor(triangles.astype(np.uint32)),
        )

    def cast(self, origins: Float[np.ndarray, "*#r 3"], directions: Float[np.ndarray, "*#r 3"]) -> Hits:
        """Return the first hit of each ray; origins and directions are in the world frame and broadcast."""
        answer = self._scene.cast_rays(self._rays(origins, directions))
        distance = answer["t_hit"].numpy()
        hit = np.isfinite(distance)
        second_third = answer["primitive_uvs"].numpy()
        weights = np.concatenate([1 - second_third.sum(-1, keepdims=True), second_third], axis=-1)
        triangle = np.where(hit, answer["primitive_ids"].numpy().astype(np.int64), -1)
        return Hits(distance, triangle, weights, answer["primitive_normals"].numpy())

    def occluded(
        self, origins: Float[np.ndarray, "*#r 3"], directions: Float[np.ndarray, "*#r 3"], far: float
    ) -> Bool[np.ndarray, " *r"]:
        """Tell whether anything lies on a ray between its origin and `far` (in lengths of its direction)."""
        return self._scene.test_occlusions(self._rays(origins, directions), tnear=0.0, tfar=far).numpy()

    def distance(self, points: Float[np.ndarray, "*p 3"]) -> Float[np.ndarray, " *p"]:
        """Return the distance of points to the surface, without a sign."""
        return self._scene.compute_distance(_tensor((points - self._origin).astype(np.float32))).numpy()

    def view(
        self,
        cam_from_world: Float[np.ndarray, "3 4"],
        intrinsics: Float[np.ndarray, " 4"],
        size: Int[np.ndarray, " 2"],
    ) -> Hits:
        """Cast one ray through each pixel centre; directions have z = 1, so that distances are depths."""
        origin, directions = pixel_rays(cam_from_world, intrinsics, size)
        return self.cast(origin, directions)

    def render(
        self,
        colours: Coloured,
        cam_from_world: Float[np.ndarray, "3 4"],
        intrinsics: Float[np.ndarray, " 4"],
        size: Int[np.ndarray, " 2"],
    ) -> Render:
        """Render the mesh in the colours of a mesh with the same triangles, one ray per pixel."""
        hits = self.view(cam_from_world, intrinsics, size)
        hit = hits.triangle >= 0
        image = np.zeros((*hit.shape, 3), np.uint8)
        image[hit] = np.rint(colours.colour_at(hits.triangle[hit], hits.weights[hit])).clip(0, 255).astype(np.uint8)
        return Render(image, np.where(hit, 255, 0).astype(np.uint8), np.where(hit, hits.distance, 0.0))

    def _rays(self, origins: np.ndarray, directions: np.ndarray) -> o3d.core.Tensor:
        origins, directions = np.broadcast_arrays(origins - self._origin, directions)
        return _tensor(np.concatenate([origins, directions], axis=-1).astype(np.float32))


def pixel_rays(
    cam_from_world: Float[np.ndarray, "3 4"], intrinsics: Float[np.ndarray, " 4"], size: Int[np.ndarray, " 2"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "h w 3"]]:
    """Return the camera centre and, for each pixel centre, the world direction with unit depth."""
    world_from_cam = invert(cam_from_world)
    x = (np.arange(size[0]) + 0.5 - intrinsics[2]) / intrinsics[0]
    y = (np.arange(size[1]) + 0.5 - intrinsics[3]) / intrinsics[1]
    directions = np.stack([*np.meshgrid(x, y), np.ones((size[1], size[0]))], axis=-1)
    return world_from_cam[:, 3], directions @ world_from_cam[:, :3].T


def _tensor(array: np.ndarray) -> o3d.core.Tensor:
    return o3d.core.Tensor(np.ascontiguousarray(array))  # pyright: ignore[reportCallIssue]  (its stub knows no arrays)
