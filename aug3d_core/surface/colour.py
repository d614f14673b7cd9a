"""Colours from the photographs: each place takes the blend of the few that see it sharpest. Vertices and texels alike.

A photo's score at a place is the number of its pixels per unit of surface there, f^2 cos(angle) / depth^2: near and
head-on wins, and near its border a photo fades out. Blending only the best few keeps the sharpness that a mean over all
loses to errors of pose and shape. Exposure differences are evened out first (`exposure.py`).
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from PIL import Image
from scipy import sparse
from scipy.ndimage import map_coordinates

from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.transforms import apply, centres
from aug3d_core.geometry.views import Tracks, Views, _Arrays
from aug3d_core.photos.files import image_name
from aug3d_core.surface.exposure import exposure_gains
from aug3d_core.surface.kept import NOTHING_KEPT, Kept
from aug3d_core.surface.shape import Shape, edges, vertex_normals

MIN_COSINE = 0.1  # flatter than this a photo sees the place as a smear
SHARPNESS = 4  # power of the score in the blend: the best dominates, and seams between photos still fade
BORDER_FADE = 0.05  # of a photo's shorter side: a photo that ended at full weight would leave an edge on the ground
FILL_ROUNDS = 6  # edges over which colour may creep into surface that no photo sees; the rest has no evidence
EXPOSURE_PX = 4  # averaged over at a matched point
BLOCK = 1024  # places
_GOLDEN = (5**0.5 - 1) / 2
_NO_PART = 1e-3  # of a sample: rounding


class Framed(NamedTuple):
    """Spots that a view frames, where in its image (px), and how far ahead."""

    spot: Int[np.ndarray, " p"]
    x: Float[np.ndarray, " p"]
    y: Float[np.ndarray, " p"]
    depth: Float[np.ndarray, " p"]


class Spots:
    """Points of a surface; neighbours in the list should be neighbours in space, which saves time."""

    def __init__(self, xyz: Float[np.ndarray, "v 3"]) -> None:
        self.xyz = xyz
        # Balls around blocks of spots, to skip what a view cannot see
        first = np.arange(0, len(xyz), BLOCK)
        low, high = np.minimum.reduceat(xyz, first), np.maximum.reduceat(xyz, first)
        self._centre, self._radius = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2

    def framed(self, views: Views, view: int, rim_px: float) -> Framed:
        """Return the spots that a view has in its frame, further than so far from its border."""
        spot, pose, size = self._near_frame(views, view), views.cam_from_world[view], views.size[view]
        fx, fy, cx, cy = views.intrinsics[view]
        x, y, depth = pose[:, :3] @ self.xyz[spot].T + pose[:, 3:]  # axis by axis: numpy is slow across short rows
        ahead = depth > 0
        depth = np.where(ahead, depth, np.inf)
        x, y = x / depth * fx + cx, y / depth * fy + cy
        inside = ahead & (x > rim_px) & (x < size[0] - rim_px) & (y > rim_px) & (y < size[1] - rim_px)
        return Framed(spot[inside], x[inside], y[inside], depth[inside])

    def _near_frame(self, views: Views, view: int) -> Int[np.ndarray, " p"]:
        """Return the spots that a view may have in its frame, and some beside it."""
        in_cam = apply(views.cam_from_world[view], self._centre)
        sides = _frame_sides(views, view)
        inside = in_cam @ (sides / np.linalg.norm(sides, axis=1, keepdims=True)).T > -self._radius[:, None]
        block = np.flatnonzero(inside.all(axis=1))
        spot = (block[:, None] * BLOCK + np.arange(BLOCK)).ravel()
        return spot[spot < len(self.xyz)]


class Places(Spots):
    """Spots to be coloured, with unit normals."""

    def __init__(self, xyz: Float[np.ndarray, "v 3"], normals: Float[np.ndarray, "v 3"]) -> None:
        super().__init__(xyz)
        self.normals = normals


@dataclass(frozen=True)
class Colours(_Arrays):
    """The best photos' colours at each place."""

    rgb: UInt8[np.ndarray, "v 3"]
    known: Bool[np.ndarray, " v"]


@dataclass(frozen=True)
class Seen:
    """What one view shows of places that it may be among the best for."""

    place: Int[np.ndarray, " s"]
    score: Float32[np.ndarray, " s"]  # px per area of surface, faded towards the photo's border
    rgb: Float[np.ndarray, "s 3"]  # 0 to 255


class Photographs:
    """The photographs that may colour a surface, what they see of it, and how their exposures differ."""

    def __init__(
        self,
        views: Views,
        chosen: Int[np.ndarray, " m"],
        images: Path,
        masks: Path,
        shape: Shape,
        spacing: float,
        kept: Kept = NOTHING_KEPT,
    ) -> None:
        """`spacing` (world units) is the size of the detail to be coloured, and what counts as touching the surface."""
        self._views, self._chosen, self._spacing = views, chosen, spacing
        self._images, self._masks, self._kept = images, masks, kept
        self._caster = Raycaster(shape.xyz, shape.triangles)
        self.gains: Float[np.ndarray, "m 3"] = np.ones((len(chosen), 3))

    def for_detail(self, spacing: float) -> Photographs:
        """Return the same photographs for detail of another size (world units)."""
        other = copy.copy(self)
        other._spacing = spacing
        return other

    def even_out(self, tracks: Tracks) -> None:
        """Estimate the photos' gains from the points that they share.

        Matched points, not places of the mesh: where its shape is wrong, neighbouring photos show different things at a
        place, and small errors of neighbours add up along a flight (on `ochota` to a factor of 3).
        """
        point, photo, rgb = [], [], []
        for number, view in enumerate(self._chosen):
            seen = np.flatnonzero(tracks.view == view)
            colours, usable = self._sample(view, tracks.xy[seen], EXPOSURE_PX)
            seen = seen[usable]
            rgb.append(colours[usable])
            point.append(tracks.point[seen])
            photo.append(np.full(len(seen), number))
        self.gains = exposure_gains(
            np.concatenate(point), np.concatenate(photo), np.concatenate(rgb), len(self._chosen)
        )

    def paint(self, places: Places, best: int, tick: Callable[[], None], name: str) -> Colours:
        """Blend the `best` photos at each place; `tick` is called after each photo. name: under which they are kept."""
        if self._kept.has(name):
            for _ in self._chosen:
                tick()
        return self._kept.piece(name, Colours, lambda: self._blend(places, best, tick))

    def _blend(self, places: Places, best: int, tick: Callable[[], None]) -> Colours:
        scores = np.zeros((len(places.xyz), best), np.float32)
        colours = np.zeros((len(places.xyz), best, 3), np.float32)
        # Far from one to the next: along a flight scores rise and fall, and each photo would for a while be the best so far
        for photo in np.argsort(np.arange(len(self._chosen)) * _GOLDEN % 1):
            seen = self._look(places, int(self._chosen[photo]), scores[:, -1])
            _insert(scores, colours, seen.place, seen.score, seen.rgb * self.gains[photo])
            tick()
        weights = (scores / np.maximum(scores[:, :1], 1e-30)) ** SHARPNESS
        rgb = np.einsum("vk,vkc->vc", weights, colours) / np.maximum(weights.sum(axis=1, keepdims=True), 1e-30)
        return Colours(np.rint(rgb).clip(0, 255).astype(np.uint8), scores[:, 0] > 0)

    def _look(self, places: Places, view: int, least: Float32[np.ndarray, " v"]) -> Seen:
        place, xy, score, typical = self._sees(places, view, least)
        rgb = np.zeros((0, 3))
        if len(place):
            rgb, usable = self._sample(view, xy, self._spacing * np.sqrt(typical))
            place, score, rgb = place[usable], score[usable], rgb[usable]
        return Seen(place, score, rgb)

    def _sample(
        self, view: int, xy: Float[np.ndarray, "s 2"], pixels: float
    ) -> tuple[Float[np.ndarray, "s 3"], Bool[np.ndarray, " s"]]:
        """Return colours (0 to 255) of a view's image at places in it (px), averaged over `pixels`, and which may be used."""
        name = image_name(self._views.photo_id[view])
        used = used_pixels(self._masks / name)
        with Image.open(self._images / name) as image:
            rgb = _sample(image, xy, pixels)
        return rgb, np.ones(len(xy), bool) if used is None else _unmixed(used, xy, pixels)

    def _sees(
        self, places: Places, view: int, least: Float32[np.ndarray, " v"]
    ) -> tuple[Int[np.ndarray, " s"], Float[np.ndarray, "s 2"], Float32[np.ndarray, " s"], float]:
        """Return the places that a view sees unhidden with more than the `least` score, where in its image (px), and its score.

        Last comes the median score of all that it may see, hidden or not.
        """
        place, x, y, depth = places.framed(self._views, view, 1.0)
        to_camera = centres(self._views.cam_from_world[view]) - places.xyz[place]
        distance = np.sqrt(np.einsum("vi,vi->v", to_camera, to_camera))
        cosine = np.einsum("vi,vi->v", to_camera, places.normals[place]) / distance
        width, height = self._views.size[view]
        to_border = np.minimum(np.minimum(x, width - x), np.minimum(y, height - y)) / min(width, height)
        fx, fy = self._views.intrinsics[view, :2]
        score = (np.minimum(1.0, to_border / BORDER_FADE) * fx * fy * cosine / depth**2).astype(np.float32)
        facing = cosine > MIN_COSINE
        typical = float(np.median(score[facing])) if facing.any() else np.nan
        better = np.flatnonzero(facing & (score > least[place]))  # whether anything hides the others does not matter
        # Start a spacing off the surface, or the triangles around the place would hide it
        start = places.xyz[place[better]] + self._spacing * places.normals[place[better]]
        seen = better[~self._caster.occluded(start, to_camera[better], far=1.0)]
        return place[seen], np.stack([x[seen], y[seen]], axis=1), score[seen], typical


def paint_vertices(photographs: Photographs, shape: Shape, best: int, tick: Callable[[], None]) -> Colours:
    """Colour the vertices of a mesh; a vertex within a few edges of one that a photo sees counts as known."""
    colours = photographs.paint(Places(shape.xyz, vertex_normals(shape)), best, tick, "vertices")
    return _fill(shape, colours)


def _frame_sides(views: Views, view: int) -> Float[np.ndarray, "5 3"]:
    """Return the normals, inwards, of the four sides of what a view frames and of the camera's own plane, in its frame."""
    fx, fy, cx, cy = views.intrinsics[view]
    width, height = views.size[view]
    return np.array([(fx, 0, cx), (-fx, 0, width - cx), (0, fy, cy), (0, -fy, height - cy), (0, 0, 1.0)])


def ground_sampling(shape: Shape, views: Views, chosen: Iterable[int]) -> float:
    """Return the size of a photo pixel on the surface, across the view, world units: the median of the views' medians.

    Only what a view frames counts: of an oblique view most of a large surface lies elsewhere. NaN if no view frames any.
    """
    spots, sampling = Spots(shape.xyz), list[float]()
    for view in chosen:
        depth = spots.framed(views, view, 0.0).depth
        if len(depth):
            sampling.append(float(np.median(depth)) / views.intrinsics[view, 0])
    return float(np.median(sampling)) if sampling else np.nan


def _sample(image: Image.Image, xy: Float[np.ndarray, "s 2"], pixels: float) -> Float[np.ndarray, "s 3"]:
    """Sample an image bilinearly, averaged over `pixels` first so that no detail between places aliases."""
    factor = max(1, round(pixels))
    grid = np.asarray(image.convert("RGB").reduce(factor), np.float32)
    rows_columns = (xy[:, ::-1] / factor - 0.5).T
    return np.stack([map_coordinates(grid[..., c], rows_columns, order=1, mode="nearest") for c in range(3)], axis=1)


def _unmixed(used: Bool[np.ndarray, "h w"], xy: Float[np.ndarray, "s 2"], pixels: float) -> Bool[np.ndarray, " s"]:
    """Tell which of the samples that `_sample` takes have no part of what is masked."""
    factor = max(1, round(pixels))
    masked = Image.fromarray(np.where(used, np.uint8(0), np.uint8(255))).convert("F").reduce(factor)
    grid = (np.asarray(masked) > 0).astype(np.float32)
    rows_columns = (xy[:, ::-1] / factor - 0.5).T
    return map_coordinates(grid, rows_columns, order=1, mode="nearest") < _NO_PART


def _insert(scores: np.ndarray, colours: np.ndarray, place: np.ndarray, score: np.ndarray, rgb: np.ndarray) -> None:
    """Put a view's scores and colours into the sorted lists of the best, in place."""
    score, rgb = score.copy(), rgb.astype(colours.dtype)
    for slot in range(scores.shape[1]):
        better = score > scores[place, slot]
        at = place[better]
        scores[at, slot], score[better] = score[better], scores[at, slot].copy()
        colours[at, slot], rgb[better] = rgb[better], colours[at, slot].copy()


def _fill(shape: Shape, colours: Colours) -> Colours:
    """Spread colours along edges for a few rounds."""
    rgb, known, pairs = colours.rgb.astype(float), colours.known, edges(shape)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    graph = sparse.csr_matrix((np.ones(len(both)), both.T), shape=(len(rgb), len(rgb)))
    for _ in range(FILL_ROUNDS):
        neighbours = graph @ known.astype(float)
        fresh = ~known & (neighbours > 0)
        if not fresh.any():
            break
        rgb[fresh] = (graph[fresh] @ (rgb * known[:, None])) / neighbours[fresh, None]
        known = known | fresh
    return Colours(np.rint(rgb).clip(0, 255).astype(np.uint8), known)
