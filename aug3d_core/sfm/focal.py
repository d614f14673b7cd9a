"""Keep the camera's own focal length where the photographs cannot tell better.

Over flat ground seen from straight above, a longer focal length and a higher flight make the same pictures, and bundle
adjustment drifts along that valley: on `brighton_beach` by 18 %, and the flight with it from 39 m to 45 m (its own
log says 39.8 m) for 1 % of reprojection error. So the focal length from EXIF is kept unless freeing it pays.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd
import pycolmap

from aug3d_core.sfm.mapping import THREADS
from aug3d_core.store import layout

_WORTH = 1.03  # reprojection error with the focal length kept, over that with it freed


@dataclass(frozen=True)
class Settled:
    """What was chosen. source: exif or refined. exif_over_refined: ratio of their errors, None without EXIF."""

    model: pycolmap.Reconstruction
    source: str
    exif_over_refined: float | None


def settle_focal(model: pycolmap.Reconstruction, photos: pd.DataFrame) -> Settled:
    """Take the focal lengths of EXIF if every camera has one and the model fits nearly as well with them."""
    priors = _priors(model, photos)
    if len(priors) < model.num_cameras():
        return Settled(model, "refined", None)
    kept = pycolmap.Reconstruction(model)
    for camera_id, focal_px in priors.items():
        camera = kept.camera(camera_id)
        camera.focal_length = focal_px
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = False
    options.print_summary = False
    options.ceres.solver_options.num_threads = THREADS
    pycolmap.bundle_adjustment(kept, options)
    kept.update_point_3d_errors()
    ratio = kept.compute_mean_reprojection_error() / model.compute_mean_reprojection_error()
    return Settled(kept, "exif", ratio) if ratio <= _WORTH else Settled(model, "refined", ratio)


def _priors(model: pycolmap.Reconstruction, photos: pd.DataFrame) -> dict[int, float]:
    """Median EXIF focal length of each of the model's cameras that has one."""
    rows = photos.set_index(photos["photo_id"].map(layout.image_name))
    camera_of = {image.name: image.camera_id for image in model.images.values()}
    known = rows.loc[list(camera_of)].assign(camera_id=list(camera_of.values())).dropna(subset="focal_px")
    return known.groupby("camera_id")["focal_px"].median().to_dict()
