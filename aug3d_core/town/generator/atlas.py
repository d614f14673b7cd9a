"""Many small pictures packed into one texture."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int, UInt8

_MIN_WIDTH = 2048


@dataclass
class Atlas:
    """Patches in the order they were added; `pack` lays them out."""

    patches: list[UInt8[np.ndarray, "h w 3"]] = field(default_factory=list)

    def add(self, image: UInt8[np.ndarray, "h w 3"]) -> int:
        """Keep a picture and return its number."""
        self.patches.append(image)
        return len(self.patches) - 1

    def pack(self) -> PackedAtlas:
        """Lay the patches out on shelves, tallest first, each with a one-pixel rim of its own colours."""
        sizes = np.array([p.shape[:2] for p in self.patches]) + 2
        width = int(max(_MIN_WIDTH, sizes[:, 1].max(), 2 ** np.ceil(np.log2(np.sqrt(sizes.prod(axis=1).sum())))))
        corner = np.zeros((len(sizes), 2), int)  # y, x
        x = y = shelf = 0
        for i in np.lexsort((np.arange(len(sizes)), -sizes[:, 0])):
            if x + sizes[i, 1] > width:
                x, y, shelf = 0, y + shelf, 0
            corner[i] = y, x
            x, shelf = x + sizes[i, 1], max(shelf, sizes[i, 0])
        image = np.zeros((y + shelf, width, 3), np.uint8)
        for patch, (py, px), (h, w) in zip(self.patches, corner, sizes, strict=True):
            image[py : py + h, px : px + w] = np.pad(patch, ((1, 1), (1, 1), (0, 0)), mode="edge")
        return PackedAtlas(image, corner + 1, sizes - 2)


@dataclass(frozen=True)
class PackedAtlas:
    """One texture and where each patch lies in it."""

    image: UInt8[np.ndarray, "h w 3"]
    corner: Int[np.ndarray, "n 2"]  # y, x of the first pixel
    size: Int[np.ndarray, "n 2"]  # height, width

    def uv(self, patch: Int[np.ndarray, " t"], local: Float[np.ndarray, "t 3 2"]) -> Float[np.ndarray, "t 3 2"]:
        """Map coordinates within patches (0..1, v up) to coordinates in the texture (0..1, v up)."""
        height, width = self.image.shape[:2]
        corner, size = self.corner[patch][:, None], self.size[patch][:, None]
        u = (corner[..., 1] + local[..., 0] * size[..., 1]) / width
        v = 1.0 - (corner[..., 0] + (1.0 - local[..., 1]) * size[..., 0]) / height
        return np.stack([u, v], axis=-1)
