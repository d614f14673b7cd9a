"""Grain for textures: fractal noise, and one random value per slab, tile or brick."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from PIL import Image


def fractal(shape: tuple[int, ...], sizes_px: Sequence[float], rng: np.random.Generator) -> Float[np.ndarray, "h w"]:
    """Return noise of about zero mean and unit deviation with one octave of equal weight per lump size."""
    total = np.zeros(shape, np.float32)
    for size in sizes_px:
        total += _octave(shape, size, rng)
    return total / np.sqrt(len(sizes_px)).astype(np.float32)


def _octave(shape: tuple[int, ...], size_px: float, rng: np.random.Generator) -> Float[np.ndarray, "h w"]:
    if size_px <= 1:
        return rng.standard_normal(shape, dtype=np.float32)
    coarse = rng.standard_normal([int(n / size_px) + 3 for n in shape], dtype=np.float32)
    height, width = shape
    box = (1.0, 1.0, 1.0 + width / size_px, 1.0 + height / size_px)
    # Bicubic interpolation of unit noise has a deviation of about 0.75.
    return np.asarray(Image.fromarray(coarse).resize((width, height), Image.Resampling.BICUBIC, box=box)) / np.float32(
        0.75
    )


def per_cell(
    row: Int[np.ndarray, "*n"], column: Int[np.ndarray, "*n"], rng: np.random.Generator
) -> Float[np.ndarray, "*n"]:
    """Return one unit-deviation random value per cell; the pattern repeats after 251 x 241 cells, which nobody sees."""
    table = rng.standard_normal((251, 241), dtype=np.float32)
    return table[row % 251, column % 241]
