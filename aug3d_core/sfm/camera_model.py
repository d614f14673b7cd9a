"""Choose the smallest camera model that predicts the photographs, and keep EXIF's focal length unless freeing it pays.

Each candidate is adjusted to nine tenths of the observations of some thousand points and judged by the rest, which it has
not seen, by their median: a mean is that of the wrong matches among them, and rose and fell by 8 % for nothing. A few
percent less error is no reason for more parameters: on `brighton_beach` a second radial term gains 12 to 15 % and
bends the flight by 1.3 % of its extent (0.15 % without), for it takes up what else moves the rim. A lens that needs the term
gains far more: with k2 = 0.12 the smaller model's error is 1.5 times that of the larger.

Wrong matches that geometry let through weigh little (Cauchy's loss). They are a hundredth or so, and a lens that is free to
bend follows them: least squares gave k1 = -0.04 where the lens has none, and a flight bent to fit.

Over flat ground seen from straight above, a longer focal length and a higher flight make the same pictures, and bundle
adjustment drifts along that valley: on `brighton_beach` by 21 %, and the flight with it from 40 m to 48 m (its own log says
39.8 m) for 4 % of error. So the focal length from EXIF is kept unless freeing it pays in proportion. Where photographs tell
it, 1, 2 and 5 % of wrong focal length cost 3 to 7, 11 and 8 to 18 % of error, ten times as much as there; they turn the
built-in town's photographs by 0.7, 1.4 and 3.3 degrees if nothing is done.

A camera without a focal length in EXIF gets the one that fits the photographs of those that have one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pycolmap

from aug3d_core.photos.files import image_name
from aug3d_core.sfm.mapping import THREADS

SIMPLEST = "SIMPLE_RADIAL"
EXIF, REFINED = "exif", "refined"

_MODELS = (SIMPLEST, "RADIAL", "OPENCV")  # each holds the one before
_WORTH_LENS = 1.25  # held-out error of a smaller camera model over that of a larger one
# What freeing the focal length must gain of that error: a share, and a share of what the focal length moves, relatively
_WORTH_FOCAL, _WORTH_MOVING = 0.02, 0.5
_TRIAL_POINTS = 4000
_SHORTEST_TRACK = 3  # one held out leaves two
_HELD_OUT = 10
# Of Cauchy's loss. Without it a hundredth of wrong matches bent a flight of ten photographs by 3 degrees (0.08 with it), and
# the town's poses were off by 0.017 degrees (0.008); 0.25 to 1 px do alike. A flight that hinged on few points needed 1e-5;
# 1e-6 takes 1 to 2 % off the error of small scenes, and 2,000 photographs then bend twice as far.
_SURE_PX, _SETTLED = 0.5, 1e-5
# Photographs that are solved for exactly, thus all: each shares points with few others. COLMAP iterates from 1,000 on
_SOLVED_EXACTLY = 1_000_000
_MOST_PX, _LEAST_ANGLE_DEG = 4.0, 1.5  # what mapping keeps
_LOST_PX = 20.0  # what a point counts that is projected farther off, or from behind the camera

Observation = tuple[int, int, int]  # point id, image id, index of the keypoint


@dataclass(frozen=True)
class Chosen:
    """The adjusted model, its camera model, where the focal length is from, and each candidate's held-out error (median) in px.

    exif_over_refined: that error with the focal length of EXIF over that with it freed; focal_moved_share: how far freeing
    moves it, relatively. Both are None without EXIF.
    """

    model: pycolmap.Reconstruction
    camera_model: str
    focal_from: str
    heldout_px: dict[tuple[str, str], float]
    exif_over_refined: float | None = None
    focal_moved_share: float | None = None

    @property
    def focal_known(self) -> bool:
        """Whether EXIF states a focal length that the photographs do not contradict, be it kept or not."""
        return self.focal_from == EXIF and (self.exif_over_refined or 1.0) - 1 <= _WORTH_FOCAL


def choose_camera_model(model: pycolmap.Reconstruction, photos: pd.DataFrame) -> Chosen:
    """Return a copy of the model, mapped with the simplest camera, adjusted with the camera that predicts it best."""
    priors = _priors(model, photos)
    trial = thinned(model)
    held_out = _hold_out(trial)
    held = _completed(priors, trial if held_out else model)
    if not held_out:  # nothing is seen three times, so nothing can be told
        final = without_wrong_points(_adjusted(model, SIMPLEST, held))
        return Chosen(final, SIMPLEST, EXIF if priors else REFINED, {})
    heldout_px, moved_share = {}, {}
    for focal_from in (EXIF, REFINED) if priors else (REFINED,):
        for name in _MODELS:
            adjusted = _adjusted(trial, name, held if focal_from == EXIF else {})
            heldout_px[name, focal_from] = _error_px(adjusted, held_out)
            moved_share[name, focal_from] = _moved_share(adjusted, priors)
    best = {focal_from: (_smallest(heldout_px, focal_from), focal_from) for _, focal_from in heldout_px}
    camera_model, focal_from = best[REFINED]
    over = moved = None
    if priors:
        over, moved = heldout_px[best[EXIF]] / heldout_px[best[REFINED]], moved_share[best[REFINED]]
        if over - 1 <= max(_WORTH_FOCAL, _WORTH_MOVING * moved):
            camera_model, focal_from = best[EXIF]
    final = without_wrong_points(_adjusted(model, camera_model, held if focal_from == EXIF else {}))
    return Chosen(final, camera_model, focal_from, heldout_px, over, moved)


def adjusted_as_it_was(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Return a copy of the model, adjusted with its cameras as they are."""
    model = pycolmap.Reconstruction(model)
    adjust(model, refine_focal_length=False, refine_distortion=False)
    return without_wrong_points(model)


def chosen_before(model: pycolmap.Reconstruction, photos: pd.DataFrame) -> Chosen:
    """Tell of the cameras of a model that were chosen before."""
    priors = _priors(model, photos)
    kept = all(model.camera(camera_id).mean_focal_length() == focal_px for camera_id, focal_px in priors.items())
    camera_model = model.camera(min(_used_cameras(model))).model_name
    return Chosen(model, camera_model, EXIF if priors and kept else REFINED, {})


def adjust(model: pycolmap.Reconstruction, refine_focal_length: bool, refine_distortion: bool = True) -> None:
    """Adjust all poses, points and cameras in place, so that wrong matches weigh little."""
    pycolmap.bundle_adjustment(model, adjustment_options(refine_focal_length, refine_distortion))


def adjustment_options(refine_focal_length: bool, refine_distortion: bool = True) -> pycolmap.BundleAdjustmentOptions:
    """Return how all is adjusted: until it settles, wrong matches of little weight."""
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length, options.refine_extra_params = refine_focal_length, refine_distortion
    options.print_summary = False
    options.ceres.solver_options.num_threads = THREADS
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = _SURE_PX
    options.ceres.solver_options.function_tolerance = _SETTLED
    options.ceres.max_num_images_direct_sparse_cpu_solver = _SOLVED_EXACTLY
    return options


def _completed(known_px: dict[int, float], model: pycolmap.Reconstruction) -> dict[int, float]:
    """Add the focal lengths of the cameras whose own is not known: those that fit the photographs of the others best."""
    others = sorted(_used_cameras(model) - set(known_px))
    if not known_px or not others:
        return known_px
    # Mapping may have drifted along the valley with all cameras; the others are taken back as far as the known ones are.
    back = np.median(
        [focal_px / model.camera(camera_id).mean_focal_length() for camera_id, focal_px in known_px.items()]
    )
    start_px = {camera_id: float(back * model.camera(camera_id).mean_focal_length()) for camera_id in others}
    copy = _adjusted(model, SIMPLEST, known_px | start_px)
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in copy.reg_image_ids():
        config.add_image(image_id)
    for camera_id in known_px:
        config.set_constant_cam_intrinsics(camera_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    pycolmap.create_default_bundle_adjuster(adjustment_options(refine_focal_length=True), config, copy).solve()
    return known_px | {camera_id: copy.camera(camera_id).mean_focal_length() for camera_id in others}


def _smallest(heldout_px: dict[tuple[str, str], float], focal_from: str) -> str:
    errors = [heldout_px[name, focal_from] for name in _MODELS]
    return next(name for name, error in zip(_MODELS, errors, strict=True) if error <= _WORTH_LENS * min(errors))


def _adjusted(model: pycolmap.Reconstruction, camera_model: str, focal_px: dict[int, float]) -> pycolmap.Reconstruction:
    copy = pycolmap.Reconstruction(model)
    for camera_id in copy.cameras:
        camera = copy.camera(camera_id)
        f, cx, cy, k = camera.params
        f = focal_px.get(camera_id, f)
        camera.model = getattr(pycolmap.CameraModelId, camera_model)
        camera.params = {
            "SIMPLE_RADIAL": [f, cx, cy, k],
            "RADIAL": [f, cx, cy, k, 0],
            "OPENCV": [f, f, cx, cy, k, 0, 0, 0],
        }[camera_model]
    adjust(copy, refine_focal_length=not focal_px)
    return copy


def without_wrong_points(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Take out what turned out to be wrong, in place."""
    pycolmap.ObservationManager(model).filter_all_points3D(_MOST_PX, _LEAST_ANGLE_DEG)
    model.update_point_3d_errors()
    return model


def take_over(model: pycolmap.Reconstruction, adjusted: pycolmap.Reconstruction) -> None:
    """Move a model's cameras, poses and points, in place, to where another that holds them all has them."""
    for camera_id in model.cameras:
        camera, other = model.camera(camera_id), adjusted.camera(camera_id)
        camera.model, camera.params = other.model, other.params
    for frame_id in model.reg_frame_ids():
        model.frame(frame_id).rig_from_world = adjusted.frame(frame_id).rig_from_world
    for point_id in model.point3D_ids():
        model.point3D(point_id).xyz = adjusted.point3D(point_id).xyz


def _moved_share(model: pycolmap.Reconstruction, focal_px: dict[int, float]) -> float:
    moved = [abs(model.camera(camera_id).mean_focal_length() / known - 1) for camera_id, known in focal_px.items()]
    return max(moved, default=0.0)


def thinned(model: pycolmap.Reconstruction, for_each_view: int = 0) -> pycolmap.Reconstruction:
    """Return a copy with some thousand of the points alone, for trials; more where so many for each view are more."""
    copy = pycolmap.Reconstruction(model)
    long = [i for i in sorted(copy.point3D_ids()) if copy.point3D(i).track.length() >= _SHORTEST_TRACK]
    kept = set(long[:: max(1, len(long) // max(_TRIAL_POINTS, for_each_view * model.num_reg_images()))])
    for point_id in sorted(copy.point3D_ids()):
        if point_id not in kept:
            copy.delete_point3D(point_id)
    return copy


def _hold_out(trial: pycolmap.Reconstruction) -> list[Observation]:
    """Take a tenth of the observations out of the model, at most one from each point."""
    held_out = []
    count = 0
    for point_id in sorted(trial.point3D_ids()):
        seen = sorted((element.image_id, element.point2D_idx) for element in trial.point3D(point_id).track.elements)
        first = -count % _HELD_OUT
        count += len(seen)
        if first < len(seen):
            held_out.append((point_id, *seen[first]))
    for _, image_id, index in held_out:
        trial.delete_observation(image_id, index)
    return held_out


def _error_px(model: pycolmap.Reconstruction, held_out: list[Observation]) -> float:
    errors = []
    for point_id, image_id, index in held_out:
        image = model.image(image_id)
        at = model.camera(image.camera_id).img_from_cam(image.cam_from_world() * model.point3D(point_id).xyz)
        off_px = np.inf if at is None else float(np.linalg.norm(image.points2D[index].xy - at))
        errors.append(min(off_px, _LOST_PX))
    return float(np.median(errors))


def _used_cameras(model: pycolmap.Reconstruction) -> set[int]:
    return {model.image(image_id).camera_id for image_id in model.reg_image_ids()}


def _priors(model: pycolmap.Reconstruction, photos: pd.DataFrame) -> dict[int, float]:
    """Median EXIF focal length of each of the model's cameras that has one."""
    rows = photos.set_index(photos["photo_id"].map(image_name))
    placed = [model.image(image_id) for image_id in model.reg_image_ids()]
    camera_of = {image.name: image.camera_id for image in placed}
    known = rows.loc[list(camera_of)].assign(camera_id=list(camera_of.values())).dropna(subset="focal_px")
    return known.groupby("camera_id")["focal_px"].median().to_dict()
