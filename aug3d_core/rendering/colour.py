"""Linear light (0..1) and 8-bit sRGB, IEC 61966-2-1."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8


def linear_from_srgb(srgb: UInt8[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Decode 8-bit sRGB to linear light."""
    levels = np.arange(256) / 255.0
    table = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    return table.astype(np.float32)[srgb]


def srgb_from_linear(linear: Float[np.ndarray, "*n"]) -> UInt8[np.ndarray, "*n"]:
    """Encode linear light as 8-bit sRGB; what is outside 0..1 is clipped (the `Standard` view transform)."""
    light = np.clip(linear, 0.0, 1.0)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)
