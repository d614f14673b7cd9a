"""The ground that a flight is about: places on it, and how high it can be flown over safely.

The flight is about the ground that its photographs enclose: the hull of where cameras point, and a quarter of a picture about
it; beyond, photographs thin out on every flight.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt, median_filter
from scipy.spatial import Delaunay, KDTree, QhullError

from aug3d_core.domes.sight import Samples, spread_over
from aug3d_core.geometry.ground_model import fit_ground
from aug3d_core.geometry.ground_surface import GroundModel
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError

_CELLS, _MOST_CELLS = 20, 400  # along the ground of a picture; along the map
_SEED = 0
_MARGIN_SHARE = 0.2  # of the flight's height, where no metre is known
_FAR = 3.0  # flight heights along the ground: what is farther from a camera counts for nothing
_LAWFUL_M = 120.0  # above the ground, without a permit in most countries


@dataclass(frozen=True)
class Area:
    """Cells on the ground plane, [north, east] from the south-west. wanted: the flight is about them. heights: of the surface.

    hole: wanted, and the mesh has nothing there; the height is that of the ground. All in world units.
    """

    low: Float[np.ndarray, " 2"]
    cell: float
    wanted: Bool[np.ndarray, "y x"]
    heights: Float[np.ndarray, "y x"]
    hole: Bool[np.ndarray, "y x"]

    def middle(self, cells: Bool[np.ndarray, "y x"]) -> Float[np.ndarray, "n 2"]:
        """Return the middles of cells, row by row."""
        return self.low + (np.argwhere(cells)[:, ::-1] + 0.5) * self.cell

    def has(self, xy: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Tell which places are wanted."""
        column, row = np.floor((xy - self.low) / self.cell).astype(int).T
        rows, columns = self.wanted.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return inside & self.wanted[row.clip(0, rows - 1), column.clip(0, columns - 1)]


@dataclass(frozen=True)
class Site:
    """samples: places on ground, roofs and walls, each of the same area. in_hole: where the mesh has nothing.

    ground: fitted under all. height: usual, of the flight above the ground. picture: side of the ground in a picture.
    roof: the highest surface of the area and its surroundings. floor: nothing flies below it. lawful: height above the ground
    beyond which nothing flies that the flight did not; infinite where no metre is known.
    """

    area: Area
    samples: Samples
    in_hole: Bool[np.ndarray, " s"]
    surface: Raycaster
    ground: GroundModel
    height: float
    picture: float
    roof: float
    floor: float
    lawful: float

    @cached_property
    def _across(self) -> KDTree:
        return KDTree(self.samples.xyz[:, :2])

    def around(self, at: Float[np.ndarray, " 3"]) -> Int[np.ndarray, " a"]:
        """Return the samples that a camera may show finely enough to count, in order."""
        return np.sort(np.array(self._across.query_ball_point(at[:2], _FAR * self.height), int))

    def about(self, xy: Float[np.ndarray, "n 2"]) -> list[list[int]]:
        """Return the samples within half a picture of each place."""
        return self._across.query_ball_point(xy, self.picture / 2).tolist()

    def flown(self, xy: Float[np.ndarray, "*n 2"], higher: float = 1.0) -> Float[np.ndarray, "*n 3"]:
        """Return where to fly over places: so many times as high above the ground as before, never below the floor."""
        z = np.maximum(self.ground.height_at(xy) + self.height_flown(higher), self.floor)
        return np.concatenate([xy, z[..., None]], axis=-1)

    def height_flown(self, higher: float) -> float:
        """Return so many times the usual height of the flight above the ground, as far as that is lawful."""
        return min(higher * self.height, max(self.height, self.lawful))


def site_of(mesh: Mesh, views: Views, points_in_world: Float[np.ndarray, "p 3"], margin: float | None) -> Site:
    """Return the ground of a flight; raises InputError where no ground is found, or no camera looks at it.

    margin: least distance above the highest roof; None for a share of the flight's height, where no metre is known.
    """
    ground = fit_ground(points_in_world.astype(float), np.random.default_rng(_SEED))
    eyes, looks = centres(views.cam_from_world), forward(views.cam_from_world)
    height = float(np.median(eyes[:, 2] - ground.height_at(eyes[:, :2])))
    away = ground.meet(eyes, looks)
    meets = np.isfinite(away) & (away < _FAR * height)
    if not meets.any() or height <= 0:
        raise InputError("no photograph looks at the ground", "give photographs that look down")
    looked_at = (eyes + np.where(meets, away, 0.0)[:, None] * looks)[meets, :2]
    picture = height * float(np.median(views.size.min(axis=1) / views.intrinsics[:, 0]))
    surface = Raycaster(mesh.xyz.astype(float), mesh.triangles)
    area = _area(looked_at, eyes[:, :2], picture, surface, ground, float(mesh.xyz[:, 2].max()) + 1)
    roof = float(median_filter(area.heights, 3).max())  # a speck of the mesh above the roofs is none
    floor = roof + (_MARGIN_SHARE * height if margin is None else margin)
    samples, in_hole = _samples(area, mesh)
    lawful = np.inf if margin is None else _LAWFUL_M
    return Site(area, samples, in_hole, surface, ground, height, picture, roof, floor, lawful)


def _area(
    looked_at: Float[np.ndarray, "n 2"],
    eyes: Float[np.ndarray, "n 2"],
    picture: float,
    surface: Raycaster,
    ground: GroundModel,
    above: float,
) -> Area:
    both = np.concatenate([looked_at, eyes])
    low, high = both.min(axis=0) - 2 * picture, both.max(axis=0) + 2 * picture
    cell = max(picture / _CELLS, float((high - low).max()) / _MOST_CELLS)
    columns, rows = np.ceil((high - low) / cell).astype(int)
    looked = np.zeros((rows, columns), bool)
    looked[tuple(np.floor((looked_at - low) / cell).astype(int).T[::-1])] = True
    area = Area(low, cell, looked, np.zeros((rows, columns)), looked)
    xy = area.middle(np.ones_like(looked))
    with suppress(QhullError):  # all in a line: they enclose nothing
        looked |= (Delaunay(looked_at).find_simplex(xy) >= 0).reshape(looked.shape)
    wanted = _grown(looked, picture / 4 / cell)
    hits = surface.cast(np.column_stack([xy, np.full(len(xy), above)]), np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    heights = np.where(hit, above - hits.distance, ground.height_at(xy)).reshape(wanted.shape)
    return Area(low, cell, wanted, heights, wanted & ~hit.reshape(wanted.shape))


def _grown(cells: Bool[np.ndarray, "y x"], by: float) -> Bool[np.ndarray, "y x"]:
    """Return cells and what lies within a distance of them."""
    return np.asarray(distance_transform_edt(~cells)) <= by if cells.any() else cells


def _samples(area: Area, mesh: Mesh) -> tuple[Samples, Bool[np.ndarray, " s"]]:
    """Spread places over the wanted part of the mesh, and over its holes: one for the area of a cell."""
    corners = mesh.xyz[mesh.triangles].astype(float)
    inside = area.has(corners[..., :2].mean(axis=1))
    xyz, normal = np.zeros((0, 3)), np.zeros((0, 3))
    if inside.any():
        part = Mesh(mesh.xyz, mesh.rgb, mesh.triangles[inside])
        corners = corners[inside]
        size = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
        spread = spread_over(part, max(round(float(size) / area.cell**2), 1), np.ones(1), np.random.default_rng(_SEED))
        xyz, normal = spread.xyz, spread.normal
    middle = area.middle(area.hole)
    hole = np.column_stack([middle, area.heights[area.hole]])
    xyz, normal = np.concatenate([xyz, hole]), np.concatenate([normal, np.tile([0.0, 0.0, 1.0], (len(hole), 1))])
    in_hole = np.arange(len(xyz)) >= len(xyz) - len(hole)
    return Samples(xyz, normal, np.full(len(xyz), -1), np.ones(1)), in_hole
