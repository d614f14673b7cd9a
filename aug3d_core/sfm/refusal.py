"""Refuse photographs that cannot become a scene, and say why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.run.errors import InputError
from aug3d_core.sfm.mapping import SMALLEST_MODEL

# A homography between photographs from one spot is a rotation, whose singular values are equal. Of the town's matched pairs
# 9 in 10 have a ratio above 1.2, and none is under 1.09.
_ROTATION = 1.05
_MOST_ROTATIONS = 0.75
_FOCAL_FACTORS = np.append(1.0, np.geomspace(0.4, 2.5, 41))
_FEW_FEATURES = 100
_LEAST_BASELINE = 0.05  # spread of the cameras over their distance to the points: 3 degrees between lines of sight


def refuse_one_spot(database: Path) -> bool:
    """Raise InputError if nearly all matched pairs are mere rotations of the camera, with its focal length as entered.

    Return whether they would be with another focal length: a camera of unknown focal length that turns can look like one
    that flies.
    """
    shares = _rotation_shares(database, _FOCAL_FACTORS)
    if shares[0] > _MOST_ROTATIONS:
        raise _one_spot(f"in {100 * shares[0]:.0f} % of the matched pairs the camera only turned")
    return bool(shares.max() > _MOST_ROTATIONS)


def refuse_short_baseline(centres: np.ndarray, median_depth: float) -> None:
    """Raise InputError if the cameras, (n, 3), stand too close together for what they see to have depth."""
    spread = float(np.sqrt(centres.var(axis=0).sum()))
    if spread < _LEAST_BASELINE * median_depth:
        raise _one_spot(f"the cameras spread over {100 * spread / median_depth:.1f} % of their distance to the scene")


def nothing_found(matching: pd.DataFrame) -> InputError:
    """Return the error for photographs of which no three hold together, by the matching stage's table."""
    photos = len(matching)
    head = f"no scene could be reconstructed: no {SMALLEST_MODEL} of the {photos} photographs hold together"
    if matching["features"].median() < _FEW_FEATURES:
        return InputError(
            f"{head}, for there is no texture: half of them have fewer than {_FEW_FEATURES} features",
            "Use sharp photographs that show detail: from lower, in better light, or of other ground.",
        )
    alone = int((matching["matched_pairs"] < 2).sum())
    if alone > photos / 2:
        return InputError(
            f"{head}: {alone} of them overlap with fewer than two others",
            "Use photographs of one scene in which neighbours overlap by 60 % or more, sharp and with texture.",
        )
    return InputError(
        f"{head}, though most overlap: what they share does not fit together as one rigid scene seen from several places",
        "Use photographs taken from places apart, of a scene that does not move, in which neighbours overlap by 60 % or more.",
    )


def _one_spot(evidence: str) -> InputError:
    return InputError(
        f"the photographs are taken from one spot, which shows no depth: {evidence}",
        "Use photographs between which the camera moved by a tenth of its distance to the scene or more.",
    )


def _rotation_shares(database: Path, focal_factors: np.ndarray) -> np.ndarray:
    """Return the share of matched pairs whose homography is a rotation, for each factor on the focal lengths."""
    with pycolmap.Database.open(database) as opened:
        camera_of = {image.image_id: image.camera_id for image in opened.read_all_images()}
        calibration = {camera.camera_id: camera.calibration_matrix() for camera in opened.read_all_cameras()}
        pair_ids, geometries = opened.read_two_view_geometries()
    known = [
        (geometry.H, *(calibration[camera_of[i]] for i in pycolmap.pair_id_to_image_pair(pair_id)))
        for pair_id, geometry in zip(pair_ids, geometries, strict=True)
        if geometry.H is not None and len(geometry.inlier_matches)
    ]
    if not known:
        return np.zeros(len(focal_factors))
    homography, one, two = (np.array(each) for each in zip(*known, strict=True))
    shares = []
    for factor in focal_factors:
        scaled = np.diag([factor, factor, 1.0])
        singular = np.linalg.svd(np.linalg.solve(two @ scaled, homography @ one @ scaled), compute_uv=False)
        shares.append(np.mean(singular[:, 0] < _ROTATION * singular[:, -1]))
    return np.array(shares)
