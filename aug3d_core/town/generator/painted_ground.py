"""The ground as one painted picture: what the plan says, with the grain of each material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image, ImageDraw

from aug3d_core.town.generator.noise import fractal, per_cell
from aug3d_core.town.generator.plan import MARGIN_M, Ground, Plan

_MAX_PX = 8192
FINEST_M = 0.07  # finer than a photograph's pixel on the ground (0.11 m at 640 px from 55 m)

# colour (sRGB 0..1), strength of the fine grain, of the coarse stains
_LOOK = {
    Ground.MEADOW: ((0.44, 0.47, 0.28), 0.13, 0.09),
    Ground.LAWN: ((0.38, 0.44, 0.24), 0.12, 0.06),
    Ground.ASPHALT: ((0.40, 0.40, 0.41), 0.07, 0.06),
    Ground.PAVEMENT: ((0.62, 0.60, 0.57), 0.06, 0.05),
    Ground.KERB: ((0.72, 0.71, 0.68), 0.05, 0.05),
    Ground.PAINT: ((0.86, 0.86, 0.83), 0.06, 0.05),
    Ground.GRAVEL: ((0.70, 0.64, 0.54), 0.13, 0.05),
    Ground.TERRACE: ((0.63, 0.52, 0.45), 0.07, 0.05),
    Ground.WATER: ((0.22, 0.38, 0.40), 0.03, 0.10),
    Ground.SAND: ((0.80, 0.72, 0.55), 0.06, 0.05),
    Ground.FIELD: ((0.60, 0.52, 0.35), 0.10, 0.08),
    Ground.SOIL: ((0.36, 0.28, 0.21), 0.16, 0.08),
    Ground.PATCHED: ((0.31, 0.31, 0.33), 0.08, 0.05),
    Ground.IRON: ((0.24, 0.23, 0.22), 0.12, 0.05),
    Ground.FOREST: ((0.30, 0.30, 0.17), 0.16, 0.12),
    Ground.LAKE: ((0.24, 0.33, 0.36), 0.0, 0.0),
}


@dataclass(frozen=True)
class GroundPicture:
    """The painted ground: row 0 is the north edge; covers +-half_x by +-half_y metres about the town's centre."""

    image: UInt8[np.ndarray, "h w 3"]
    half_x_m: float
    half_y_m: float


def paint_ground(
    plan: Plan, length_m: float, width_m: float, rng: np.random.Generator, texel_m: float = FINEST_M
) -> GroundPicture:
    """Paint the plan's ground, as finely as asked for and as fits into one texture."""
    half_x, half_y = length_m / 2 + MARGIN_M, width_m / 2 + MARGIN_M
    pixel_m = max(texel_m, 2 * max(half_x, half_y) / _MAX_PX)
    shape = (round(2 * half_y / pixel_m), round(2 * half_x / pixel_m))
    kind = _labels(plan, half_x, half_y, shape)
    return GroundPicture(_colour(kind, pixel_m, rng), half_x, half_y)


def _labels(plan: Plan, half_x: float, half_y: float, shape: tuple[int, int]) -> UInt8[np.ndarray, "h w"]:
    image = Image.new("L", (shape[1], shape[0]), int(Ground.MEADOW))
    draw = ImageDraw.Draw(image)
    for ground, corners in plan.paint:
        pixels = [((x + half_x) / (2 * half_x) * shape[1], (half_y - y) / (2 * half_y) * shape[0]) for x, y in corners]
        draw.polygon(pixels, fill=int(ground))
    return np.asarray(image)


def _colour(kind: UInt8[np.ndarray, "h w"], pixel_m: float, rng: np.random.Generator) -> UInt8[np.ndarray, "h w 3"]:
    base = np.zeros((len(Ground), 3), np.float32)
    fine, coarse = np.zeros(len(Ground), np.float32), np.zeros(len(Ground), np.float32)
    for ground, (colour, grain, stains) in _LOOK.items():
        base[ground], fine[ground], coarse[ground] = colour, grain, stains
    grain = fractal(kind.shape, [1, 0.18 / pixel_m, 0.4 / pixel_m, 0.9 / pixel_m], rng)
    stains = fractal(kind.shape, [2.2 / pixel_m, 6 / pixel_m, 17 / pixel_m], rng)
    light = 1 + fine[kind] * grain + coarse[kind] * stains + _pattern(kind, pixel_m, rng)
    image = base[kind] * light[..., None]
    _wither(image, kind, stains, rng)
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def _pattern(kind: UInt8[np.ndarray, "h w"], pixel_m: float, rng: np.random.Generator) -> Float[np.ndarray, "h w"]:
    """Return the regular part of each material: slabs, furrows, mown stripes, flowers, cracks."""
    y, x = (np.arange(n, dtype=np.float32) * pixel_m for n in kind.shape)
    light = np.zeros(kind.shape, np.float32)
    for ground, slab_m, vary in ((Ground.PAVEMENT, 0.6, 0.06), (Ground.TERRACE, 0.5, 0.10)):
        rows, columns = np.nonzero(kind == ground)
        slab_y, slab_x = y[rows] / slab_m, x[columns] / slab_m
        joint = (slab_y % 1 < 0.13) | (slab_x % 1 < 0.13)
        light[rows, columns] = vary * per_cell(slab_y.astype(int), slab_x.astype(int), rng) - 0.16 * joint
    light += np.where(kind == Ground.FIELD, 0.13 * np.sin(x * 2 * np.pi / 1.5)[None, :], 0)
    light += np.where(kind == Ground.LAWN, 0.025 * np.sign(np.sin((x[None, :] + y[:, None]) * 2 * np.pi / 3.2)), 0)
    cracks = np.abs(fractal(kind.shape, [1.6 / pixel_m, 0.5 / pixel_m], rng)) < 0.025
    light -= 0.22 * (cracks & (kind == Ground.ASPHALT))
    return light


def _wither(
    image: Float[np.ndarray, "h w 3"],
    kind: UInt8[np.ndarray, "h w"],
    stains: Float[np.ndarray, "h w"],
    rng: np.random.Generator,
) -> None:
    """Turn dry spots of grass yellow and strew flowers, in place."""
    grass = (kind == Ground.LAWN) | (kind == Ground.MEADOW)
    dry = np.clip((stains - 0.3) * 0.3, 0, 0.5) * grass
    image += dry[..., None] * np.array([0.16, 0.08, 0.03], np.float32)
    flowers = (rng.random(kind.shape, np.float32) < 0.004) & grass
    image[flowers] += np.float32(0.25)
