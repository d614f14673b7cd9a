"""Do the poses explain the matches? Things that look alike are matched as if they were one, and pull poses astray."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Bool, Float

_MOST_PX = 4.0  # from the epipolar line (Sampson), as matches were verified


def explained_share(model: pycolmap.Reconstruction, database: Path) -> float | None:
    """Return the share of verified matches between placed photographs that their poses allow; None where there are none.

    A match that two photographs agree on, and all photographs together do not, joins two things that look alike: houses of
    one kind, solar panels, rows of crops.
    """
    placed = {model.image(image_id).name: model.image(image_id) for image_id in model.reg_image_ids()}
    with pycolmap.Database.open(database) as opened:
        known = {image.image_id: placed[image.name] for image in opened.read_all_images() if image.name in placed}
        pixels = {i: opened.read_keypoints(i)[:, :2].astype(float) for i in known}
        pair_ids, geometries = opened.read_two_view_geometries()
    allowed = []
    for pair_id, geometry in zip(pair_ids, geometries, strict=True):
        pair, matches = pycolmap.pair_id_to_image_pair(pair_id), geometry.inlier_matches
        if len(matches) and known.keys() >= set(pair):
            one, two = (known[i] for i in pair)
            at_one, at_two = (pixels[i][rows] for i, rows in zip(pair, matches.T, strict=True))
            allowed.append(_allowed(model, one, two, at_one, at_two))
    return float(np.concatenate(allowed).mean()) if allowed else None


def _allowed(
    model: pycolmap.Reconstruction,
    one: pycolmap.Image,
    two: pycolmap.Image,
    at_one: Float[np.ndarray, "m 2"],
    at_two: Float[np.ndarray, "m 2"],
) -> Bool[np.ndarray, " m"]:
    essential = pycolmap.essential_matrix_from_pose(two.cam_from_world() * one.cam_from_world().inverse())
    cameras = [model.cameras[image.camera_id] for image in (one, two)]
    rays = [camera.cam_from_img(pixels) for camera, pixels in zip(cameras, (at_one, at_two), strict=True)]
    most = _MOST_PX / np.mean([camera.mean_focal_length() for camera in cameras])
    return np.asarray(pycolmap.compute_squared_sampson_error(rays[0], rays[1], essential)) < most**2
