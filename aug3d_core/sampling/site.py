"""What a sampler may know of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import apply
from aug3d_core.geometry.views import Views
from aug3d_core.sampling.ground import Ground


@dataclass(frozen=True)
class Site:
    """The ground, the lens of the virtual cameras, and how fine a view may be."""

    ground: Ground
    intrinsics: Float[np.ndarray, " 4"]  # fx, fy, cx, cy in px of a virtual view
    size: Int[np.ndarray, " 2"]  # width, height in px of a virtual view
    finest_sampling: float  # world units per px: no virtual view is to be finer
    views_per_dome: int

    @property
    def focal_px(self) -> float:
        """The one focal length of the virtual cameras."""
        return float(self.intrinsics[0])


def lens_like(views: Views, size: Int[np.ndarray, " 2"]) -> Float[np.ndarray, " 4"]:
    """Return the intrinsics of a view of this size that is the centre of a median photo, scaled until it is covered."""
    focal = float(np.median(views.intrinsics[:, :2].mean(axis=1) * _reduction(views, size)))
    return np.array([focal, focal, size[0] / 2, size[1] / 2])


def photo_sampling(views: Views, mesh: Mesh, size: Int[np.ndarray, " 2"]) -> float:
    """Return the size on the surface (world units) of a median photo's pixel, once reduced to views of this size."""
    sample = mesh.xyz[:: max(1, len(mesh.xyz) // 10_000)].astype(float)
    in_cam = apply(views.cam_from_world, np.broadcast_to(sample, (len(views), *sample.shape)))
    return float(np.median(np.median(in_cam[..., 2], axis=1) / (views.intrinsics[:, 0] * _reduction(views, size))))


def edge_length(mesh: Mesh) -> float:
    """Return the mesh's median edge (world units): its colours vary no finer."""
    corners = mesh.xyz[mesh.triangles]
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))


def _reduction(views: Views, size: Int[np.ndarray, " 2"]) -> Float[np.ndarray, " n"]:
    """Return the factor by which each photo shrinks until it just covers a view of this size."""
    return (size / views.size).max(axis=1)
