"""Photographs of different sizes in one scene are packed to one, each with its own crop and camera."""

import numpy as np
import pandas as pd
from PIL import Image

from aug3d_core.dataset.config import DatasetConfig
from aug3d_core.dataset.real import pack_real, seen_depths
from aug3d_core.dataset.slab import Slab
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.sfm.files import POINTS, TRACKS, VIEW_IMAGES, VIEWS
from aug3d_core.split.files import SPLIT_TABLE


def test_photographs_of_other_sizes_and_shapes_are_packed_to_one(tmp_path):
    sizes = np.array([[40, 30], [80, 60], [60, 60]])
    focal_px = np.array(
        [36.0, 72.0, 72.0]
    )  # the second is the first at twice the size, the third is cropped to its middle
    views = Views(
        photo_id=np.arange(3),
        cam_from_world=np.stack([look_at(np.array([0.0, 0, 30]), np.array([0.0, 1, 0]))] * 3),
        intrinsics=np.column_stack([focal_px, focal_px, sizes / 2]),
        size=sizes,
    )
    (tmp_path / VIEW_IMAGES).mkdir()
    for photo_id, (width, height) in enumerate(sizes.tolist()):
        stripes = np.zeros((height, width, 3), np.uint8)
        stripes[height // 2 :] = 200
        stripes[:, width // 2 :] += 20
        Image.fromarray(stripes).save(tmp_path / VIEW_IMAGES / image_name(photo_id))
    views.save(tmp_path / VIEWS)
    rng = np.random.default_rng(0)
    xyz = np.column_stack([rng.uniform(-9, 9, (50, 2)), rng.uniform(0, 3, 50)])
    Points(xyz, np.zeros((50, 3), np.uint8), np.ones(50)).save(tmp_path / POINTS)
    point, view = np.tile(np.arange(50), 3), np.repeat(np.arange(3), 50)
    Tracks(point, view, np.zeros((150, 2))).save(tmp_path / TRACKS)
    pd.DataFrame({"view": range(3), "role": "train"}).to_parquet(tmp_path / SPLIT_TABLE)
    packed = pack_real(tmp_path, tmp_path, tmp_path, Slab(0, 0, 0, -1, 4), DatasetConfig(width_px=20, height_px=16))
    assert packed.images.shape == (3, 16, 20, 3)
    assert np.array_equal(packed.images[0], packed.images[1])
    assert packed.fine_images.shape == (3, 32, 40, 3)
    parts = packed.fine_images[:].reshape(3, 16, 2, 20, 2, 3).mean(axis=(2, 4))
    assert np.abs(parts - packed.images[:].astype(float)).max() <= 1
    assert np.allclose(packed.intrinsics[0], packed.intrinsics[1])
    assert np.allclose(packed.intrinsics[:, 2:], [10, 8])
    assert packed.intrinsics[2, 0] == 72 * 20 / 60


def test_a_view_without_a_point_before_it_has_the_distances_of_all_points():
    eye = np.array([0.0, 0, 30])
    down, sky = look_at(eye, np.array([0.0, 1, 0])), look_at(eye, np.array([0.0, 9, 99]))
    views = Views(np.arange(2), np.stack([down, sky]), np.ones((2, 4)), np.full((2, 2), 9))
    xyz = np.random.default_rng(0).uniform(-9, 9, (50, 3))
    points = Points(xyz, np.zeros((50, 3), np.uint8), np.ones(50))
    seen = Tracks(np.arange(20), np.zeros(20, int), np.zeros((20, 2)))
    depths, distances = seen_depths(views, points, seen)
    assert len(depths) == 20
    np.testing.assert_allclose(distances, np.linalg.norm(xyz - eye, axis=1))
