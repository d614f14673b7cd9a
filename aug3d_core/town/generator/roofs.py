"""Painted roofs: tiles in rows, gravel, sheet metal; with roof windows and solar panels."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float, UInt8

from aug3d_core.town.generator.noise import fractal, per_cell

PX_PER_M = 14.0
TILES = (
    (0.58, 0.30, 0.22),
    (0.64, 0.37, 0.27),
    (0.50, 0.27, 0.22),
    (0.36, 0.34, 0.34),
    (0.30, 0.31, 0.34),
    (0.45, 0.36, 0.30),
)
Cover = Literal["tiles", "gravel", "metal", "bare"]
_PANEL = (0.10, 0.13, 0.24)


def paint_roof(
    width_m: float,
    slope_m: float,
    cover: Cover,
    colour: tuple[float, float, float],
    flat_top_m: float,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "h w 3"]:
    """Paint one roof plane, the eaves at the last row; roof windows or solar panels keep within the ridge's length."""
    shape = (max(4, round(slope_m * PX_PER_M)), max(4, round(width_m * PX_PER_M)))
    if cover == "bare":
        return np.tile(np.rint(255 * np.clip(colour, 0, 1)).astype(np.uint8), (*shape, 1))
    light = _COVERS[cover](shape, rng)
    image = np.array(colour, np.float32) * light[..., None]
    moss = np.clip(fractal(shape, [9, 25, 60], rng) - 0.9, 0, 1.2) * (0.35 if cover == "tiles" else 0.12)
    image = image * (1 - moss[..., None]) + moss[..., None] * np.array([0.33, 0.36, 0.22], np.float32)
    _add_extras(image, round(flat_top_m * PX_PER_M), rng)
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def _tiles(shape: tuple[int, int], rng: np.random.Generator) -> Float[np.ndarray, "h w"]:
    y, x = np.indices(shape)
    light = 1 + 0.13 * per_cell(y // 5, (x + y // 5 % 2 * 2) // 4, rng) + 0.07 * fractal(shape, [1, 7, 30], rng)
    return light - 0.20 * (y % 5 == 4) - 0.07 * (x % 4 == 0)


def _gravel(shape: tuple[int, int], rng: np.random.Generator) -> Float[np.ndarray, "h w"]:
    light = 1 + 0.09 * fractal(shape, [1, 2, 4], rng) + 0.08 * fractal(shape, [12, 35, 90], rng)
    seams = np.arange(shape[1])[None, :] % round(2.1 * PX_PER_M) == 0
    return light - 0.12 * seams


def _metal(shape: tuple[int, int], rng: np.random.Generator) -> Float[np.ndarray, "h w"]:
    x = np.arange(shape[1])[None, :]
    ribs = 0.06 * np.sign(np.sin(x * 2 * np.pi / 9.0))
    sheet = per_cell(np.zeros_like(x), x // round(1.2 * PX_PER_M), rng)
    streaks = fractal((1, shape[1]), [2, 6], rng)
    return 1 + ribs + 0.05 * sheet + 0.04 * streaks + 0.05 * fractal(shape, [1, 3, 20, 50], rng)


_COVERS = {"tiles": _tiles, "gravel": _gravel, "metal": _metal}


def _add_extras(image: Float[np.ndarray, "h w 3"], usable_px: int, rng: np.random.Generator) -> None:
    height, width = image.shape[:2]
    middle = image[:, (width - usable_px) // 2 : (width + usable_px) // 2]
    if rng.random() < 0.28 and height > 45 and usable_px > 62:
        _solar(middle, rng)
    elif usable_px > 30:
        for _ in range(int(rng.integers(0, 3))):
            y, x = (
                int(rng.uniform(0.2, 0.6) * height),
                int((width - usable_px) / 2 + rng.uniform(0.05, 0.8) * usable_px),
            )
            image[y : y + 17, x : x + 13] = (0.80, 0.80, 0.80)
            image[y + 2 : y + 15, x + 2 : x + 11] = np.array([0.20, 0.26, 0.32]) + rng.uniform(-0.04, 0.15)


def _solar(image: Float[np.ndarray, "h w 3"], rng: np.random.Generator) -> None:
    height, width = image.shape[:2]
    panel_h, panel_w = 24, 15
    rows, columns = min(2, (height - 16) // panel_h), min(int(rng.integers(3, 8)), (width - 16) // panel_w)
    top, left = (height - rows * panel_h) // 2, int(rng.integers(8, width - 8 - columns * panel_w + 1))
    for row in range(rows):
        for column in range(columns):
            y, x = top + row * panel_h, left + column * panel_w
            image[y : y + panel_h, x : x + panel_w] = (0.62, 0.63, 0.65)
            image[y + 1 : y + panel_h - 1, x + 1 : x + panel_w - 1] = np.array(_PANEL) * rng.uniform(0.85, 1.2)
            image[y + panel_h // 2, x + 1 : x + panel_w - 1] = (0.3, 0.33, 0.42)
