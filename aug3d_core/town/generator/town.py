"""The whole town as two textured meshes: the ground, and all that stands on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.geometry.ply import Mesh
from aug3d_core.town.config import TownConfig
from aug3d_core.town.generator.atlas import Atlas
from aug3d_core.town.generator.buildings import add_building
from aug3d_core.town.generator.cars import add_car
from aug3d_core.town.generator.model import Model, TexturedMesh
from aug3d_core.town.generator.painted_ground import FINEST_M, GroundPicture, paint_ground
from aug3d_core.town.generator.plan import Building, Tree
from aug3d_core.town.generator.planning import make_plan
from aug3d_core.town.generator.season import in_season
from aug3d_core.town.generator.swatches import add_swatches
from aug3d_core.town.generator.terrain import Terrain, bend
from aug3d_core.town.generator.trees import add_hedge, add_tree

_GROUND_CELL_M = 2.0
_ONE_HOUSE = 14  # seed of the house that identical buildings all are


@dataclass(frozen=True)
class Footprint:
    """The outline of a building's walls in the world, counter-clockwise, and the height of its top over the ground."""

    outline_m: Float[np.ndarray, "4 2"]
    height_m: float
    use: str


@dataclass(frozen=True)
class Town:
    """Meshes in the world frame with their textures, and where the buildings are."""

    ground: TexturedMesh
    ground_image: UInt8[np.ndarray, "h1 w1 3"]
    things: TexturedMesh
    things_image: UInt8[np.ndarray, "h2 w2 3"]
    footprints: tuple[Footprint, ...]


def build_town(config: TownConfig, terrain: Terrain, rng: np.random.Generator, texel_m: float = FINEST_M) -> Town:
    """Plan, paint and build a town; the same generator state gives the same town. texel_m: of the ground's texture."""
    plan = make_plan(config.length_m, config.width_m, rng, config.buildings)
    if terrain.lake:
        terrain.lake.flood(plan)
    model, atlas, footprints, levels = Model(), Atlas(), [], []
    swatches = add_swatches(atlas, rng)
    for building in plan.buildings:
        first = model.count
        own_rng = np.random.default_rng(_ONE_HOUSE) if config.buildings == "identical" else rng
        height = add_building(model, atlas, swatches, replace(building, bare_roof=config.bare_roofs), own_rng)
        footprints.append(Footprint(_outline(building), height, building.use))
        levels.append((first, model.count, building))
    for tree in _share_of(plan.trees, config.trees_share):
        add_tree(model, swatches, tree, rng)
    for hedge in plan.hedges:
        add_hedge(model, swatches, hedge, rng)
    for frame in plan.cars:
        add_car(model, swatches, frame, rng)
    picture = paint_ground(plan, config.length_m, config.width_m, rng, texel_m)
    vertices, triangles, patches, local = model.arrays()
    if terrain.levels_buildings:
        for first, end, building in levels:
            vertices[first:end] = _levelled(vertices[first:end], building, terrain)
    packed = atlas.pack()
    things = TexturedMesh(bend(vertices, terrain), triangles, packed.uv(patches, local))
    ground_image = in_season(picture.image, config.season, ground=True)
    things_image = in_season(packed.image, config.season)
    return Town(_ground_mesh(picture, terrain), ground_image, things, things_image, tuple(footprints))


def _share_of(trees: list[Tree], share: float) -> list[Tree]:
    """Return a share of the trees, spread over all of them."""
    return [tree for n, tree in enumerate(trees) if int((n + 1) * share) > int(n * share)]


def _levelled(points: Float[np.ndarray, "n 3"], b: Building, terrain: Terrain) -> Float[np.ndarray, "n 3"]:
    """Undo in advance what bending does to the heights of one building, and let its walls reach down to the ground."""
    level, own = (float(terrain.height(np.array(b.frame.x), np.array(b.frame.y))), terrain.height(*points[:, :2].T))
    x, y, z = points.T
    foot = np.where(z < 0, np.minimum(0.0, own - level), 0.0)
    return np.stack([x, y, z + level + foot - own], axis=1)


def coloured_mesh(town: Town) -> Mesh:
    """Merge the town into one mesh with the mean texture colour of each vertex's corners."""
    ground, things = town.ground, town.things
    return Mesh(
        np.concatenate([ground.vertices, things.vertices]),
        np.concatenate([_vertex_colours(ground, town.ground_image), _vertex_colours(things, town.things_image)]),
        np.concatenate([ground.triangles, things.triangles + len(ground.vertices)]),
    )


def _outline(b: Building) -> Float[np.ndarray, "4 2"]:
    x, y = b.width_m / 2, b.depth_m / 2
    corners = np.array([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)])
    return bend(b.frame.place(corners))[:, :2]


def _ground_mesh(picture: GroundPicture, terrain: Terrain) -> TexturedMesh:
    nx, ny = (int(np.ceil(2 * half / _GROUND_CELL_M)) + 1 for half in (picture.half_x_m, picture.half_y_m))
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, nx), np.linspace(0, 1, ny)))
    flat = np.stack([(2 * u - 1) * picture.half_x_m, (2 * v - 1) * picture.half_y_m, np.zeros_like(u)], axis=1)
    index = np.arange(nx * ny).reshape(ny, nx)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return TexturedMesh(bend(flat, terrain), triangles, np.stack([u, v], axis=1)[triangles])


def _vertex_colours(mesh: TexturedMesh, image: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "v 3"]:
    """Average the texture at points a little inside each corner, since corners lie on the rims of patches."""
    inside = 0.8 * mesh.uv + 0.2 * mesh.uv.mean(axis=1, keepdims=True)
    height, width = image.shape[:2]
    column = np.clip((inside[..., 0] * width).astype(int), 0, width - 1)
    row = np.clip(((1 - inside[..., 1]) * height).astype(int), 0, height - 1)
    return _mean_per_vertex(mesh.triangles, image[row, column], len(mesh.vertices))


def _mean_per_vertex(
    triangles: Int[np.ndarray, "t 3"], colours: UInt8[np.ndarray, "t 3 3"], vertices: int
) -> UInt8[np.ndarray, "v 3"]:
    corner = triangles.ravel()
    count = np.maximum(np.bincount(corner, minlength=vertices), 1)
    sums = [np.bincount(corner, colours[..., c].ravel(), minlength=vertices) for c in range(3)]
    return np.rint(np.stack(sums, axis=1) / count[:, None]).astype(np.uint8)
