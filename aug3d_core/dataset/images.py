"""The one colour and resize convention of packed views.

Colours are 8-bit sRGB values as the photograph stores them; averages are over those values, not over linear light.
A view is cropped around its centre to the packed aspect, then shrunk with an area filter (every source pixel counts by
the share of it that the target pixel covers); never sharpened, never padded. Rendered colours are averaged weighted by
alpha, depths over covered pixels alone. CONVENTION names all this in the store's attributes.

Colours of a photograph with a mask are means over what is used. A pixel of which less than half is used has alpha 0, and the
colour of the nearest one that has not: nothing of what is masked is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Shaped, UInt8
from PIL import Image

from aug3d_core.geometry.area_mean import area_mean
from aug3d_core.geometry.masks import continued

_LEAST = 1e-6  # share of a pixel that is something

CONVENTION = "sRGB 8 bit; centre crop to aspect; exact area means of sRGB values; rounded to 8 bit"


@dataclass(frozen=True)
class Fit:
    """A centre crop of a source image, shrunk to a packed view. The crop is (left, top, right, bottom) in source px."""

    crop: tuple[float, float, float, float]
    width_px: int
    height_px: int

    def times(self, factor: int) -> Fit:
        """Return the same crop for a view so many times as wide and high."""
        return Fit(self.crop, factor * self.width_px, factor * self.height_px)

    @property
    def kept_share(self) -> float:
        """Share of the source's pixels that the crop keeps (left + right edges are the source's width)."""
        left, top, right, bottom = self.crop
        return float((right - left) * (bottom - top) / ((right + left) * (bottom + top)))

    @property
    def enlarged(self) -> float:
        """Pixels of the view along one of the source's: above 1, it is as soft as that makes it."""
        left, _, right, _ = self.crop
        return self.width_px / (right - left)

    def intrinsics(self, source: Float[np.ndarray, " 4"]) -> Float[np.ndarray, " 4"]:
        """Return (fx, fy, cx, cy) of the packed view; pixel centres are at half-integers, so edges scale plainly."""
        left, top, right, bottom = self.crop
        sx, sy = self.width_px / (right - left), self.height_px / (bottom - top)
        fx, fy, cx, cy = source
        return np.array([fx * sx, fy * sy, (cx - left) * sx, (cy - top) * sy])

    def colour(self, rgb: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "H W 3"]:
        """Shrink an opaque image."""
        return self._rounded(self._area(rgb))

    def alpha(self, used: Bool[np.ndarray, "h w"]) -> UInt8[np.ndarray, "H W"]:
        """Shrink a mask: 255 where half of a pixel or more is used, else 0."""
        return np.where(self._share(used) >= 0.5, np.uint8(255), np.uint8(0))

    def masked(self, rgb: UInt8[np.ndarray, "h w 3"], used: Bool[np.ndarray, "h w"]) -> UInt8[np.ndarray, "H W 3"]:
        """Shrink an image of which a part is masked; some of it has to be used."""
        share = np.maximum(self._share(used), _LEAST)[..., None]
        colour = self._rounded(self._area(rgb * used[..., None]) / share)
        return continued(colour, self.alpha(used) > 0)

    def covered(
        self, rgb: UInt8[np.ndarray, "h w 3"], alpha: UInt8[np.ndarray, "h w"], depth: Float[np.ndarray, "h w"]
    ) -> tuple[UInt8[np.ndarray, "H W 3"], UInt8[np.ndarray, "H W"], Float[np.ndarray, "H W"]]:
        """Shrink a render with holes: (colour, alpha, depth), each averaged over what is covered."""
        if rgb.shape[:2] == (self.height_px, self.width_px):
            return rgb, alpha, depth
        weight = alpha.astype(np.float32)
        cover = self._area(weight)
        colour = self._area(rgb * weight[..., None]) / np.maximum(cover, _LEAST)[..., None]
        share = self._area(depth > 0)
        mean_depth = np.where(share > _LEAST, self._area(np.maximum(depth, 0)) / np.maximum(share, _LEAST), 0)
        return self._rounded(colour), self._rounded(cover), mean_depth

    def nearest(self, values: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "H W"]:
        """Shrink a map whose values must not be mixed."""
        size = (self.width_px, self.height_px)
        image = Image.fromarray(np.ascontiguousarray(values, dtype=np.float32))
        return np.asarray(image.resize(size, Image.Resampling.NEAREST, box=self.crop))

    def _share(self, used: Bool[np.ndarray, "h w"]) -> Float[np.ndarray, "H W"]:
        return np.round(self._area(used), 5)  # as far as float32 tells a half and a whole

    def _area(self, values: Shaped[np.ndarray, "h w *c"]) -> Float[np.ndarray, "H W *c"]:
        return area_mean(values, (self.width_px, self.height_px), self.crop)

    @staticmethod
    def _rounded(values: np.ndarray) -> np.ndarray:
        return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def fit(source_width_px: int, source_height_px: int, width_px: int, height_px: int) -> Fit:
    """Return the largest centre crop of the packed aspect."""
    scale = min(source_width_px / width_px, source_height_px / height_px)
    # Rounding may leave less than nothing, which Pillow refuses: 50 px to 11
    left, top = max(0.0, (source_width_px - scale * width_px) / 2), max(0.0, (source_height_px - scale * height_px) / 2)
    return Fit((left, top, source_width_px - left, source_height_px - top), width_px, height_px)
