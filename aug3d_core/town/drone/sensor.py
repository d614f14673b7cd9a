"""What else happens to the picture between lens and file: sky, ripples on water, blur, and steps of exposure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.ndimage import gaussian_filter

from aug3d_core.rendering.colour import linear_from_srgb, srgb_from_linear
from aug3d_core.town.config import TownConfig
from aug3d_core.town.generator.noise import fractal

_SKY = np.array([196.0, 214.0, 236.0])
_RIPPLE, _GLINT = 0.16, 0.30  # strength of ripples; how much brighter the brightest of them are


@dataclass(frozen=True)
class Defects:
    """Per photograph: deviation of its blur (px; 0 for none), and the factor of its exposure."""

    blur_px: Float[np.ndarray, " n"]
    exposure: Float[np.ndarray, " n"]

    @classmethod
    def of(cls, config: TownConfig, count: int, rng: np.random.Generator) -> Defects:
        """Choose which photographs are blurred (drawn) and which are exposed otherwise (the last)."""
        blurred = rng.permutation(count) < round(config.blur_share * count)
        last = np.arange(count) >= count - round(config.exposure_share * count)
        return cls(np.where(blurred, config.blur_px, 0.0), np.where(last, config.exposure_factor, 1.0))


def over_sky(rgb: UInt8[np.ndarray, "h w 3"], alpha: UInt8[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """Put sky behind a render that looks past the world's edge."""
    if alpha.min() == 255:
        return rgb
    share = alpha[..., None] / 255
    return np.rint(rgb * share + _SKY * (1 - share)).astype(np.uint8)


def ripple(
    rgb: UInt8[np.ndarray, "h w 3"], lake: Bool[np.ndarray, "h w"], rng: np.random.Generator
) -> UInt8[np.ndarray, "h w 3"]:
    """Let water move: every photograph has ripples of its own. `lake` says where a lake would be with nothing before it.

    Open water is what has the colour that most of it has: it was painted in one.
    """
    if not lake.any():
        return rgb
    off = np.abs(rgb - np.median(rgb[lake], axis=0)).max(axis=-1)
    waves = fractal(lake.shape, [2, 5, 14], rng)
    light = 1 + _RIPPLE * waves + _GLINT * np.clip(waves - 1.6, 0, 2)
    moved = np.where((lake & (off < 12))[..., None], rgb * light[..., None], rgb)
    return np.rint(np.clip(moved, 0, 255)).astype(np.uint8)


def blur(rgb: UInt8[np.ndarray, "h w 3"], deviation_px: float) -> UInt8[np.ndarray, "h w 3"]:
    """Blur with a Gaussian."""
    if deviation_px == 0:
        return rgb
    smooth = gaussian_filter(rgb.astype(np.float32), (deviation_px, deviation_px, 0), mode="nearest")
    return np.rint(smooth).astype(np.uint8)


def expose(rgb: UInt8[np.ndarray, "h w 3"], factor: float) -> UInt8[np.ndarray, "h w 3"]:
    """Multiply the light that fell on the sensor; what is too bright is clipped."""
    return rgb if factor == 1 else srgb_from_linear(factor * linear_from_srgb(rgb))
