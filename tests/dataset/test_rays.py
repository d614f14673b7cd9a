import numpy as np
import pytest

from aug3d_core.dataset.projection import project
from aug3d_core.dataset.rays import pixel_centres, pixel_rays, view_rays
from tests.toy_scene import toy_scene


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 11, 7)


def test_points_along_a_ray_project_back_to_its_pixel(scene):
    xy_px = np.array([[0.5, 0.5], [10.5, 6.5], [3.5, 5.5]])
    rays = pixel_rays(scene, np.full(3, 4), xy_px, slab_bounds=True)
    for t in (rays.near, rays.far):
        there, ahead = project(scene, 4, rays.origins + t[:, None] * rays.directions)
        assert ahead.all()
        assert np.allclose(there, xy_px)


def test_the_bounds_hold_what_the_view_shows(scene):
    view = int(scene.groups["rendered"][0, 0])  # its exact depth is in the scene
    rays = view_rays(scene, view, slab_bounds=True)
    depth = scene.depth[view].ravel().astype(float)
    assert (rays.near < depth).all()
    assert (depth < rays.far).all()
    whole = view_rays(scene, view, slab_bounds=False)
    assert ((rays.far - rays.near) < (whole.far - whole.near)).mean() > 0.9


def test_pixels_go_row_by_row_in_a_picture_that_is_not_square():
    centres = pixel_centres(11, 7)
    assert centres[0].tolist() == [0.5, 0.5]
    assert centres[1].tolist() == [1.5, 0.5]
    assert centres[-1].tolist() == [10.5, 6.5]
