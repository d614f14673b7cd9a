"""The mesh beside the photographs: how alike they are where the mesh covers, and pictures for people."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Views
from aug3d_core.store.layout import image_name
from aug3d_core.surface.raycast import Raycaster, Render

COVERED = 250  # alpha of a reduced pixel from which it counts as covered by the mesh
BACKGROUND = 245  # grey of pictures where there is no surface
TOP_VIEW_PX = 1000
LIGHT = np.array([-0.4, 0.5, 0.77])  # from the north-west, as maps are shaded


@dataclass(frozen=True)
class Comparison:
    """One photo beside the mesh at its pose, both reduced to the size at which they are compared."""

    photo: UInt8[np.ndarray, "h w 3"]
    render: UInt8[np.ndarray, "h w 3"]
    alpha: UInt8[np.ndarray, "h w"]

    @property
    def covered_share(self) -> float:
        """Share of pixels that the mesh covers."""
        return float((self.alpha >= COVERED).mean())

    @property
    def psnr(self) -> float:
        """PSNR (dB) over covered pixels; NaN where none is."""
        covered = self.alpha >= COVERED
        if not covered.any():
            return float("nan")
        error = (self.photo[covered].astype(float) - self.render[covered]) / 255
        return float(-10 * np.log10(max(np.mean(error**2), 1e-10)))


def rgba(render: Render) -> Image.Image:
    """Return a render as an image with transparency."""
    return Image.fromarray(np.dstack([render.rgb, render.alpha]), "RGBA")


def compare(photo: Path, render: Image.Image, longest_px: int) -> Comparison:
    """Reduce a photo and the render at its pose (RGBA) by averaging, to at most `longest_px`."""
    scale = min(1.0, longest_px / max(render.size))
    size = (max(1, round(render.width * scale)), max(1, round(render.height * scale)))
    with Image.open(photo) as image:
        truth = np.asarray(image.convert("RGB").resize(size, Image.Resampling.BOX))
    small = np.asarray(render.resize(size, Image.Resampling.BOX))
    return Comparison(truth, small[..., :3], small[..., 3])


def render_views(mesh: Mesh, views: Views, chosen: list[int]) -> list[Image.Image]:
    """Render the mesh at the poses and sizes of views."""
    caster = Raycaster(mesh.xyz, mesh.triangles)
    return [rgba(caster.render(mesh.rgb, views.cam_from_world[v], views.intrinsics[v], views.size[v])) for v in chosen]


def compare_views(
    images: Path, views: Views, chosen: list[int], renders: list[Image.Image], px: int
) -> list[Comparison]:
    """Compare renders with the photos of the same views."""
    return [
        compare(images / image_name(views.photo_id[view]), render, px)
        for view, render in zip(chosen, renders, strict=True)
    ]


def side_by_side(
    images: Path, views: Views, chosen: list[int], renders: list[Image.Image], width_px: int
) -> Image.Image:
    """Draw one row per view: the photo, then the mesh at the same pose."""
    rows = [compare(images / image_name(views.photo_id[v]), r, width_px) for v, r in zip(chosen, renders, strict=True)]
    height, width = (max(row.alpha.shape[axis] for row in rows) for axis in (0, 1))
    gap = 6
    sheet = Image.new("RGB", (2 * width + gap, len(rows) * (height + gap) - gap), (255, 255, 255))
    for i, row in enumerate(rows):
        alpha = row.alpha[..., None] / 255
        seen = (row.render * alpha + BACKGROUND * (1 - alpha)).astype(np.uint8)
        sheet.paste(Image.fromarray(row.photo), (0, i * (height + gap)))
        sheet.paste(Image.fromarray(seen), (width + gap, i * (height + gap)))
    return sheet


def top_view(mesh: Mesh) -> Image.Image:
    """Draw the mesh from above, north up: its colours beside its shape under a low light."""
    low, high = mesh.xyz.min(axis=0).astype(float), mesh.xyz.max(axis=0).astype(float)
    cell = float((high - low)[:2].max()) / TOP_VIEW_PX
    x, y = np.arange(low[0] + cell / 2, high[0], cell), np.arange(high[1] - cell / 2, low[1], -cell)
    origins = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), high[2] + 1.0 + cell)], axis=-1)
    hits = Raycaster(mesh.xyz, mesh.triangles).cast(origins, np.array([0.0, 0.0, -1.0]))
    hit = hits.triangle >= 0
    colour = np.full((*hit.shape, 3), BACKGROUND, np.uint8)
    shade = colour.copy()
    colour[hit] = np.einsum("pk,pkc->pc", hits.weights[hit], mesh.rgb[mesh.triangles[hits.triangle[hit]]])
    upward = hits.normal[hit] * np.where(hits.normal[hit][:, 2:] < 0, -1, 1)
    shade[hit] = (40 + 200 * (upward @ LIGHT).clip(0, 1))[:, None]
    joined = np.concatenate([colour, shade], axis=1 if len(y) >= len(x) else 0)
    return Image.fromarray(joined)


def mean_finite(values: list[float]) -> float | None:
    """Return the mean of the numbers that are not NaN, rounded to 4 digits; None if there is none."""
    finite = [value for value in values if np.isfinite(value)]
    return round(float(np.mean(finite)), 4) if finite else None
