"""Textured triangle meshes as plain arrays, and their two files: an `.npz` of the geometry and a PNG of the texture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8
from PIL import Image

# Twice as fast to write as the default, and a tenth larger
_PNG_EFFORT = 2


@dataclass(frozen=True)
class TexturedMesh:
    """A triangle mesh in the world frame with a picture in sRGB.

    `uv` are texture coordinates of each triangle's corners, 0 to 1, v up: (0, 1) is the top left corner of the picture.
    """

    xyz: Float[np.ndarray, "v 3"]
    triangles: Int[np.ndarray, "t 3"]
    uv: Float[np.ndarray, "t 3 2"]
    texture: UInt8[np.ndarray, "h w 3"]

    def save(self, geometry: Path, texture: Path) -> None:
        """Write both files; the bytes depend on the arrays alone."""
        with geometry.open("wb") as file:
            np.savez(
                file,
                vertices=self.xyz.astype(np.float32),
                triangles=self.triangles.astype(np.int32),
                uv=self.uv.astype(np.float32),
            )
        Image.fromarray(self.texture).save(texture, compress_level=_PNG_EFFORT)

    @classmethod
    def load(cls, geometry: Path, texture: Path) -> TexturedMesh:
        """Read what `save` wrote; raises if an array is missing. Pickles are refused."""
        with np.load(geometry, allow_pickle=False) as arrays, Image.open(texture) as image:
            return cls(arrays["vertices"], arrays["triangles"], arrays["uv"], np.asarray(image.convert("RGB")))

    def colour_at(self, triangle: Int[np.ndarray, " p"], weights: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "p 3"]:
        """Return the colours (0 to 255) at barycentric places, bilinear between texels."""
        height, width = self.texture.shape[:2]
        u, v = np.einsum("pk,pkx->xp", weights, self.uv[triangle])
        x, y = u * width - 0.5, (1 - v) * height - 0.5
        left, top = np.floor(x).astype(int), np.floor(y).astype(int)
        right_share, low_share = (x - left)[:, None], (y - top)[:, None]
        left, right = left.clip(0, width - 1), (left + 1).clip(0, width - 1)
        top, low = top.clip(0, height - 1), (top + 1).clip(0, height - 1)
        upper = self.texture[top, left] * (1 - right_share) + self.texture[top, right] * right_share
        lower = self.texture[low, left] * (1 - right_share) + self.texture[low, right] * right_share
        return upper * (1 - low_share) + lower * low_share
