"""Vertex colours: each vertex takes the blend of the few photographs that see it sharpest.

A photo's score at a vertex is the number of its pixels per unit of surface there, f^2 cos(angle) / depth^2: near and
head-on wins, and near its border a photo fades out. Blending only the best few keeps the sharpness that a mean over all
loses to errors of pose and shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from PIL import Image
from scipy import sparse
from scipy.ndimage import map_coordinates

from aug3d_core.geometry.transforms import apply, centres
from aug3d_core.geometry.views import Views
from aug3d_core.store.layout import image_name
from aug3d_core.surface.raycast import Raycaster
from aug3d_core.surface.shape import Shape, edges, vertex_normals

MIN_COSINE = 0.1  # flatter than this a photo sees the vertex as a smear
SHARPNESS = 4  # power of the score in the blend: the best dominates, and seams between photos still fade
BORDER_FADE = 0.05  # of a photo's shorter side: a photo that ended at full weight would leave an edge on the ground
FILL_ROUNDS = 6  # edges over which colour may creep into surface that no photo sees; the rest has no evidence


@dataclass(frozen=True)
class Colours:
    """The best photos' colours at each vertex."""

    rgb: UInt8[np.ndarray, "v 3"]
    known: Bool[np.ndarray, " v"]  # seen by a photo, or within a few edges of a vertex that is


def paint(
    shape: Shape,
    spacing: float,
    views: Views,
    chosen: Int[np.ndarray, " m"],
    images: Path,
    best: int,
    tick: Callable[[], None],
) -> Colours:
    """Colour the vertices of a mesh from the chosen views; `tick` is called after each photo."""
    normals = vertex_normals(shape)
    caster = Raycaster(shape.xyz, shape.triangles)
    scores = np.zeros((len(shape.xyz), best))
    colours = np.zeros((len(shape.xyz), best, 3))
    for view in chosen:
        vertex, xy, score = _sees(shape, normals, caster, spacing, views, view)
        if len(vertex):
            with Image.open(images / image_name(views.photo_id[view])) as image:
                sampled = _sample(image, xy, spacing * np.sqrt(np.median(score)))
            _insert(scores, colours, vertex, score, sampled)
        tick()
    weights = (scores / np.maximum(scores[:, :1], 1e-300)) ** SHARPNESS
    rgb = np.einsum("vk,vkc->vc", weights, colours) / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    rgb, known = _fill(shape, rgb, scores[:, 0] > 0)
    return Colours(np.rint(rgb).clip(0, 255).astype(np.uint8), known)


def _sees(
    shape: Shape, normals: np.ndarray, caster: Raycaster, spacing: float, views: Views, view: int
) -> tuple[Int[np.ndarray, " s"], Float[np.ndarray, "s 2"], Float[np.ndarray, " s"]]:
    """Return the vertices that a view sees unhidden, where in its image (px), and its score there."""
    fx, fy, cx, cy = views.intrinsics[view]
    in_cam = apply(views.cam_from_world[view], shape.xyz)
    depth = np.where(in_cam[:, 2] > 0, in_cam[:, 2], np.inf)
    xy = in_cam[:, :2] / depth[:, None] * (fx, fy) + (cx, cy)
    vertex = np.flatnonzero(np.isfinite(depth) & (xy > 1).all(axis=1) & (xy < views.size[view] - 1).all(axis=1))
    to_camera = centres(views.cam_from_world[view]) - shape.xyz[vertex]
    unit = to_camera / np.linalg.norm(to_camera, axis=1, keepdims=True)
    cosine = np.einsum("vi,vi->v", unit, normals[vertex])
    facing = cosine > MIN_COSINE
    vertex, to_camera, cosine = vertex[facing], to_camera[facing], cosine[facing]
    # Start a spacing off the surface, or the triangles around the vertex would hide it
    free = ~caster.occluded(shape.xyz[vertex] + spacing * normals[vertex], to_camera, near=0.0, far=1.0)
    vertex = vertex[free]
    to_border = np.minimum(xy[vertex], views.size[view] - xy[vertex]).min(axis=1) / views.size[view].min()
    fade = np.minimum(1.0, to_border / BORDER_FADE)
    return vertex, xy[vertex], fade * fx * fy * cosine[free] / depth[vertex] ** 2


def _sample(image: Image.Image, xy: Float[np.ndarray, "s 2"], pixels: float) -> Float[np.ndarray, "s 3"]:
    """Sample an image bilinearly, averaged over `pixels` first so that no detail between vertices aliases."""
    factor = max(1, round(pixels))
    grid = np.asarray(image.convert("RGB").reduce(factor), np.float32)
    rows_columns = (xy[:, ::-1] / factor - 0.5).T
    return np.stack([map_coordinates(grid[..., c], rows_columns, order=1, mode="nearest") for c in range(3)], axis=1)


def _insert(scores: np.ndarray, colours: np.ndarray, vertex: np.ndarray, score: np.ndarray, rgb: np.ndarray) -> None:
    """Put a view's scores and colours into the sorted lists of the best, in place."""
    for slot in range(scores.shape[1]):
        better = score > scores[vertex, slot]
        at = vertex[better]
        scores[at, slot], score[better] = score[better], scores[at, slot].copy()
        colours[at, slot], rgb[better] = rgb[better], colours[at, slot].copy()


def _fill(shape: Shape, rgb: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Spread colours along edges for a few rounds."""
    pairs = edges(shape)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    graph = sparse.csr_matrix((np.ones(len(both)), both.T), shape=(len(rgb), len(rgb)))
    for _ in range(FILL_ROUNDS):
        if known.all():
            break
        neighbours = graph @ known.astype(float)
        fresh = ~known & (neighbours > 0)
        rgb[fresh] = (graph[fresh] @ (rgb * known[:, None])) / neighbours[fresh, None]
        known = known | fresh
    return rgb, known


def ground_sampling(shape: Shape, views: Views, chosen: Iterable[int]) -> float:
    """Return the median size of a photo pixel on the surface, world units."""
    depths = [np.median(apply(views.cam_from_world[v], shape.xyz)[:, 2]) / views.intrinsics[v, 0] for v in chosen]
    return float(np.median(depths))
