"""Photographs that show what the one before them shows: frames of a video, and those of a drone that hovers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from aug3d_core.photos.decode import Decoded
from aug3d_core.photos.files import REDUNDANT

_LONGEST_PX = 256  # a pixel is 0.4 % of the width: enough for motions that matter, and a millisecond a pair
_CORNERS, _LEAST_TRACKED = 200, 0.5
_BACK_PX = 1.0  # a corner is tracked if following it there and back ends where it began
_WINDOW = {"winSize": (21, 21), "maxLevel": 3}


def drop_redundant(photos: Sequence[Decoded], least_motion: float) -> tuple[list[Decoded], list[tuple[str, str]]]:
    """Keep the first of photographs in capture order between which the picture moves too little; delete the other copies.

    least_motion: share of the picture's width; each photograph is compared with the last that was kept, so that slow flights
    add up. Returns those kept, and (name, reason) of the others.
    """
    kept: list[Decoded] = []
    dropped: list[tuple[str, str]] = []
    last: UInt8[np.ndarray, "h w"] | None = None
    for photo in photos:
        grey = _small(photo)
        moved = math.inf if last is None else image_motion(last, grey)
        if moved < least_motion:
            dropped.append(
                (photo.name, f"{REDUNDANT}: shows what {kept[-1].name} shows, {moved:.1%} of its width aside")
            )
            photo.copy.unlink()
        else:
            kept.append(photo)
            last = grey
    return kept, dropped


def image_motion(first: UInt8[np.ndarray, "h w"], second: UInt8[np.ndarray, "h2 w2"]) -> float:
    """Return the median length by which corners move from one picture to another, as a share of the width.

    Corners are followed there and back (pyramidal Lucas-Kanade: Bouguet 2000). Infinite where most cannot be followed: then
    the pictures show different things or nothing that could be told apart, and between pictures of different size.
    """
    if first.shape != second.shape:
        return math.inf
    first, second = cv2.equalizeHist(first), cv2.equalizeHist(second)  # exposures may differ
    corners = cv2.goodFeaturesToTrack(first, _CORNERS, qualityLevel=0.01, minDistance=5)
    if corners is None:
        return math.inf
    there, found, _ = cv2.calcOpticalFlowPyrLK(first, second, corners, corners.copy(), **_WINDOW)
    back, found_back, _ = cv2.calcOpticalFlowPyrLK(second, first, there, there.copy(), **_WINDOW)
    both_ways = np.logical_and(found, found_back).ravel()
    tracked = both_ways & (_lengths(back - corners) < _BACK_PX)
    if tracked.mean() < _LEAST_TRACKED:
        return math.inf
    return float(np.median(_lengths(there - corners)[tracked])) / first.shape[1]


def _lengths(vectors: Float[np.ndarray, "n 1 2"]) -> Float[np.ndarray, " n"]:
    return np.linalg.norm(vectors.reshape(-1, 2), axis=1)


def _small(photo: Decoded) -> UInt8[np.ndarray, "h w"]:
    with Image.open(photo.copy) as image:
        image.thumbnail((_LONGEST_PX, _LONGEST_PX), Image.Resampling.BOX)
        return np.asarray(image.convert("L"))
