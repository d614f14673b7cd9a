"""Bundle adjustment with GPS: it takes the bend out of a flight, where GPS surely tells one.

Over flat ground seen from straight above, a lens that is a little wrong makes a bowl of a flight, which photographs alone
hardly tell (James & Robson 2014). A flight of 168 photographs of the built-in town through a lens with k1 = -0.08 and k2 = 0.02
was bent by 1.2 % of its extent, and its cameras leant by 1.6 degrees; with GPS of a metre or two, drifting or not, by 0.2 % and
0.3 degrees, at the same error in the photographs.

Where GPS tells no bend it is left out: its drift would bend what the photographs hold well.
"""

from __future__ import annotations

import numpy as np
import pycolmap
from jaxtyping import Float

from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.sfm import export
from aug3d_core.sfm.camera_model import SIMPLEST, adjustment_options, without_wrong_points
from aug3d_core.sfm.doming import Doming, alike, fit_altitudes

_SURE = 3.0  # times its error that a bend must be
_ROBUST = 2.0  # deviations beyond which a position weighs less, by Cauchy's loss: some are wrong altogether
_LEAST_M = 0.01  # to believe of any GPS


def adjust_to_gps(
    model: pycolmap.Reconstruction, gps_enu_m: Float[np.ndarray, "n 3"], world: Similarity, refine_focal_length: bool
) -> Doming | None:
    """Adjust a model in place to GPS as well, if that surely tells a bend; return the bend, None where nothing was done.

    gps_enu_m: of the placed photographs in the order of capture, NaN where there is none. world: in which their altitudes and
    the model's heights compare.
    """
    at = world.apply(centres(export.poses(model)))
    fit = fit_altitudes(at, gps_enu_m)
    if fit is None or abs(fit.doming.pct) <= _SURE * fit.doming.sigma_pct:
        return None
    for camera in model.cameras.values():
        if camera.model_name == SIMPLEST:  # what a second radial term hides as a bend, GPS now tells
            camera.model, camera.params = pycolmap.CameraModelId.RADIAL, [*camera.params, 0.0]
    where_m = gps_enu_m + np.column_stack([np.zeros((len(at), 2)), fit.drift_m])
    noise_m = np.maximum([*_noise_m(at - gps_enu_m), fit.noise_m], _LEAST_M)
    _adjust(model, where_m, noise_m, refine_focal_length)
    without_wrong_points(model)
    return fit.doming


def _noise_m(off_m: Float[np.ndarray, "n 3"]) -> list[float]:
    """Return the standard deviation of horizontal positions on each axis as if they were independent of each other."""
    found = []
    for off in off_m[np.isfinite(off_m).all(axis=1), :2].T:
        noise = 1.4826 * float(np.median(np.abs(off)))
        found.append(noise * alike(np.clip(off, -3 * noise, 3 * noise)) ** 0.5)
    return found


def _adjust(
    model: pycolmap.Reconstruction,
    where_m: Float[np.ndarray, "n 3"],
    noise_m: Float[np.ndarray, " 3"],
    refine_focal_length: bool,
) -> None:
    """Adjust all poses, points and cameras in place to photographs and positions; the model is then where these are."""
    config, priors = pycolmap.BundleAdjustmentConfig(), []
    for image, place in zip(export.registered(model), where_m, strict=True):
        config.add_image(image.image_id)
        if np.isfinite(place).all():
            prior = pycolmap.PosePrior()
            prior.corr_data_id, prior.coordinate_system = image.data_id, pycolmap.PosePriorCoordinateSystem.CARTESIAN
            prior.position, prior.position_covariance = place, np.diag(noise_m**2)
            priors.append(prior)
    options = pycolmap.PosePriorBundleAdjustmentOptions()
    options.alignment_ransac.max_error = 3 * float(np.linalg.norm(noise_m))
    options.alignment_ransac.random_seed = 0
    options.ceres.prior_position_loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.prior_position_loss_scale = _ROBUST
    freed = adjustment_options(refine_focal_length)
    pycolmap.create_pose_prior_bundle_adjuster(freed, options, config, priors, model).solve()
