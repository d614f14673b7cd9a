"""How far reconstructed poses are from the true ones; views are paired by photo_id.

The true ones are those of `true_views`, whose photo_id is that of the reconstruction.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from jaxtyping import Float

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.similarity import Similarity, fit_similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.town.truth.surface_samples import framed, sample_surface

FEWEST = 3  # centres that fix a similarity
_FOOTPRINT_SAMPLES = 20_000  # of the whole true surface: some thousand in each footprint


def extent_m(truth: Views) -> float:
    """Return the flight's extent: the diagonal of the box about its camera centres."""
    return float(np.linalg.norm(np.ptp(centres(truth.cam_from_world), axis=0)))


def true_from_found(found: Views, truth: Views) -> Similarity:
    """Return the similarity that best maps the found camera centres to the true ones."""
    true = _partners(found, truth)
    return fit_similarity(centres(found.cam_from_world), centres(true.cam_from_world))


def pose_errors(found: Views, truth: Views) -> pd.DataFrame:
    """Return each found view's error after that similarity: of its centre in % of extent, of its rotation in degrees."""
    true, align = _partners(found, truth), true_from_found(found, truth)
    off_m = np.linalg.norm(align.apply(centres(found.cam_from_world)) - centres(true.cam_from_world), axis=1)
    found_rotation = found.cam_from_world[:, :, :3] @ align.rotation.T
    return pd.DataFrame(
        {
            "photo_id": found.photo_id,
            "position_error_pct": 100 * off_m / extent_m(truth),
            "rotation_error_deg": np.degrees(_angle_rad(found_rotation, true.cam_from_world[:, :, :3])),
        }
    )


def pair_errors_deg(found: Views, truth: Views) -> Float[np.ndarray, " pairs"]:
    """Return the error of each pair of true views: the greater of the errors of relative rotation and of direction.

    It needs no common frame. A pair with a view that was not found has an infinite error.
    """
    true = _partners(found, truth)
    i, j = np.triu_indices(len(found), 1)
    found_turn, found_way = _relative(found.cam_from_world, i, j)
    true_turn, true_way = _relative(true.cam_from_world, i, j)
    between_ways = 2 * np.arcsin(np.clip(np.linalg.norm(found_way - true_way, axis=1) / 2, 0, 1))
    worse_deg = np.degrees(np.maximum(_angle_rad(found_turn, true_turn), between_ways))
    lost = len(truth) * (len(truth) - 1) // 2 - len(i)
    return np.concatenate([worse_deg, np.full(lost, np.inf)])


def area_under_recall(errors_deg: Float[np.ndarray, " n"], up_to_deg: float) -> float:
    """Return the mean recall over all thresholds from 0 to `up_to_deg`, exactly (Sarlin et al. 2020, "AUC")."""
    return float(np.clip(1 - errors_deg / up_to_deg, 0, 1).mean()) if len(errors_deg) else 0.0


def footprint_ious(found: Views, truth: Views, town: Mesh, rng: np.random.Generator) -> Float[np.ndarray, " n"]:
    """Return for each found view how well its frame covers the right part of the true surface: intersection over union.

    Both frames, the true one and the found one laid over the truth, are counted over the same points, spread evenly over
    the town and hidden or not. Unlike an error in degrees this holds pose and focal length together, as what a photograph
    is taken to show. What undistortion cuts away, or a bending lens shows beyond a pinhole's frame, counts as missing: perfect
    poses reach 0.99, not 1. It is 0 where neither frame shows any of the town.
    """
    true, align = _partners(found, truth), true_from_found(found, truth)
    laid = Views(found.photo_id, align.move_cameras(found.cam_from_world), found.intrinsics, found.size)
    points = sample_surface(town, _FOOTPRINT_SAMPLES, rng)
    ious = np.zeros(len(found))
    for view in range(len(found)):
        a, b = framed(points, true, view), framed(points, laid, view)
        if (a | b).any():
            ious[view] = (a & b).sum() / (a | b).sum()
    return ious


def _partners(found: Views, truth: Views) -> Views:
    return truth.take(np.searchsorted(truth.photo_id, found.photo_id))


def _relative(
    cam_from_world: Float[np.ndarray, "n 3 4"], i: np.ndarray, j: np.ndarray
) -> tuple[Float[np.ndarray, "p 3 3"], Float[np.ndarray, "p 3"]]:
    """Return the rotation from camera i to j, and the unit direction from i to j in the frame of i."""
    rotation, at = cam_from_world[:, :, :3], centres(cam_from_world)
    way = (rotation[i] @ (at[j] - at[i])[..., None])[..., 0]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return rotation[j] @ np.swapaxes(rotation[i], 1, 2), way / np.maximum(length, 1e-12)


def _angle_rad(a: Float[np.ndarray, "n 3 3"], b: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, " n"]:
    """Return the angle between rotations, from the chord, which is exact for small angles where arccos is not."""
    chord = np.linalg.norm(a - b, axis=(1, 2)) / np.sqrt(8.0)
    return 2 * np.arcsin(np.clip(chord, 0, 1))
