"""The mesh beside the photographs: how alike they are where the mesh covers, and pictures for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image

from aug3d_core.geometry.area_mean import area_mean, shrunk
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.raycast import Hits, Raycaster, Render
from aug3d_core.geometry.textured import TexturedMesh
from aug3d_core.geometry.views import Views
from aug3d_core.photos.files import image_name

COVERED = 250  # alpha of a reduced pixel from which it counts as covered by the mesh
BACKGROUND = 245  # grey of pictures where there is no surface
TOP_VIEW_PX = 1000
GAP = 6  # px between pictures
_LEAST = 1e-3  # of alpha that has a colour
LIGHT = np.array([-0.4, 0.5, 0.77])  # from the north-west, as maps are shaded

AnyMesh = Mesh | TexturedMesh


@dataclass(frozen=True)
class Comparison:
    """One photo beside the mesh at its pose, both reduced to the size at which they are compared."""

    photo: UInt8[np.ndarray, "h w 3"]
    render: UInt8[np.ndarray, "h w 3"]
    alpha: UInt8[np.ndarray, "h w"]
    used: Bool[np.ndarray, "h w"]  # of the photo: not masked

    @property
    def covered(self) -> Bool[np.ndarray, "h w"]:
        """The pixels that the mesh covers, of those that are used."""
        return (self.alpha >= COVERED) & self.used

    @property
    def covered_share(self) -> float:
        """Share of the used pixels that the mesh covers; NaN where none is used."""
        return float(self.covered.sum() / self.used.sum()) if self.used.any() else float("nan")

    @property
    def psnr(self) -> float:
        """PSNR (dB) over covered pixels; NaN where none is."""
        return _psnr(self.photo[self.covered], self.render[self.covered])

    @property
    def flat_psnr(self) -> float:
        """PSNR (dB) of the photo's own mean colour over the same pixels: a render worse than that shows nothing right."""
        photo = self.photo[self.covered]
        return _psnr(photo, photo.mean(axis=0, keepdims=True) if len(photo) else photo)


def _psnr(truth: UInt8[np.ndarray, "p 3"], shown: np.ndarray) -> float:
    if not len(truth):
        return float("nan")
    return float(-10 * np.log10(max(np.mean(((truth.astype(float) - shown) / 255) ** 2), 1e-10)))


def rgba(render: Render) -> Image.Image:
    """Return a render as an image with transparency."""
    return Image.fromarray(np.dstack([render.rgb, render.alpha]), "RGBA")


def compare(photo: Path, render: Image.Image, longest_px: int, mask: Path | None = None) -> Comparison:
    """Reduce a photo and the render at its pose (RGBA) by averaging, to at most `longest_px`; the mask need not exist."""
    scale = min(1.0, longest_px / max(render.size))
    size = (max(1, round(render.width * scale)), max(1, round(render.height * scale)))
    with Image.open(photo) as image:
        truth = shrunk(np.asarray(image.convert("RGB")), size)
    pixels = np.asarray(render, np.float32)
    cover = area_mean(pixels[..., 3:], size)
    colour = area_mean(pixels[..., :3] * pixels[..., 3:], size) / np.maximum(cover, _LEAST)  # of what is covered
    small = np.rint(np.concatenate([colour, cover], axis=-1)).clip(0, 255).astype(np.uint8)
    used = None if mask is None else used_pixels(mask, size)
    return Comparison(truth, small[..., :3], small[..., 3], np.ones(truth.shape[:2], bool) if used is None else used)


def render_views(
    mesh: AnyMesh, views: Views, chosen: Iterable[int], exposures: Float[np.ndarray, "n 3"]
) -> Iterator[Image.Image]:
    """Render the mesh at the poses and sizes of views, as bright as each of them was exposed, one when it is asked for."""
    caster = Raycaster(mesh.xyz, mesh.triangles)
    for v in chosen:
        render = caster.render(mesh, views.cam_from_world[v], views.intrinsics[v], views.size[v])
        yield rgba(_exposed(render, exposures[v]))


def _exposed(render: Render, gain: Float[np.ndarray, " 3"]) -> Render:
    """Undo for one view what evened out the mesh's colours."""
    return replace(render, rgb=np.rint(render.rgb / gain).clip(0, 255).astype(np.uint8))


def compare_views(
    images: Path, masks: Path, views: Views, chosen: list[int], renders: Iterable[Image.Image], px: int
) -> list[Comparison]:
    """Compare renders with what is used of the photos of the same views."""
    return [
        compare(images / image_name(views.photo_id[view]), render, px, masks / image_name(views.photo_id[view]))
        for view, render in zip(chosen, renders, strict=True)
    ]


def side_by_side(
    images: Path, mesh: AnyMesh, views: Views, chosen: list[int], renders: list[Image.Image], width_px: int
) -> Image.Image:
    """Draw one row per view: the photo, the mesh at the same pose, and the mesh's bare shape."""
    caster = Raycaster(mesh.xyz, mesh.triangles)
    rows = []
    for view, render in zip(chosen, renders, strict=True):
        row = compare(images / image_name(views.photo_id[view]), render, width_px)
        alpha = row.alpha[..., None] / 255
        seen = (row.render * alpha + BACKGROUND * (1 - alpha)).astype(np.uint8)
        hits = caster.view(views.cam_from_world[view], views.intrinsics[view], views.size[view])
        shape = Image.fromarray(_shade(hits)).resize((seen.shape[1], seen.shape[0]), Image.Resampling.BOX)
        rows.append([Image.fromarray(row.photo), Image.fromarray(seen), shape])
    width, height = (max(row[0].size[axis] for row in rows) for axis in (0, 1))
    sheet = Image.new("RGB", (3 * (width + GAP) - GAP, len(rows) * (height + GAP) - GAP), (255, 255, 255))
    for i, row in enumerate(rows):
        for j, picture in enumerate(row):
            sheet.paste(picture, (j * (width + GAP), i * (height + GAP)))
    return sheet


def top_view(mesh: AnyMesh) -> Image.Image:
    """Draw the mesh from above, north up: its colours beside its shape under a low light."""
    low, high = mesh.xyz.min(axis=0).astype(float), mesh.xyz.max(axis=0).astype(float)
    cell = float((high - low)[:2].max()) / TOP_VIEW_PX
    x, y = np.arange(low[0] + cell / 2, high[0], cell), np.arange(high[1] - cell / 2, low[1], -cell)
    origins = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), high[2] + 1.0 + cell)], axis=-1)
    hits = Raycaster(mesh.xyz, mesh.triangles).cast(origins, np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    colour = np.full((*hit.shape, 3), BACKGROUND, np.uint8)
    colour[hit] = mesh.colour_at(hits.triangle[hit], hits.weights[hit])
    joined = np.concatenate([colour, _shade(hits)], axis=1 if len(y) >= len(x) else 0)
    return Image.fromarray(joined)


def _shade(hits: Hits) -> UInt8[np.ndarray, "h w 3"]:
    """Draw the surface as if it were grey under a low light; its back is lit as its front."""
    hit = hits.triangle >= 0
    shade = np.full((*hit.shape, 3), BACKGROUND, np.uint8)
    upward = hits.normal[hit] * np.where(hits.normal[hit][:, 2:] < 0, -1, 1)
    shade[hit] = (40 + 200 * (upward @ LIGHT).clip(0, 1))[:, None]
    return shade


def mean_finite(values: list[float]) -> float | None:
    """Return the mean of the numbers that are not NaN, rounded to 4 digits; None if there is none."""
    finite = [value for value in values if np.isfinite(value)]
    return round(float(np.mean(finite)), 4) if finite else None
