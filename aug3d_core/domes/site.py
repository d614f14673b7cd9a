"""What a sampler may know of a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.height_raster import HeightRaster, height_raster
from aug3d_core.domes.justified import sampling_by_photos
from aug3d_core.domes.sight import framed
from aug3d_core.geometry.ground_model import fit_ground
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError

HIGH_PERCENTILE = 95.0
WIDEST = 10.0
SMEARED = 2.0  # times coarser than elsewhere is where the photos' pixels on the surface begin to show
SQUARES = 60  # of the raster from above across the nearest view: the smallest building is 5 wide
BLACK = 3  # of 255, in every channel


@dataclass(frozen=True)
class Site:
    """The ground, the lens of the virtual cameras, and how fine a view may be."""

    ground: HeightRaster
    intrinsics: Float[np.ndarray, " 4"]  # fx, fy, cx, cy in px of a virtual view
    size: Int[np.ndarray, " 2"]  # width, height in px of a virtual view
    finest_sampling: float  # world units per px: no virtual view is to be finer
    views_per_dome: int  # the members of a training group (K): a dome has as many views, or none
    drawn_per_dome: int  # cameras to find for each dome, of which some K will be kept
    relief: float  # how high things stand above the ground, world units
    black: Bool[np.ndarray, " t"]  # triangles of the mesh without a colour
    justified: Float[np.ndarray, " t"]  # world units per px: views that look finer at a triangle show it smeared

    @property
    def limits(self) -> Float[np.ndarray, " l"]:
        """World units per px that tell fine views from coarse ones, and those from views too coarse to show anything.

        They are doubled from twice the finest, up to that of a view WIDEST times as wide as things are high.
        """
        widest = WIDEST * self.relief / float(self.size.max())
        count = max(int(np.ceil(np.log2(widest / self.finest_sampling))), 2) if widest > 0 else 2
        return self.finest_sampling * 2.0 ** np.arange(1, count + 1)

    @property
    def focal_px(self) -> float:
        """The one focal length of the virtual cameras."""
        return float(self.intrinsics[0])


def site_of(
    mesh: Mesh, surface: Raycaster, photos: Views, config: SamplingConfig, textured: bool, wanted: int, drawn: int
) -> Site:
    """Gather what a sampler may know; the lens and the sampling are those of the photos, which are those of training.

    wanted, drawn: cameras that a dome is to have, and to find.
    """
    size = np.array([config.width_px, config.height_px])
    # Colours at vertices are as coarse as the triangles; a texture is as fine as the photos, however few triangles there are
    grain = 0.0 if textured else edge_length(mesh)
    finest = max(config.min_sampling_ratio * photo_sampling(photos, mesh, size), grain)
    ground = height_raster(mesh, surface, finest * float(size.max()) / SQUARES)
    high = relief(ground, np.random.default_rng(config.seed))
    local = sampling_by_photos(mesh, surface, reduced(photos, size), np.random.default_rng(config.seed))
    justified = config.min_sampling_ratio / SMEARED * local
    return Site(ground, lens_like(photos, size), size, finest, wanted, drawn, high, black_triangles(mesh), justified)


def lens_like(views: Views, size: Int[np.ndarray, " 2"]) -> Float[np.ndarray, " 4"]:
    """Return the intrinsics of a view of this size that is the centre of a median photo, scaled until it is covered."""
    focal = float(np.median(views.intrinsics[:, :2].mean(axis=1) * _reduction(views, size)))
    return np.array([focal, focal, size[0] / 2, size[1] / 2])


def photo_sampling(views: Views, mesh: Mesh, size: Int[np.ndarray, " 2"]) -> float:
    """Return the size on the surface (world units) of a median photo's pixel, once reduced to views of this size.

    Only what a photo frames counts: of an oblique one most of a large surface lies elsewhere. Raises InputError if none
    frames any.
    """
    sample = mesh.xyz[:: max(1, len(mesh.xyz) // 10_000)].astype(float)
    lens, sampling = reduced(views, size).intrinsics[:, 0], list[float]()
    for view, focal_px in enumerate(lens):
        depth = framed(sample, views.cam_from_world[view], views.intrinsics[view], views.size[view])[1]
        if len(depth):
            sampling.append(float(np.median(depth)) / focal_px)
    if not sampling:
        raise InputError("no train photo frames any of the mesh", "make the surface again from the photos")
    return float(np.median(sampling))


def reduced(views: Views, size: Int[np.ndarray, " 2"]) -> Views:
    """Return the photos as they are once they just cover a view of this size."""
    factor = _reduction(views, size)[:, None]
    return replace(views, intrinsics=views.intrinsics * factor, size=np.rint(views.size * factor).astype(int))


def edge_length(mesh: Mesh) -> float:
    """Return the mesh's median edge (world units): its colours vary no finer."""
    corners = mesh.xyz[mesh.triangles]
    return float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))


def relief(ground: HeightRaster, rng: np.random.Generator) -> float:
    """Return how high things stand above the ground, in world units: all but the highest twentieth of the surface."""
    points = ground.points()
    try:
        height = points[:, 2] - fit_ground(points, rng).height_at(points[:, :2])
    except InputError:  # no ground, say about a tower alone: all of it stands above its foot
        height = points[:, 2] - points[:, 2].min()
    return max(float(np.percentile(height, HIGH_PERCENTILE)), 0.0)


def black_triangles(mesh: Mesh) -> Bool[np.ndarray, " t"]:
    """Tell which triangles have no colour at any corner."""
    return (mesh.rgb.max(axis=1) <= BLACK)[mesh.triangles].all(axis=1)


def _reduction(views: Views, size: Int[np.ndarray, " 2"]) -> Float[np.ndarray, " n"]:
    """Return the factor by which each photo shrinks until it just covers a view of this size."""
    return (size / views.size).max(axis=1)
