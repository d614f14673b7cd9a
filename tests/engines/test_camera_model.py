"""The camera model grows with the lens, not with the noise, and EXIF's focal length is kept unless it is wrong."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pycolmap
import pytest

from aug3d_core.geometry.transforms import apply, look_at
from aug3d_core.photos.files import image_name
from aug3d_core.sfm.camera_model import choose_camera_model

FOCAL_PX = 500.0
LENSES = {
    "SIMPLE_RADIAL": [FOCAL_PX, 320, 240, -0.1],
    "RADIAL": [FOCAL_PX, 320, 240, -0.2, 0.12],
    "OPENCV": [FOCAL_PX, FOCAL_PX, 320, 240, -0.1, 0.05, 0.01, -0.01],
}


def mapped_with_the_simplest(lens: str, zooms: tuple[float, ...] = (1.0,)) -> pycolmap.Reconstruction:
    """Return a flight over rough ground through a lens, with noise of 0.4 px, as mapping would hand it over.

    zooms: of the cameras, 1 and on, that take photographs by turns.
    """
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-60, 60, (1500, 2)), rng.uniform(0, 15, 1500)])
    at = [np.array([x, y, 50.0 + 5 * ((x + y) % 2)]) for x in range(-30, 31, 15) for y in range(-20, 21, 20)]
    model, tracks = pycolmap.Reconstruction(), [pycolmap.Track() for _ in points]
    simple = [FOCAL_PX, 320, 240, LENSES[lens][4 if lens == "OPENCV" else 3]]
    for camera_id, zoom in enumerate(zooms, 1):
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(
                model="SIMPLE_RADIAL", width=640, height=480, params=[zoom * FOCAL_PX, *simple[1:]], camera_id=camera_id
            )
        )
    for image_id, centre in enumerate(at, 1):
        camera_id = 1 + image_id % len(zooms)
        camera = pycolmap.Camera(model=lens, width=640, height=480, params=LENSES[lens], camera_id=camera_id)
        for which in camera.focal_length_idxs():
            camera.params[which] *= zooms[camera_id - 1]
        pose = look_at(centre, centre * [1, 1, 0] + np.append(rng.uniform(-12, 12, 2), 0))
        seen = np.asarray(camera.img_from_cam(apply(pose, points))) + rng.normal(size=(len(points), 2)) * 0.4
        inside = np.flatnonzero(((seen >= 0) & (seen < [640, 480])).all(axis=1))
        for index, point in enumerate(inside):
            tracks[point].add_element(image_id, index)
        image = pycolmap.Image(image_name(image_id - 1), seen[inside], camera_id=camera_id, image_id=image_id)
        cam_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:, :3]), pose[:, 3])
        model.add_image_with_trivial_frame(image, cam_from_world)
    for xyz, track in zip(points, tracks, strict=True):
        if track.length() >= 2:
            model.add_point3D(xyz, track)
    return model


def with_wrong_matches(model: pycolmap.Reconstruction, share: float) -> pycolmap.Reconstruction:
    """Return the model with a share of what photographs see too near to their middle, by as much as mapping lets through."""
    rng = np.random.default_rng(3)
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        for index in np.flatnonzero(rng.random(len(image.points2D)) < share):
            inward = np.array([320.0, 240.0]) - image.points2D[index].xy
            image.points2D[index].xy = image.points2D[index].xy + 3.5 * inward / np.linalg.norm(inward)
    return model


def photos(model: pycolmap.Reconstruction, *focal_px: float) -> pd.DataFrame:
    """Return the photo table, with the focal lengths of the cameras that take photographs by turns."""
    camera_of = [model.image(image_id).camera_id for image_id in sorted(model.reg_image_ids())]
    return pd.DataFrame({"photo_id": range(len(camera_of)), "focal_px": np.array(focal_px)[np.array(camera_of) - 1]})


@pytest.mark.parametrize("lens", LENSES)
def test_the_model_is_as_big_as_the_lens(lens: str) -> None:
    model = mapped_with_the_simplest(lens)
    chosen = choose_camera_model(model, photos(model, FOCAL_PX))
    assert chosen.camera_model == lens
    assert chosen.focal_from == "exif"
    assert len(chosen.heldout_px) == 6
    assert chosen.model.compute_mean_reprojection_error() < 0.8


@pytest.mark.parametrize("focal_px", [250.0, 505.0, 525.0, 1000.0])
def test_a_wrong_focal_length_is_freed(focal_px: float) -> None:
    model = mapped_with_the_simplest("SIMPLE_RADIAL")
    chosen = choose_camera_model(model, photos(model, focal_px))
    assert chosen.focal_from == "refined"
    assert chosen.model.camera(1).focal_length == pytest.approx(FOCAL_PX, rel=0.01)
    assert chosen.exif_over_refined is not None
    assert chosen.exif_over_refined > 1.02
    assert chosen.focal_moved_share == pytest.approx(abs(FOCAL_PX / focal_px - 1), abs=0.01)


def test_a_missing_focal_length_is_freed() -> None:
    model = mapped_with_the_simplest("SIMPLE_RADIAL")
    chosen = choose_camera_model(model, photos(model, np.nan))
    assert (chosen.focal_from, chosen.exif_over_refined) == ("refined", None)


@pytest.mark.parametrize("drift", [1.0, 1.2])
def test_a_camera_without_a_focal_length_leaves_the_others_theirs(drift: float) -> None:
    """Mapping may have drifted, as over flat ground: what EXIF says of one camera then tells the other's focal length."""
    model = mapped_with_the_simplest("SIMPLE_RADIAL", zooms=(1.0, 1.4))
    for camera in model.cameras.values():
        camera.focal_length *= drift
    chosen = choose_camera_model(model, photos(model, FOCAL_PX, np.nan))
    assert chosen.focal_from == "exif" and chosen.focal_known
    assert chosen.model.camera(1).focal_length == FOCAL_PX
    assert chosen.model.camera(2).focal_length == pytest.approx(1.4 * FOCAL_PX, rel=0.005)
    assert chosen.exif_over_refined == pytest.approx(1, abs=0.02)


def test_a_wrong_focal_length_of_one_of_two_cameras_is_freed() -> None:
    model = mapped_with_the_simplest("SIMPLE_RADIAL", zooms=(1.0, 1.4))
    chosen = choose_camera_model(model, photos(model, 1.2 * FOCAL_PX, np.nan))
    assert chosen.focal_from == "refined" and not chosen.focal_known
    assert chosen.model.camera(1).focal_length == pytest.approx(FOCAL_PX, rel=0.01)
    assert chosen.model.camera(2).focal_length == pytest.approx(1.4 * FOCAL_PX, rel=0.01)


def test_points_seen_twice_tell_nothing() -> None:
    model = mapped_with_the_simplest("SIMPLE_RADIAL")
    for point_id in list(model.point3D_ids()):
        if model.point3D(point_id).track.length() > 2:
            model.delete_point3D(point_id)
    chosen = choose_camera_model(model, photos(model, FOCAL_PX))
    assert (chosen.camera_model, chosen.focal_from) == ("SIMPLE_RADIAL", "exif")
    assert chosen.exif_over_refined is None


def seen_from_the_first(model: pycolmap.Reconstruction, image_id: int) -> pycolmap.Rotation3d:
    first = model.image(min(model.reg_image_ids())).cam_from_world().rotation
    return model.image(image_id).cam_from_world().rotation * first.inverse()


def test_wrong_matches_bend_neither_the_lens_nor_the_flight() -> None:
    """Least squares gives k1 = -0.10015 and turns photographs by 0.11 degrees; without wrong matches it is 0.04."""
    sound = mapped_with_the_simplest("SIMPLE_RADIAL")
    model = with_wrong_matches(pycolmap.Reconstruction(sound), 0.1)
    chosen = choose_camera_model(model, photos(model, FOCAL_PX))
    assert chosen.camera_model == "SIMPLE_RADIAL"
    assert chosen.model.camera(1).params[3] == pytest.approx(-0.1, abs=5e-5)
    for image_id in sound.reg_image_ids():
        turn = seen_from_the_first(chosen.model, image_id) * seen_from_the_first(sound, image_id).inverse()
        assert np.degrees(turn.angle()) < 0.08
