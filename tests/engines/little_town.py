"""A level ground of 80 x 60 with a corner missing and, if wanted, a tower in the middle, for the tests of sampling."""

from functools import lru_cache

import numpy as np

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.height_raster import height_raster
from aug3d_core.domes.site import Site, black_triangles, relief
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster

CONFIG = SamplingConfig(domes=12)
SIZE = np.array([96, 72])
LENS = np.array([90.0, 90.0, 48.0, 36.0])  # at a radius of 15 it shows 16 x 12 of the ground
VIEWS_PER_DOME = 5


def config(**changes) -> SamplingConfig:
    return CONFIG.model_copy(update=changes)


def town(tower: float = 0.0) -> Mesh:
    x, y = np.meshgrid(np.arange(161) / 2 - 40, np.arange(121) / 2 - 30)
    a = (np.arange(120)[:, None] * 161 + np.arange(160)).ravel()
    triangles = np.concatenate([np.stack([a, a + 1, a + 162], 1), np.stack([a, a + 162, a + 161], 1)])
    z = np.where((abs(x) < 3) & (abs(y) < 3), tower, 0.0)
    xyz = np.stack([x, y, z], -1).reshape(-1, 3)
    missing = (xyz[triangles] > (20, 10, -1)).all(axis=(1, 2))
    rgb = np.full(xyz.shape, 128, np.uint8)
    return Mesh(xyz.astype(np.float32), rgb, triangles[~missing].astype(np.int32))


def site_over(mesh: Mesh, drawn: int = VIEWS_PER_DOME) -> tuple[Raycaster, Site]:
    """Return the ray caster and the site of a mesh. Meshes alike share them: nothing may write to their arrays."""
    return _site_over(mesh.xyz.tobytes(), mesh.rgb.tobytes(), mesh.triangles.tobytes(), drawn)


@lru_cache(maxsize=16)
def _site_over(xyz: bytes, rgb: bytes, triangles: bytes, drawn: int) -> tuple[Raycaster, Site]:
    arrays = [np.frombuffer(*part).reshape(-1, 3) for part in ((xyz, "f4"), (rgb, "u1"), (triangles, "i4"))]
    mesh = Mesh(*(array.copy() for array in arrays))
    surface = Raycaster(mesh.xyz, mesh.triangles)
    ground = height_raster(mesh, surface)
    high = relief(ground, np.random.default_rng(0))
    justified = np.zeros(len(mesh.triangles))
    return surface, Site(ground, LENS, SIZE, 0.05, VIEWS_PER_DOME, drawn, high, black_triangles(mesh), justified)
