"""Exposure differences between photographs, from what they show of the same places of the surface.

Every photo i gets a gain g_i per channel so that g_i c_pi agrees over the photos that see a place p. As Brown and Lowe
("Automatic Panoramic Image Stitching using Invariant Features", IJCV 2007, section 6) do, but on logarithms, where the
problem is linear: minimise sum_pi w_pi (log c_pi + log g_i - m_p)^2 + k sum_i (log g_i)^2, with the place's colour m_p
eliminated and Cauchy weights against highlights, moving things and wrong occlusion. Gains multiply 8-bit sRGB values: an
exposure step multiplies light, and nearly so the encoded values.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.sparse.linalg import spsolve

from aug3d_core.geometry.robust import spread

ROUNDS = 15
PULL = 1e-4  # of a photo's mean weight: enough to settle what no overlap does, too little to bias what one does
DARK, BRIGHT = 12.0, 243.0  # sRGB levels beyond which noise and clipping hide the exposure


def exposure_gains(
    point: Int[np.ndarray, " s"], photo: Int[np.ndarray, " s"], rgb: Float[np.ndarray, "s 3"], photos: int
) -> Float[np.ndarray, "n 3"]:
    """Return the factor for each photo's sRGB values, per channel, that leaves the mean of all samples as it is.

    Sample s is the colour (0 to 255) that `photo[s]` shows of place `point[s]`. A photo without usable samples gets 1.
    """
    return np.stack([_channel_gains(point, photo, rgb[:, channel], photos) for channel in range(3)], axis=1)


def _channel_gains(point: np.ndarray, photo: np.ndarray, level: np.ndarray, photos: int) -> np.ndarray:
    usable: Bool[np.ndarray, " s"] = (level > DARK) & (level < BRIGHT)
    point, photo, value = point[usable], photo[usable], np.log(level[usable])
    if not len(point):
        return np.ones(photos)
    point = np.unique(point, return_inverse=True)[1]
    log_gain, weight = np.zeros(photos), np.ones(len(point))
    for _ in range(ROUNDS):
        log_gain = _solve(point, photo, value, weight, photos)
        evened = value + log_gain[photo]
        residual = evened - (np.bincount(point, weight * evened) / np.bincount(point, weight))[point]
        scale = max(spread(residual), 1e-3)
        weight = 1 / (1 + (residual / scale) ** 2)
    gain = np.exp(log_gain)
    # The mean of levels, not of logarithms: that would make a scene as dark as its many dark photos
    gain *= level[usable].mean() / (level[usable] * gain[photo]).mean()
    return np.where(np.bincount(photo, minlength=photos) > 0, gain, 1.0)


def _solve(point: np.ndarray, photo: np.ndarray, value: np.ndarray, weight: np.ndarray, photos: int) -> np.ndarray:
    """Solve the normal equations of one round for the photos' log gains: sparse, for a photo overlaps with few others."""
    shape = (int(point.max()) + 1, photos)
    per_place = sparse.csr_matrix((weight, (point, photo)), shape)
    total = np.bincount(point, weight)
    per_photo = np.bincount(photo, weight, photos)
    pull = PULL * per_photo.mean()
    normal = sparse.diags(per_photo + pull) - per_place.T @ sparse.diags(1 / total) @ per_place
    mean = (np.bincount(point, weight * value) / total)[point]
    right = np.bincount(photo, weight * (mean - value), photos)
    return np.asarray(spsolve(normal.tocsc(), right, permc_spec="MMD_AT_PLUS_A"))
