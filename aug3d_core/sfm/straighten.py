"""Take the bend out of a flight, where GPS or the gimbal surely tells one.

Over flat ground seen from straight above, a lens that is a little wrong makes a bowl of a flight, which photographs alone
hardly tell (James & Robson 2014). A flight of 168 photographs of the built-in town through a lens with k1 = -0.08 and k2 = 0.02
was bent by 1.2 % of its extent, and its cameras leant by 1.6 degrees; straightened it is bent by less than 0.1 %, at the same
error in the photographs.

Where neither tells a bend nothing is done: what they are off by would bend what the photographs hold well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap
from jaxtyping import Float

from aug3d_core.geometry.robust import spread
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.sfm import export
from aug3d_core.sfm.camera_model import SIMPLEST, adjustment_options, take_over, without_wrong_points
from aug3d_core.sfm.doming import AltitudeFit, Doming, alike, fit_altitudes
from aug3d_core.sfm.gimbal import doming_by_gimbal

_WORTH_PCT = 0.03  # a lesser bend is no more than what poses are off by anyhow, and gimbals are not made to tell it
_ROBUST = 2.0  # deviations beyond which a position weighs less, by Cauchy's loss: some are wrong altogether
_LEAST_M = 0.01  # to believe of any GPS
_OF_BOWL = 0.1  # of its height: how exactly the poses' own heights are meant, once it is taken out of them
_AS_WELL = 1.02  # times the error in the photographs that it may cost
_LEFT = 0.5  # of the bend, that must not be left


@dataclass(frozen=True)
class _Places:
    """Where cameras are meant to be, in the world, and how exactly on each axis; NaN for those that nothing tells."""

    at: Float[np.ndarray, "n 3"]
    noise: Float[np.ndarray, " 3"]


def straighten(
    model: pycolmap.Reconstruction, gps_enu_m: Float[np.ndarray, "n 3"], world: Similarity, refine_focal_length: bool
) -> Doming | None:
    """Take the bend out of a model in place, if one is sure; return it, None where nothing was done.

    gps_enu_m: of the placed photographs in the order of capture, NaN where there is none. world: that of GPS, or a level one
    without; a straightened model is then in it.
    """
    poses = world.move_cameras(export.poses(model))
    bend = sure_bend(poses, gps_enu_m)
    if bend is None:
        return None
    at = centres(poses)
    fit = fit_altitudes(at, gps_enu_m)
    places = _by_gps(at, gps_enu_m, fit) if fit and bend == fit.doming else _unbent(at, bend)
    straight = pycolmap.Reconstruction(model)
    for camera in straight.cameras.values():
        if camera.model_name == SIMPLEST:  # what a second radial term would hide as a bend
            camera.model, camera.params = pycolmap.CameraModelId.RADIAL, [*camera.params, 0.0]
    straight.transform(pycolmap.Sim3d(world.scale, pycolmap.Rotation3d(world.rotation), world.translation))
    _adjust(straight, places, refine_focal_length)
    if not _believable(straight, model, gps_enu_m, bend):
        return None
    take_over(model, straight)
    without_wrong_points(model)
    return bend


def sure_bend(poses: Float[np.ndarray, "n 3 4"], gps_enu_m: Float[np.ndarray, "n 3"]) -> Doming | None:
    """Return the bend of poses in the world that is sure, and worth taking out; None where nothing tells one."""
    told = _told(fit_altitudes(centres(poses), gps_enu_m), poses)
    if len(told) == 2 and told[0].contradicts(told[1]):
        return None
    worth = [one for one in told if one.sure and abs(one.pct) > _WORTH_PCT]
    return min(worth, key=lambda one: one.sigma_pct, default=None)


def _believable(
    straight: pycolmap.Reconstruction, bent: pycolmap.Reconstruction, gps_enu_m: Float[np.ndarray, "n 3"], bend: Doming
) -> bool:
    """Tell whether most of the bend is gone, and the photographs fit as well: where they tell, they know better."""
    for one in (bent, straight):
        one.update_point_3d_errors()
    if straight.compute_mean_reprojection_error() > _AS_WELL * bent.compute_mean_reprojection_error():
        return False
    poses = export.poses(straight)
    fit = fit_altitudes(centres(poses), gps_enu_m)
    left = [one for one in _told(fit, poses) if one.told_by == bend.told_by]
    return all(abs(one.pct) < _LEFT * abs(bend.pct) for one in left)


def _told(fit: AltitudeFit | None, poses: Float[np.ndarray, "n 3 4"]) -> list[Doming]:
    """Return the bend by each that tells one."""
    return [one for one in (fit and fit.doming, doming_by_gimbal(poses)) if one]


def _by_gps(at: Float[np.ndarray, "n 3"], gps_enu_m: Float[np.ndarray, "n 3"], fit: AltitudeFit) -> _Places:
    """Return the positions of GPS without the drift of their altitudes; noise as if each were independent of the others."""
    there_m, off_m = gps_enu_m.copy(), at - gps_enu_m
    there_m[:, 2] += fit.drift_m
    noise_m = []
    for off in off_m[np.isfinite(off_m).all(axis=1), :2].T:
        noise = spread(off)
        noise_m.append(noise * alike(np.clip(off, -3 * noise, 3 * noise)) ** 0.5)
    return _Places(there_m, np.maximum([*noise_m, fit.noise_m], _LEAST_M))


def _unbent(at: Float[np.ndarray, "n 3"], bend: Doming) -> _Places:
    """Return the poses' own places with the bowl taken out of their heights, which alone are meant exactly."""
    place = at[:, :2] - at[:, :2].mean(axis=0)
    extent = float(np.linalg.norm(np.ptp(place, axis=0)))
    height = bend.pct / 100 * extent
    bowl = height * (place**2).sum(axis=1) / (extent / 2) ** 2
    return _Places(at - np.outer(bowl, [0, 0, 1]), np.array([extent, extent, _OF_BOWL * abs(height)]))


def _adjust(model: pycolmap.Reconstruction, places: _Places, refine_focal_length: bool) -> None:
    """Adjust all poses, points and cameras in place to photographs and places; the model is then where these are."""
    config, priors = pycolmap.BundleAdjustmentConfig(), []
    for image, place in zip(export.registered(model), places.at, strict=True):
        config.add_image(image.image_id)
        if np.isfinite(place).all():
            prior = pycolmap.PosePrior()
            prior.corr_data_id, prior.coordinate_system = image.data_id, pycolmap.PosePriorCoordinateSystem.CARTESIAN
            prior.position, prior.position_covariance = place, np.diag(places.noise**2)
            priors.append(prior)
    options = pycolmap.PosePriorBundleAdjustmentOptions()
    options.alignment_ransac.max_error = 3 * float(np.linalg.norm(places.noise))
    options.alignment_ransac.random_seed = 0
    options.ceres.prior_position_loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.prior_position_loss_scale = _ROBUST
    freed = adjustment_options(refine_focal_length)
    pycolmap.create_pose_prior_bundle_adjuster(freed, options, config, priors, model).solve()
