"""The depth of a mesh at the views' poses: what a model may start from besides its input views.

Training photographs are given the mesh of training photographs, all others the mesh of all photographs but the test's targets:
at test time the support photographs are there, and no pixel of a target reaches its own scaffold.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Float16

from aug3d_core.dataset.by_view import OnDemand
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import invert
from aug3d_core.surface.files import BASELINE_MESH, MESH


def scaffold_depth(
    surface: Path,
    train: Bool[np.ndarray, " n"],
    world_from_cam: Float[np.ndarray, "n 4 4"],
    intrinsics: Float[np.ndarray, "n 4"],
    size_px: tuple[int, int],
) -> Float16[OnDemand, "n h w"]:
    """Return the depth along z of the mesh that each photograph may know; 0 where it has a hole."""

    @cache
    def caster(name: str) -> Raycaster:
        mesh = Mesh.load(surface / name)
        return Raycaster(mesh.xyz, mesh.triangles)

    def depth(view: int) -> np.ndarray:
        seen_by = caster(MESH if train[view] else BASELINE_MESH)
        hits = seen_by.view(invert(world_from_cam[view, :3]), intrinsics[view], np.array(size_px))
        return np.where(hits.triangle >= 0, hits.distance, 0)

    return OnDemand(len(train), size_px[::-1], np.float16, depth)
