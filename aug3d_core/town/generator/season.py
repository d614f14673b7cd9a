"""The colours of a season, painted over a town's finished textures."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from aug3d_core.town.config import Season

_GREY = np.array([0.30, 0.59, 0.11], np.float32)
# What leaves and grass become, and how much of their own colour they keep
_GROWN: dict[Season, tuple[tuple[float, float, float], float]] = {
    "dry": ((1.22, 1.02, 0.62), 0.35),
    "autumn": ((1.45, 0.86, 0.42), 0.25),
    "winter": ((1.02, 0.97, 0.90), 0.15),
}
_SNOW = np.array([0.90, 0.92, 0.95], np.float32)
_SNOWED = 0.75  # of the ground's colour that snow covers


def in_season(image: UInt8[np.ndarray, "h w 3"], season: Season, ground: bool = False) -> UInt8[np.ndarray, "h w 3"]:
    """Return a texture in the colours of a season: what is green changes, and in winter the ground is snowed over.

    Brightness is kept, and with it the grain that photographs are matched by. Streets are cleared: what is grey stays.
    """
    if season == "summer":
        return image
    rgb = image.astype(np.float32) / 255
    light = (rgb @ _GREY)[..., None]
    tint, kept = _GROWN[season]
    grown = _green(rgb)
    changed = kept * rgb + (1 - kept) * light * np.array(tint, np.float32)
    rgb = rgb + grown[..., None] * (changed - rgb)
    if season == "winter" and ground:
        snowed = _SNOWED * np.maximum(grown, _earthy(rgb))[..., None]
        rgb = rgb + snowed * (_SNOW * (0.7 + 0.6 * light) - rgb)
    return np.rint(np.clip(rgb, 0, 1) * 255).astype(np.uint8)


def _green(rgb: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w"]:
    """Return how much of a plant each texel is: greener than red and than blue."""
    return np.clip((rgb[..., 1] - np.maximum(rgb[..., 0], rgb[..., 2])) * 30, 0, 1)


def _earthy(rgb: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w"]:
    """Return how brown each texel is: fields and soil, not paving."""
    return np.clip((rgb[..., 0] - rgb[..., 2] - 0.08) * 15, 0, 1)
