"""The light in the corners of photographs of a little scene, darkened on purpose and written evened out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from PIL import Image

from aug3d_core.photos.files import PHOTO_IMAGES, image_name
from aug3d_core.sfm import export
from aug3d_core.sfm.camera_falloffs import measure_falloffs
from aug3d_core.sfm.falloff import Falloff
from aug3d_core.sfm.files import COLMAP_MODEL, VIEW_IMAGES

pytestmark = pytest.mark.slow

LINEAR = -0.4


@pytest.fixture(scope="module")
def model(little_flight: Path) -> pycolmap.Reconstruction:
    """Return the reconstruction of twelve photographs of one camera, whose corners are as bright as the middle."""
    return pycolmap.Reconstruction(little_flight / "sfm" / "files" / COLMAP_MODEL)


@pytest.fixture(scope="module")
def darkened(
    little_flight: Path, model: pycolmap.Reconstruction, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, float]:
    """Return a folder of its photographs with darker corners, and the light in these."""
    folder = tmp_path_factory.mktemp("darkened")
    pinhole = export.undistorted_camera(model.camera(1))
    fx, fy, cx, cy = pinhole.params
    corner = (cx / fx) ** 2 + (cy / fy) ** 2
    for photo in sorted((little_flight / "photos" / PHOTO_IMAGES).iterdir()):
        with Image.open(photo) as image:
            pixels = np.asarray(image.convert("RGB"), float)
        y, x = np.mgrid[: pixels.shape[0], : pixels.shape[1]] + 0.5
        rays = model.camera(1).cam_from_img(np.stack([x.ravel(), y.ravel()], axis=1))
        light = np.exp(LINEAR * (rays**2).sum(axis=1) / corner).reshape(x.shape)
        Image.fromarray(np.rint(pixels * light[..., None]).astype(np.uint8)).save(folder / photo.name)
    return folder, float(np.exp(LINEAR))


def test_corners_that_lack_light_are_found_and_evened_out(
    little_flight: Path, model: pycolmap.Reconstruction, darkened: tuple[Path, float], tmp_path: Path
) -> None:
    folder, light = darkened
    falloffs = measure_falloffs(model, folder, {})
    found = falloffs[1]
    assert found is not None and found.evened
    assert found.corner_light == pytest.approx(light, abs=0.03)
    export.write_undistorted(model, folder, tmp_path / "out", {}, falloffs)
    for photo_id in (0, 11):
        with (
            Image.open(tmp_path / "out" / image_name(photo_id)) as image,
            Image.open(little_flight / "sfm" / "files" / VIEW_IMAGES / image_name(photo_id)) as plain,
        ):
            even, true = (np.asarray(one, float) for one in (image, plain))
        told = (true > 20) & (true < 200)
        ratio = even[told] / true[told]
        assert np.median(np.abs(ratio / np.median(ratio) - 1)) < 0.02
        corner, middle = even[:40, :40], even[100:140, 140:180]
        assert corner.mean() / true[:40, :40].mean() == pytest.approx(
            middle.mean() / true[100:140, 140:180].mean(), abs=0.03
        )


def test_photographs_without_darker_corners_are_written_as_they_were(
    little_flight: Path, model: pycolmap.Reconstruction, tmp_path: Path
) -> None:
    photos = little_flight / "photos" / PHOTO_IMAGES
    falloffs = measure_falloffs(model, photos, {})
    assert falloffs[1] is not None and not falloffs[1].evened
    export.write_undistorted(model, photos, tmp_path / "out", {}, falloffs)
    written = little_flight / "sfm" / "files" / VIEW_IMAGES
    for photo_id in (0, 11):
        assert (tmp_path / "out" / image_name(photo_id)).read_bytes() == (written / image_name(photo_id)).read_bytes()


def test_a_camera_that_is_known_is_not_measured_again(
    model: pycolmap.Reconstruction, darkened: tuple[Path, float], tmp_path: Path
) -> None:
    known = {1: Falloff(0.7, -0.2, 0.0, 0.001)}
    assert measure_falloffs(model, tmp_path / "nothing there", known) == known
