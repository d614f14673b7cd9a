"""Measure the quality of each rendered view, and decide which views are dropped."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

_LUMINANCE = (0.2126, 0.7152, 0.0722)
_BLACK = 3.0  # mean luminance (of 255) below which a view counts as black
_FLAT = 2.0  # contrast below which a view has no features
REASONS = ("too little surface", "black", "flat")


def figures(rgb: UInt8[np.ndarray, "n h w 3"], alpha: UInt8[np.ndarray, "n h w"]) -> dict[str, Float[np.ndarray, " n"]]:
    """Return for each view, over what is covered and in levels of 255:

    covered_share (0 to 1), mean_luminance, contrast (standard deviation of luminance) and sharpness (mean step of luminance
    between neighbouring pixels that are covered whole): smeared texture has less of it than its like.
    """
    cover = alpha / 255.0
    luminance = rgb @ np.array(_LUMINANCE)
    weight = np.maximum(cover.sum(axis=(1, 2)), 1e-6)
    mean = (luminance * cover).sum(axis=(1, 2)) / weight
    spread = ((luminance - mean[:, None, None]) ** 2 * cover).sum(axis=(1, 2)) / weight
    return {
        "covered_share": cover.mean(axis=(1, 2)),
        "mean_luminance": mean,
        "contrast": np.sqrt(spread),
        "sharpness": _mean_step(luminance, alpha == 255),
    }


def reasons(told: dict[str, Float[np.ndarray, " n"]], min_covered_share: float) -> np.ndarray:
    """Return for each view the reason why it is dropped, or an empty text."""
    bad = (told["covered_share"] < min_covered_share, told["mean_luminance"] < _BLACK, told["contrast"] < _FLAT)
    return np.select(bad, REASONS, "")


def _mean_step(luminance: np.ndarray, whole: np.ndarray) -> Float[np.ndarray, " n"]:
    total, pairs = np.zeros(len(luminance)), np.zeros(len(luminance))
    for axis in (1, 2):
        one, next_one = (slice(None, -1), slice(1, None))
        first, second = (tuple(s if a == axis else slice(None) for a in range(3)) for s in (one, next_one))
        both = whole[first] & whole[second]
        total += (np.abs(luminance[second] - luminance[first]) * both).sum(axis=(1, 2))
        pairs += both.sum(axis=(1, 2))
    return total / np.maximum(pairs, 1)
