"""Painted walls: plaster or brick with windows, doors, shop fronts. Every wall is a picture of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from aug3d_core.town.generator.noise import fractal, per_cell

PX_PER_M = 12.5
_FRAME = (0.90, 0.89, 0.86)
_DOORS = ((0.34, 0.22, 0.15), (0.20, 0.30, 0.24), (0.45, 0.16, 0.14), (0.25, 0.28, 0.36))
PLASTERS = (
    (0.86, 0.82, 0.73), (0.90, 0.88, 0.84), (0.85, 0.74, 0.55),
    (0.80, 0.62, 0.50), (0.74, 0.77, 0.76), (0.88, 0.80, 0.66),
)  # fmt: skip
BRICKS = ((0.55, 0.32, 0.25), (0.62, 0.42, 0.33), (0.50, 0.36, 0.31))


@dataclass(frozen=True)
class WallStyle:
    """How a building's walls look; `storey_m` sets the rows of windows."""

    colour: tuple[float, float, float]
    brick: bool
    storey_m: float
    window_m: tuple[float, float]  # width, height
    spacing_m: float
    shutters: tuple[float, float, float] | None


def wall_style(use: str, rng: np.random.Generator) -> WallStyle:
    """Draw a look that suits the building's use."""
    brick = bool(rng.random() < (0.5 if use == "row" else 0.2))
    palette = BRICKS if brick else PLASTERS
    colour = tuple(np.array(palette[rng.integers(len(palette))]) + rng.normal(0, 0.02, 3))
    if use in ("hall", "shed"):
        grey = rng.uniform(0.45, 0.75)
        return WallStyle((grey, grey, grey * 0.98), False, 4.0, (3.2, 1.6), 5.0, None)
    if use == "flats":
        return WallStyle(colour, brick, 3.0, (1.7, 1.5), 3.0, None)
    shutters = _DOORS[rng.integers(len(_DOORS))] if rng.random() < 0.45 else None
    return WallStyle(colour, brick, 2.7, (1.1, 1.35), 2.4, shutters)


def paint_wall(
    width_m: float, height_m: float, top_m: float, style: WallStyle, door: bool, rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """Paint a wall; windows keep under `top_m`, where the eaves are. The last row of pixels is the ground."""
    shape = (max(4, round(height_m * PX_PER_M)), max(4, round(width_m * PX_PER_M)))
    image = _surface(shape, style, rng)
    for floor in range(max(1, int((top_m + 0.3) / style.storey_m))):
        _floor(image, width_m, floor, style, door and floor == 0, rng)
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def _surface(shape: tuple[int, int], style: WallStyle, rng: np.random.Generator) -> Float[np.ndarray, "h w 3"]:
    light = 1 + 0.035 * fractal(shape, [1, 2, 5], rng) + 0.04 * fractal(shape, [14, 40], rng)
    if style.brick:
        y, x = np.indices(shape)
        light = light + 0.13 * per_cell(y // 2, (x + y // 2 % 2 * 2) // 4, rng)
    up = np.arange(shape[0])[::-1, None] / PX_PER_M
    light = light - 0.16 * np.exp(-up / 0.5)  # splashes at the foot
    return np.array(style.colour, np.float32) * light[..., None]


def _floor(
    image: Float[np.ndarray, "h w 3"],
    width_m: float,
    floor: int,
    style: WallStyle,
    door: bool,
    rng: np.random.Generator,
) -> None:
    window_w, window_h = style.window_m
    count = int((width_m - 0.8) / style.spacing_m)
    at = (np.arange(count) + 0.5) * (width_m - 0.6) / max(count, 1) + 0.3
    sill = floor * style.storey_m + 0.9
    entrance = int(rng.integers(count)) if door and count else -1
    for i, x in enumerate(at):
        if i == entrance:
            _fill(image, x - 0.65, 0.0, x + 0.65, 2.35, _FRAME)
            _fill(image, x - 0.5, 0.0, x + 0.5, 2.2, _DOORS[rng.integers(len(_DOORS))])
        elif rng.random() < 0.93:
            _window(image, x, sill, window_w, window_h, style, rng)
    if door and not count:
        _fill(image, width_m / 2 - 0.5, 0.0, width_m / 2 + 0.5, 1.9, _DOORS[0])


def _window(
    image: Float[np.ndarray, "h w 3"], x: float, sill: float, width: float, height: float, style: WallStyle,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    left, right, top = x - width / 2, x + width / 2, sill + height
    if style.shutters:
        for side in (left - 0.5, right):
            _fill(image, side, sill, side + 0.5, top, style.shutters)
    _fill(image, left - 0.1, sill - 0.16, right + 0.1, sill, (0.78, 0.76, 0.72))
    _fill(image, left, sill, right, top, _FRAME)
    glass = np.array([0.16, 0.20, 0.24]) + rng.normal(0, 0.03, 3) + rng.uniform(0, 0.14)
    middle = (left + right) / 2
    _fill(image, left + 0.08, sill + 0.08, middle - 0.04, top - 0.08, glass)
    _fill(image, middle + 0.04, sill + 0.08, right - 0.08, top - 0.08, glass * rng.uniform(0.85, 1.2))
    if rng.random() < 0.35:  # a blind, partly down
        _fill(image, left + 0.08, top - height * rng.uniform(0.25, 0.8), right - 0.08, top - 0.08, (0.80, 0.78, 0.72))


def _fill(image: Float[np.ndarray, "h w 3"], x0: float, y0: float, x1: float, y1: float, colour: object) -> None:
    """Paint a rectangle given in metres from the lower left corner."""
    height, width = image.shape[:2]
    rows = slice(max(0, height - round(y1 * PX_PER_M)), max(0, height - round(y0 * PX_PER_M)))
    columns = slice(max(0, round(x0 * PX_PER_M)), min(width, round(x1 * PX_PER_M)))
    image[rows, columns] = colour
