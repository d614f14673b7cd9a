"""The whole town as two textured meshes: the ground, and all that stands on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from aug3d_core.geometry.ply import Mesh
from aug3d_core.testbed.atlas import Atlas
from aug3d_core.testbed.buildings import add_building
from aug3d_core.testbed.cars import add_car
from aug3d_core.testbed.ground import GroundPicture, paint_ground
from aug3d_core.testbed.model import Model, TexturedMesh
from aug3d_core.testbed.plan import Building
from aug3d_core.testbed.planning import make_plan
from aug3d_core.testbed.swatches import add_swatches
from aug3d_core.testbed.trees import add_hedge, add_tree

_GROUND_CELL_M = 2.0
_TURN_DEG = 5.0  # streets that run exactly along the flight lines would look drawn


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
    ground_image: UInt8[np.ndarray, "h w 3"]
    things: TexturedMesh
    things_image: UInt8[np.ndarray, "h w 3"]
    footprints: tuple[Footprint, ...]


def build_town(length_m: float, width_m: float, rng: np.random.Generator) -> Town:
    """Plan, paint and build a town; the same generator state gives the same town."""
    plan = make_plan(length_m, width_m, rng)
    model, atlas, footprints = Model(), Atlas(), []
    swatches = add_swatches(atlas, rng)
    for building in plan.buildings:
        height = add_building(model, atlas, swatches, building, rng)
        footprints.append(Footprint(_outline(building), height, building.use))
    for tree in plan.trees:
        add_tree(model, swatches, tree, rng)
    for hedge in plan.hedges:
        add_hedge(model, swatches, hedge, rng)
    for frame in plan.cars:
        add_car(model, swatches, frame, rng)
    picture = paint_ground(plan, length_m, width_m, rng)
    vertices, triangles, patches, local = model.arrays()
    packed = atlas.pack()
    things = TexturedMesh(bend(vertices), triangles, packed.uv(patches, local))
    return Town(_ground_mesh(picture), picture.image, things, packed.image, tuple(footprints))


def bend(points_in_town: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Map the flat, right-angled town to the world: streets sway, the ground rolls, all is turned a little."""
    x, y, z = points_in_town.T
    swayed_x, swayed_y = x + 2.5 * np.sin(y * 2 * np.pi / 230 + 0.7), y + 3.0 * np.sin(x * 2 * np.pi / 280 + 0.4)
    hills = 1.1 * np.sin(x * 2 * np.pi / 170 + 1.0) + 0.8 * np.sin(y * 2 * np.pi / 120 + 2.0)
    c, s = np.cos(np.radians(_TURN_DEG)), np.sin(np.radians(_TURN_DEG))
    return np.stack([c * swayed_x - s * swayed_y, s * swayed_x + c * swayed_y, z + hills], axis=1)


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


def _ground_mesh(picture: GroundPicture) -> TexturedMesh:
    nx, ny = (int(np.ceil(2 * half / _GROUND_CELL_M)) + 1 for half in (picture.half_x_m, picture.half_y_m))
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, nx), np.linspace(0, 1, ny)))
    flat = np.stack([(2 * u - 1) * picture.half_x_m, (2 * v - 1) * picture.half_y_m, np.zeros_like(u)], axis=1)
    index = np.arange(nx * ny).reshape(ny, nx)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return TexturedMesh(bend(flat), triangles, np.stack([u, v], axis=1)[triangles])


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
