"""The ground that a flight is about: places on it, and how high it can be flown over safely.

The flight is about the ground that its photographs enclose: the hull of where cameras point, and a quarter of a picture about
it; beyond, photographs thin out on every flight.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt, maximum_filter, median_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
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
# Of the flight's height: a photograph then shows 1.4 times the ground, and views from the flight's height look past it less
HIGHER = 1.2


@dataclass(frozen=True)
class Area:
    """Cells on the ground plane, [north, east] from the south-west. wanted: the flight is about them. heights: of the surface.

    tops: of the highest thing in each cell, however narrow. hole: wanted, and the mesh has nothing there; the height is that of
    the ground. All in world units.
    """

    low: Float[np.ndarray, " 2"]
    cell: float
    wanted: Bool[np.ndarray, "y x"]
    heights: Float[np.ndarray, "y x"]
    tops: Float[np.ndarray, "y x"]
    hole: Bool[np.ndarray, "y x"]

    def middle(self, cells: Bool[np.ndarray, "y x"]) -> Float[np.ndarray, "n 2"]:
        """Return the middles of cells, row by row."""
        return self.low + (np.argwhere(cells)[:, ::-1] + 0.5) * self.cell

    def has(self, xy: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Tell which places are wanted."""
        cell, inside = self.cell_of(xy)
        return inside & self.wanted[cell]

    def cell_of(self, xy: Float[np.ndarray, "n 2"]) -> tuple[tuple[np.ndarray, np.ndarray], Bool[np.ndarray, " n"]]:
        """Return the row and the column of the nearest cell, and whether places lie in it."""
        cell = np.floor((xy - self.low) / self.cell).astype(int)[:, ::-1]
        nearest = cell.clip(0, np.array(self.wanted.shape) - 1)
        return (nearest[:, 0], nearest[:, 1]), (cell == nearest).all(axis=1)

    @cached_property
    def lowest(self) -> float:
        """The lowest height; a speck of the mesh below the ground is none."""
        return float(median_filter(self.heights, 3).min())


@dataclass(frozen=True)
class Site:
    """samples: places on ground, roofs and walls, each of the same area. in_hole: where the mesh has nothing.

    ground: fitted under all. height: usual, of the flight above the ground. picture: side of the ground in a picture.
    margin: least distance above what is near. lawful: height above the ground beyond which nothing flies that the flight did
    not, but to keep the margin; infinite where no metre is known.
    """

    area: Area
    samples: Samples
    in_hole: Bool[np.ndarray, " s"]
    surface: Raycaster
    ground: GroundModel
    height: float
    picture: float
    margin: float
    lawful: float

    @property
    def roof(self) -> float:
        """The highest thing of the area and its surroundings."""
        return float(self.area.tops.max())

    @property
    def floor(self) -> float:
        """The height that keeps the margin above all of the area and its surroundings."""
        return self.roof + self.margin

    @cached_property
    def _across(self) -> KDTree:
        return KDTree(self.samples.xyz[:, :2])

    def around(self, at: Float[np.ndarray, " 3"]) -> Int[np.ndarray, " a"]:
        """Return the samples that a camera may show finely enough to count, in order."""
        return np.sort(np.array(self._across.query_ball_point(at[:2], _FAR * self.height), int))

    def about(self, xy: Float[np.ndarray, "n 2"]) -> list[list[int]]:
        """Return the samples within half a picture of each place."""
        return self._across.query_ball_point(xy, self.picture / 2).tolist()

    def flown(self, xy: Float[np.ndarray, "n 2"], higher: float = 1.0) -> Float[np.ndarray, "n 3"]:
        """Return where to fly over places: so many times as high above the ground as before, never below the floor there."""
        z = np.maximum(self.ground.height_at(xy) + self.height_flown(higher), self.floor_at(xy))
        return np.column_stack([xy, z])

    def floor_at(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Return below which height nothing flies over places.

        The margin above all within half a picture, or the margin, and above the highest roof if it stood there on the ground.
        """
        return self._floors[self.area.cell_of(xy)[0]]

    @cached_property
    def _floors(self) -> Float[np.ndarray, "y x"]:
        near, tops = int(np.ceil(max(self.picture / 2, self.margin) / self.area.cell)), self.area.tops
        ground = self.ground.height_at(self.area.middle(np.ones_like(self.area.wanted))).reshape(tops.shape)
        return np.maximum(maximum_filter(tops, 2 * near + 1), ground + (tops - ground).max()) + self.margin

    def height_flown(self, higher: float) -> float:
        """Return so many times the usual height of the flight above the ground, as far as that is lawful."""
        return min(higher * self.height, max(self.height, self.lawful))


def site_of(mesh: Mesh, views: Views, points_in_world: Float[np.ndarray, "p 3"], margin: float | None) -> Site:
    """Return the ground of a flight; raises InputError where no ground is found, or no camera looks at it.

    margin: least distance above what is near; None for a share of the flight's height, where no metre is known.
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
    ahead = float(np.median(np.linalg.norm(looked_at - eyes[meets, :2], axis=1)))
    # Tilted cameras that look into the area stand outside it
    around = max(2 * picture, HIGHER * min(ahead, height) + picture / 2)
    surface = Raycaster(mesh.xyz.astype(float), mesh.triangles)
    area = _area(looked_at, eyes[:, :2], picture, around, surface, ground, mesh)
    samples, in_hole = _samples(area, mesh)
    kept = _MARGIN_SHARE * height if margin is None else margin
    return Site(area, samples, in_hole, surface, ground, height, picture, kept, np.inf if margin is None else _LAWFUL_M)


def _area(
    looked_at: Float[np.ndarray, "n 2"],
    eyes: Float[np.ndarray, "n 2"],
    picture: float,
    around: float,
    surface: Raycaster,
    ground: GroundModel,
    mesh: Mesh,
) -> Area:
    both = np.concatenate([looked_at, eyes])
    low, high = both.min(axis=0) - around, both.max(axis=0) + around
    cell = max(picture / _CELLS, float((high - low).max()) / _MOST_CELLS)
    columns, rows = np.ceil((high - low) / cell).astype(int)
    looked = np.zeros((rows, columns), bool)
    looked[tuple(np.floor((looked_at - low) / cell).astype(int).T[::-1])] = True
    area = Area(low, cell, looked, np.zeros((rows, columns)), np.zeros((rows, columns)), looked)
    xy = area.middle(np.ones_like(looked))
    with suppress(QhullError):  # all in a line: they enclose nothing
        looked |= (Delaunay(looked_at).find_simplex(xy) >= 0).reshape(looked.shape)
    wanted = _grown(looked, picture / 4 / cell)
    above = float(mesh.xyz[:, 2].max()) + 1
    hits = surface.cast(np.column_stack([xy, np.full(len(xy), above)]), np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    heights = np.where(hit, above - hits.distance, ground.height_at(xy)).reshape(wanted.shape)
    area = Area(low, cell, wanted, heights, heights, wanted & ~hit.reshape(wanted.shape))
    return replace(area, tops=_tops(area, mesh, hits.triangle.reshape(wanted.shape)))


def _tops(area: Area, mesh: Mesh, triangle: Int[np.ndarray, "y x"]) -> Float[np.ndarray, "y x"]:
    """Return the height of the highest thing in each cell. triangle: that is met there from above, -1 where none is.

    A piece of the mesh that hangs loose is none: it is nowhere within a cell of the surface as it is without narrow things.
    """
    smooth = median_filter(area.heights, 3)
    cell, inside = area.cell_of(mesh.xyz[:, :2])
    edges = mesh.triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    net = coo_array((np.ones(len(edges), bool), tuple(edges.T)), (len(mesh.xyz), len(mesh.xyz)))
    pieces, piece = connected_components(net, directed=False)
    nearest = np.full(pieces, np.inf)
    np.minimum.at(nearest, piece, np.where(inside, mesh.xyz[:, 2] - smooth[cell], -np.inf))
    loose = nearest[piece] > area.cell
    tops = np.where((triangle >= 0) & loose[mesh.triangles[triangle, 0]], smooth, area.heights)
    up = inside & ~loose
    np.maximum.at(tops, (cell[0][up], cell[1][up]), mesh.xyz[up, 2])
    return tops


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
