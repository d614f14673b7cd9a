"""A flight that a wrong lens bent is straightened by control points, and left alone where they do not help."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.photos.files import image_name
from aug3d_core.sfm.camera_model import adjust
from aug3d_core.sfm.control import Survey, marked_points, survey
from aug3d_core.sfm.control_adjustment import Adjusted, adjust_to_control

ORIGIN = np.array([52.2, 21.0, 110.0])
SIZE, FOCAL_PX = (1200, 900), 1000.0
HEIGHT_M = 80.0
CONTROL = np.array([[-60.0, -45, 0], [60, -45, 2], [60, 45, 0], [-60, 45, 3], [0, 0, 0]])
CHECKS = np.array([[30.0, 0, 0], [-30, 20, 1], [0, 40, 0], [-25, -30, 0]])


def true_camera(k: float) -> pycolmap.Camera:
    return pycolmap.Camera(
        camera_id=1,
        model="SIMPLE_RADIAL",
        width=SIZE[0],
        height=SIZE[1],
        params=[FOCAL_PX, SIZE[0] / 2, SIZE[1] / 2, k],
    )


def flight(
    k: float, held: bool, seed: int = 0, noise_px: float = 0.3
) -> tuple[pycolmap.Reconstruction, pd.DataFrame, np.ndarray]:
    """Return an adjusted model of a flight over nearly flat ground, the marks of its points, and the true camera centres.

    k: distortion of the lens; if held, the model has none, and is bent by it.
    """
    rng = np.random.default_rng(seed)
    east, north = np.meshgrid(np.linspace(-70, 70, 7), np.linspace(-50, 50, 6))
    at = np.stack([east.ravel(), north.ravel(), np.full(east.size, HEIGHT_M)], axis=1) + rng.normal(size=(42, 3))
    poses = [look_at(eye, eye * [1, 1, 0] + [*rng.uniform(-2, 2, 2), 0]) for eye in at]
    ground = np.column_stack([rng.uniform(-110, 110, 1200), rng.uniform(-85, 85, 1200), rng.uniform(0, 3, 1200)])
    camera = true_camera(k)
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(true_camera(0.0 if held else k))
    keypoints: list[list[np.ndarray]] = [[] for _ in at]
    tracks: list[list[tuple[int, int]]] = []
    marks = []
    for number, place in enumerate([*ground, *CONTROL, *CHECKS]):
        of_control = number - len(ground)
        track = []
        for view, pose in enumerate(poses):
            pixel = camera.img_from_cam((pose[:, :3] @ place + pose[:, 3])[None])[0]
            if not ((pixel > 5) & (pixel < np.array(SIZE) - 5)).all():
                continue
            pixel = pixel + rng.normal(size=2) * noise_px
            if of_control >= 0:
                check = of_control >= len(CONTROL)
                told = geodetic_from_enu(place, ORIGIN)
                marks.append((f"{'chk' if check else 'P'}{of_control}", check, *told, view, *pixel, len(marks) + 2))
            else:
                keypoints[view].append(pixel)
                track.append((view, len(keypoints[view]) - 1))
        tracks.append(track)
    for view, pose in enumerate(poses):
        image = pycolmap.Image(
            name=image_name(view), keypoints=np.array(keypoints[view]), camera_id=1, image_id=view + 1
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pose))
    for place, track in zip(ground, tracks, strict=False):
        if len(track) >= 2:
            model.add_point3D(place, pycolmap.Track([pycolmap.TrackElement(view + 1, index) for view, index in track]))
    adjust(model, refine_focal_length=not held, refine_distortion=not held)
    columns = ["point", "check", "lat_deg", "lon_deg", "alt_m", "photo_id", "x_px", "y_px", "line"]
    return model, pd.DataFrame(marks, columns=columns), at


def adjusted(model: pycolmap.Reconstruction, marks: pd.DataFrame) -> tuple[Survey, Adjusted]:
    told = survey(marked_points(model, marks))
    fit = told.world_from_model
    assert fit is not None, told.problem
    model.transform(pycolmap.Sim3d(fit.scale, pycolmap.Rotation3d(fit.rotation), fit.translation))
    return told, adjust_to_control(model, marks, told)


def bend_m(model: pycolmap.Reconstruction, at: np.ndarray) -> float:
    """Return how far camera centres are from the truth after the best similarity (RMS)."""
    found = centres(np.stack([model.image(one).cam_from_world().matrix() for one in sorted(model.reg_image_ids())]))
    return float(np.sqrt(np.square(fit_similarity(found, at).apply(found) - at).sum(axis=1).mean()))


@pytest.mark.parametrize("k", [-0.06, -0.01])
def test_a_bent_flight_is_straightened(k: float) -> None:
    """The point in the middle, which only the bend has elsewhere, looked wrong before, and tells of it after."""
    model, marks, at = flight(k, held=True)
    before_m, points = bend_m(model, at), model.num_points3D()
    keypoints = {image_id: image.num_points2D() for image_id, image in model.images.items()}
    told, found = adjusted(model, marks)
    assert "P4 is " in told.remarks[0] and found.survey.remarks == ()
    assert found.used and found.adjusted_m and found.moved_m and found.adjusted_m < 0.4 * found.moved_m
    assert bend_m(model, at) < 0.4 * before_m
    before, after = told.rms_m("check"), found.survey.rms_m("check")
    assert before and after and np.hypot(*after) < 0.2 * np.hypot(*before)
    assert model.num_points3D() > 0.95 * points
    assert {image_id: image.num_points2D() for image_id, image in model.images.items()} == keypoints
    table = found.survey.table.set_index("point")
    assert table.loc["P4", "role"] == "control" and table.loc["P0", "error_up_m"] != table.loc["P0", "residual_up_m"]


def test_a_wrong_point_stays_out_of_it() -> None:
    model, marks, at = flight(-0.03, held=True)
    marks.loc[marks["point"] == "P4", "alt_m"] += 6
    _, found = adjusted(model, marks)
    assert found.survey.table.set_index("point").loc["P4", "role"] == "wrong"
    assert "P4 is " in found.survey.remarks[0] and bend_m(model, at) < 0.2


@pytest.mark.parametrize(("survey_m", "seed"), [(0.0, 1), (0.03, 1), (0.3, 0)])
def test_a_straight_flight_is_not_adjusted_to_noise(survey_m: float, seed: int) -> None:
    model, marks, at = flight(-0.06, held=False, seed=seed)
    off_m = dict(zip(marks["point"].unique(), np.random.default_rng(seed).normal(size=(9, 3)) * survey_m, strict=True))
    marks[["lat_deg", "lon_deg", "alt_m"]] += np.stack([off_m[name] for name in marks["point"]]) / [111_000, 68_000, 1]
    before_m = bend_m(model, at)
    told, found = adjusted(model, marks)
    assert not found.used and found.survey is told and found.moved_m is not None
    assert bend_m(model, at) == pytest.approx(before_m, rel=1e-6)


def test_three_points_only_move_it() -> None:
    model, marks, _ = flight(-0.06, held=True)
    told, found = adjusted(model, marks.loc[marks["point"].isin(["P0", "P1", "P2", "chk5"])])
    assert found == Adjusted(told, False)
