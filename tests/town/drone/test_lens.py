import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.run.errors import InputError
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.lens import Lens


def lens(k1: float = -0.15, k2: float = 0.03, width: int = 320) -> Lens:
    return Lens.of(TownConfig(width_px=width, radial_k1=k1, radial_k2=k2))


def falls(bent: Lens, rays: np.ndarray) -> np.ndarray:
    """Where rays fall, in focal lengths from the middle, as COLMAP's RADIAL model says."""
    squared = (rays**2).sum(axis=-1, keepdims=True)
    return rays * (1 + bent.k1 * squared + bent.k2 * squared**2)


@given(st.floats(-0.2, 0.3), st.floats(0, 0.1), st.floats(-0.64, 0.64), st.floats(-0.48, 0.48))
def test_undistorting_undoes_distorting(k1, k2, x, y):
    bent = lens(k1, k2)
    fall = np.array([x, y])
    np.testing.assert_allclose(falls(bent, bent.undistort(fall)), fall, atol=1e-9)


def test_no_coefficients_change_nothing():
    straight = lens(0, 0)
    assert not straight.bends
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (20, 2))
    np.testing.assert_allclose(straight.undistort(points), points)


def dots(width: int, height: int, centres_px: np.ndarray, sigma: float = 2.0) -> np.ndarray:
    """White blobs; pixel centres are at half-integers."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    image = np.zeros((height, width))
    for cx, cy in centres_px:
        image += 250 * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * sigma**2))
    return np.repeat(np.rint(image.clip(0, 255)).astype(np.uint8)[..., None], 3, axis=2)


def blob_at(image: np.ndarray, near_px: np.ndarray, reach: int = 8) -> np.ndarray:
    x0, y0 = np.floor(near_px).astype(int) - reach
    patch = image[max(0, y0) : y0 + 2 * reach, max(0, x0) : x0 + 2 * reach, 0].astype(float)
    y, x = np.mgrid[max(0, y0) : max(0, y0) + patch.shape[0], max(0, x0) : max(0, x0) + patch.shape[1]] + 0.5
    return np.array([(x * patch).sum(), (y * patch).sum()]) / patch.sum()


@pytest.mark.parametrize(("k1", "k2"), [(-0.2, 0.03), (0.1, 0.0)])
def test_a_point_lands_where_the_model_says(k1, k2):
    bent = lens(k1, k2)
    width, height = bent.wide_size()
    rays = np.array([(0.0, 0.0), (0.3, 0.1), (-0.4, 0.3), (0.5, -0.35), (-0.2, -0.38)])
    wide = dots(width, height, rays * bent.focal_px + [width / 2, height / 2])
    photo = bent.resample(wide)
    assert photo.shape == (240, 320, 3)
    for place in bent.focal_px * falls(bent, rays) + [160, 120]:
        assert np.linalg.norm(blob_at(photo, place) - place) < 0.1


def test_the_wide_picture_holds_every_ray_of_the_photograph():
    barrel, pincushion = lens(-0.2, 0.03), lens(0.2, 0.0)
    assert barrel.wide_size()[0] > 320 > pincushion.wide_size()[0]
    for bent in (barrel, pincushion):
        width, height = bent.wide_size()
        white = np.full((height, width, 3), 200, np.uint8)
        np.testing.assert_array_equal(bent.resample(white), 200)


def test_a_lens_that_folds_over_is_refused():
    with pytest.raises(InputError, match="folds over"):
        Lens.of(TownConfig(focal_35mm=14, radial_k1=-0.3))
