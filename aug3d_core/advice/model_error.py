"""Where the model errs: its predictions of test photographs beside them, laid on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from PIL import Image
from scipy.ndimage import uniform_filter

from aug3d_core.advice.site import Site
from aug3d_core.dataset.images import fit
from aug3d_core.geometry.masks import used_pixels
from aug3d_core.geometry.transforms import apply, project
from aug3d_core.geometry.views import Views
from aug3d_core.judging.files import mask_of, prediction_of, truth_of
from aug3d_core.photos.files import image_name

_AROUND_PX = 9  # a pixel's error says little of its place, that of some square of them more
_LEAST, _MOST = 0.5, 2.0  # a few test photographs must not outweigh what all photographs say
_STEEPEST = 0.15


def error_at(site: Site, views: Views, evaluations: Sequence[Path]) -> Float[np.ndarray, " s"]:
    """Return how far the model errs at each sample, as a share of its usual error; 1 where no test photograph shows it.

    evaluations: folders of the stage of that name, one for each fold; those without compared pictures say nothing.
    """
    total, count = np.zeros(len(site.samples.xyz)), np.zeros(len(site.samples.xyz))
    for folder in evaluations:
        for view, photo in enumerate(views.photo_id.tolist()):
            predicted, true = folder / prediction_of(image_name(photo)), folder / truth_of(image_name(photo))
            if predicted.is_file() and true.is_file():
                used = used_pixels(folder / mask_of(image_name(photo)))
                _add(site, views, view, _difference(predicted, true, used), total, count)
    seen = count > 0
    if not seen.any():
        return np.ones(len(total))
    mean = np.divide(total, count, out=np.zeros_like(total), where=seen)
    usual = max(float(mean[seen].mean()), 1e-6)
    return np.where(seen, np.clip(mean / usual, _LEAST, _MOST), 1.0)


def _difference(predicted: Path, true: Path, used: Bool[np.ndarray, "h w"] | None) -> Float[np.ndarray, "h w"]:
    """Return the error around each pixel; NaN where the photograph is masked."""
    with Image.open(predicted) as one, Image.open(true) as other:
        off = np.asarray(one.convert("RGB"), float) - np.asarray(other.convert("RGB"), float)
    error = np.abs(off).mean(axis=-1)
    if used is None:
        return np.asarray(uniform_filter(error, _AROUND_PX))
    around, share = (np.asarray(uniform_filter(one, _AROUND_PX)) for one in (error * used, used.astype(float)))
    return np.where(used, around / np.maximum(share, 1e-6), np.nan)


def _add(
    site: Site,
    views: Views,
    view: int,
    off: Float[np.ndarray, "h w"],
    total: Float[np.ndarray, " s"],
    count: Float[np.ndarray, " s"],
) -> None:
    """Add the error of one photograph to the samples that it shows."""
    height, width = off.shape
    source_width, source_height = map(int, views.size[view])
    intrinsics = fit(source_width, source_height, width, height).intrinsics(views.intrinsics[view])
    pose = views.cam_from_world[view]
    sample, _, _ = site.samples.visible(site.surface, pose, intrinsics, np.array([width, height]), _STEEPEST)
    x, y = np.floor(project(apply(pose, site.samples.xyz[sample]), intrinsics)).astype(int).T
    known = np.isfinite(off[y, x])
    sample, x, y = sample[known], x[known], y[known]
    total[sample] += off[y, x]
    count[sample] += 1
