"""Undistorted photographs show no part of the picture twice, and are as before where the lens does not fold it over."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pycolmap
import pytest
from PIL import Image

from aug3d_core.geometry.masks import save_mask, used_pixels
from aug3d_core.photos.files import image_name, mask_path
from aug3d_core.sfm import export
from aug3d_core.sfm.falloff import Falloff
from aug3d_core.sfm.write import lens_notes

WIDTH, HEIGHT = 1024, 768
FOLDING = ("SIMPLE_RADIAL", [500.0, 512.0, 384.0, -0.2])


def camera_of(model: str, params: list[float]) -> pycolmap.Camera:
    return pycolmap.Camera(camera_id=1, model=model, width=WIDTH, height=HEIGHT, params=params)


def one_photograph(camera: pycolmap.Camera) -> pycolmap.Reconstruction:
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(camera)
    image = pycolmap.Image(image_name(0), np.zeros((0, 2)), camera_id=1, image_id=1)
    model.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    return model


def by_colmap(camera: pycolmap.Camera) -> pycolmap.Camera:
    options = pycolmap.UndistortCameraOptions()
    options.blank_pixels = 0.0
    return pycolmap.undistort_camera(options, camera)


def test_what_a_lens_folds_over_is_cut_off_photographs_and_masks(tmp_path: Path) -> None:
    """The photograph's brightness tells the column that a pixel is from; the mask is the photograph's left half."""
    column = np.arange(WIDTH) // 4
    (tmp_path / "images").mkdir()
    pixels = np.broadcast_to(column[None, :, None], (HEIGHT, WIDTH, 3)).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "images" / image_name(0))
    save_mask(pixels[..., 0] < 128, mask_path(tmp_path, 0))
    model = one_photograph(camera_of(*FOLDING))
    export.write_undistorted(model, tmp_path / "images", tmp_path / "out", {}, {1: None})
    export.write_undistorted_masks(model, tmp_path / "masks", tmp_path / "out_masks")
    pinhole = export.undistorted_camera(model.camera(1))
    with Image.open(tmp_path / "out" / image_name(0)) as image:
        assert image.size == (pinhole.width, pinhole.height)
        shown = np.asarray(image)[..., 0].astype(int)
    assert (np.diff(shown, axis=1) >= 0).all(), "no column of the photograph appears twice"
    y, x = np.mgrid[: pinhole.height : 8, : pinhole.width : 8]
    rays = (np.stack([x.ravel(), y.ravel()], axis=1) + 0.5 - pinhole.params[2:]) / pinhole.params[:2]
    at = np.asarray(model.camera(1).img_from_cam(np.column_stack([rays, np.ones(len(rays))])))
    np.testing.assert_allclose(
        shown[::8, ::8].ravel(), at[:, 0] / 4, atol=1, err_msg="the camera is that of the picture"
    )
    np.testing.assert_allclose(model.camera(1).cam_from_img(at), rays, atol=1e-3, err_msg="each pixel has one ray")
    used = used_pixels(tmp_path / "out_masks" / image_name(0))
    assert used is not None
    np.testing.assert_array_equal(used, shown < 128)


def test_as_much_as_can_be_is_left_of_a_lens_that_folds() -> None:
    """It folds where 1 - 3 * 0.2 r^2 = 0, and no larger rectangle has its corners within that r."""
    fx, fy, cx, cy = export.undistorted_camera(camera_of(*FOLDING)).params
    assert 0.95 < np.hypot(cx / fx, cy / fy) * np.sqrt(3 * 0.2) < 1
    whole = by_colmap(camera_of(*FOLDING))
    best = min(whole.height / 2, fx / np.sqrt(2 * 3 * 0.2)) * fx / np.sqrt(2 * 3 * 0.2)
    assert 0.93 * best < cx * cy < 1.001 * best


def test_the_light_of_a_lens_that_folds_is_evened_out(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    Image.new("RGB", (WIDTH, HEIGHT), (100, 100, 100)).save(tmp_path / "images" / image_name(0))
    falloff = Falloff(1.2, -0.3, 0.0, 0.001)
    model = one_photograph(camera_of(*FOLDING))
    export.write_undistorted(model, tmp_path / "images", tmp_path / "out", {}, {1: falloff})
    with Image.open(tmp_path / "out" / image_name(0)) as image:
        shown = np.asarray(image)[..., 0].astype(int)
    corners = shown[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert np.ptp(corners) <= 1, "the axis stays in the middle"
    assert corners.min() > 1.2 * shown[shown.shape[0] // 2, shown.shape[1] // 2]


@pytest.mark.parametrize(
    ("model", "params"),
    [
        ("SIMPLE_RADIAL", [700.0, 520.0, 380.0, -0.2]),
        ("SIMPLE_RADIAL", [500.0, 512.0, 384.0, -0.12]),
        ("SIMPLE_RADIAL", [800.0, 512.0, 384.0, 0.1]),
        ("RADIAL", [600.0, 512.0, 384.0, -0.28, 0.08]),
        ("OPENCV", [900.0, 890.0, 500.0, 390.0, -0.1, 0.02, 1e-3, -1e-3]),
        ("OPENCV_FISHEYE", [300.0, 300.0, 512.0, 384.0, 0.0, 0.0, 0.0, 0.0]),
        ("PINHOLE", [900.0, 900.0, 512.0, 384.0]),
    ],
)
def test_a_lens_that_does_not_fold_has_the_camera_that_colmap_gives_it_by_whole_pixels(
    model: str, params: list[float]
) -> None:
    """What it shows lies within COLMAP's image, and less than a pixel of that is lost on either axis."""
    camera = camera_of(model, params)
    found, whole = export.undistorted_camera(camera), by_colmap(camera)
    np.testing.assert_array_equal(found.params[:2], whole.params[:2])
    moved = found.params[2:] - [camera.principal_point_x, camera.principal_point_y]
    np.testing.assert_allclose(moved, np.rint(moved), atol=1e-5)
    before = whole.params[2:] - found.params[2:]
    after = np.array([whole.width - found.width, whole.height - found.height]) - before
    assert (before > -1e-5).all()
    assert (after > -1e-5).all()
    assert (before + after < 2).all()
    net = np.meshgrid(np.linspace(0, found.width, 65), np.linspace(0, found.height, 65), 1.0)
    rays = (np.stack(net, axis=-1).reshape(-1, 3) - [*found.params[2:], 0]) / [*found.params[:2], 1]
    shown = np.asarray(camera.img_from_cam(rays))
    assert ((shown >= 0) & (shown <= [WIDTH, HEIGHT])).all(), "nothing that it shows is outside of the photograph"
    assert lens_notes(one_photograph(camera), pd.DataFrame({"camera": ["DJI"]})) == ()


@pytest.mark.parametrize("k", [0.0, -4e-4, 4e-4, -8e-4, 8e-4])
def test_the_middle_of_a_photograph_stays_as_sharp_as_it_is_whatever_the_lens(tmp_path: Path, k: float) -> None:
    """Of noise, each pixel of the middle is the photograph's own: COLMAP's image is half a pixel beside it for some of them."""
    (tmp_path / "images").mkdir()
    pixels = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "images" / image_name(0))
    model = one_photograph(camera_of("SIMPLE_RADIAL", [800.0, 512.0, 384.0, k]))
    export.write_undistorted(model, tmp_path / "images", tmp_path / "out", {}, {1: None})
    with Image.open(tmp_path / "out" / image_name(0)) as image:
        shown = np.asarray(image)
    left, top = np.rint([512, 384] - export.undistorted_camera(model.camera(1)).params[2:]).astype(int)
    middle = (slice(384 - 50, 384 + 50), slice(512 - 50, 512 + 50))
    same = shown[middle[0].start - top : middle[0].stop - top, middle[1].start - left : middle[1].stop - left]
    np.testing.assert_array_equal(same, pixels[middle])


def test_a_lens_that_folds_is_told() -> None:
    (note,) = lens_notes(one_photograph(camera_of(*FOLDING)), pd.DataFrame({"camera": ["DJI FC"]}))
    assert note.startswith(
        "the lens of DJI FC (SIMPLE_RADIAL) folds the picture over before the edge of the frame: 36 %"
    )
