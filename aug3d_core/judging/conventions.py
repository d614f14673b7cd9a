"""How answers are scored, stated once. Two results are compared only if this and the photographs were the same.

Everything that could shift a PSNR without the model being better or worse stands here; its digest goes with every result.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

from aug3d_core.dataset.scene import Scene
from aug3d_core.judging.inputs import RULE

BEST_DB = 100.0  # PSNR of an exact answer, which has no PSNR
PEAK = 255
# skimage's structural_similarity, every setting that it would otherwise choose itself
SSIM: dict[str, Any] = {
    "win_size": 7,
    "gaussian_weights": False,
    "use_sample_covariance": True,
    "K1": 0.01,
    "K2": 0.03,
    "data_range": PEAK,
}
FLIP = {"ppd": 67.0}  # pixels per degree of the eye: a screen 0.7 m away
MASKED = (
    "left out of every mean over pixels; where a window or a filter reaches it, the nearest used pixel stands there"
)
_DIGITS = 12


def conventions(scene: Scene) -> dict[str, Any]:
    """Return the conventions by which answers are scored on a packed scene."""
    return {
        "photographs": scene.attributes.get("conventions", {}).get("images", "not stated by the data set"),
        "size_px": [scene.width_px, scene.height_px],
        "inputs": RULE,
        "answers": "rounded to 8 bit and held within 0 to 255 before they are scored",
        "psnr": f"over all pixels and channels of a view; peak {PEAK}; {BEST_DB:g} dB for an exact answer",
        "ssim": SSIM | {"over": "mean over pixels and channels"},
        "flip": FLIP | {"over": "mean over pixels", "range": "low dynamic range"},
        "mean": "over test views, each counting alike; best, low and average over test groups",
        **({"masked": MASKED} if targets_masked(scene) else {}),
    }


def targets_masked(scene: Scene) -> bool:
    """Say whether a part of any test photograph is masked."""
    return any(scene.used(int(view)) is not None for view in np.unique(scene.groups["test"][:, 0]))


def digest(stated: dict[str, Any]) -> str:
    """Digest of the conventions."""
    return hashlib.sha256(json.dumps(stated, sort_keys=True).encode()).hexdigest()[:_DIGITS]


def held_out_digest(scene: Scene) -> str:
    """Digest of the pixels of the test photographs, and of which are used, whatever their order."""
    photos = np.unique(scene.groups["test"][:, 0])
    each = sorted(hashlib.sha256(_counted(scene, int(view))).hexdigest() for view in photos)
    return hashlib.sha256("".join(each).encode()).hexdigest()[:_DIGITS]


def _counted(scene: Scene, view: int) -> bytes:
    used, image = scene.used(view), scene.images[view]
    return image.tobytes() if used is None else image[used].tobytes() + used.tobytes()
