import numpy as np
import pytest

from aug3d_core.geometry.geodesy import geodetic_from_enu
from aug3d_core.rendering.colour import linear_from_srgb
from aug3d_core.town.config import TownConfig
from aug3d_core.town.drone.gps import ORIGIN_GEODETIC, measured_places
from aug3d_core.town.drone.sensor import Defects, blur, expose, over_sky, ripple

IMAGE = np.random.default_rng(0).integers(30, 180, (40, 60, 3), dtype=np.uint8)


@pytest.mark.parametrize("factor", [0.5, 1.4])
def test_exposure_multiplies_light(factor):
    light = linear_from_srgb(expose(IMAGE, factor))
    np.testing.assert_allclose(light, np.minimum(1, factor * linear_from_srgb(IMAGE)), atol=0.005)
    assert expose(IMAGE, 1.0) is IMAGE


def test_too_much_light_is_clipped():
    assert (expose(np.full((2, 2, 3), 240, np.uint8), 3.0) == 255).all()


def test_blur_keeps_brightness_and_loses_detail():
    soft = blur(IMAGE, 2.0)
    assert soft.mean() == pytest.approx(IMAGE.mean(), abs=1)
    assert soft.std() < 0.25 * IMAGE.std()
    dot = np.zeros((41, 41, 3), np.uint8)
    dot[20, 20] = 255
    spread = blur(dot, 1.5)[..., 0].astype(float)
    at = np.arange(41) - 20.0
    assert (spread * at**2).sum() / spread.sum() == pytest.approx(1.5**2, rel=0.15)
    assert blur(IMAGE, 0.0) is IMAGE


def test_shares_are_exact():
    config = TownConfig(blur_px=3, blur_share=0.3, exposure_factor=2, exposure_share=0.25)
    defects = Defects.of(config, 40, np.random.default_rng(0))
    assert (defects.blur_px == 3).sum() == 12 and (defects.blur_px == 0).sum() == 28
    np.testing.assert_array_equal(defects.exposure, [1.0] * 30 + [2.0] * 10)


def test_a_flight_without_defects_has_none():
    defects = Defects.of(TownConfig(), 40, np.random.default_rng(0))
    assert (defects.blur_px == 0).all() and (defects.exposure == 1).all()


def test_sky_shows_where_nothing_else_does():
    alpha = np.full((40, 60), 255, np.uint8)
    assert over_sky(IMAGE, alpha) is IMAGE
    alpha[:10] = 0
    seen = over_sky(IMAGE, alpha)
    np.testing.assert_array_equal(seen[10:], IMAGE[10:])
    assert (seen[:10] == seen[0, 0]).all() and seen[0, 0, 2] > seen[0, 0, 0] > 150


def test_ripples_move_water_alone_and_never_twice_alike():
    image = np.full((40, 60, 3), (60, 90, 100), np.uint8)
    image[10:15, 20:40] = (200, 40, 40)  # a boat
    lake = np.zeros((40, 60), bool)
    lake[5:35] = True
    one, other = (ripple(image, lake, np.random.default_rng(seed)) for seed in (1, 2))
    np.testing.assert_array_equal(one[~lake], image[~lake])
    np.testing.assert_array_equal(one[10:15, 20:40], image[10:15, 20:40])
    water = lake & (image[..., 0] == 60)
    a, b = one[water][:, 1].astype(float), other[water][:, 1].astype(float)
    assert a.std() > 6 and abs(np.corrcoef(a, b)[0, 1]) < 0.2


CENTRES = np.random.default_rng(1).uniform(-100, 100, (40, 3))


def enu_error(config: TownConfig) -> np.ndarray:
    measured = measured_places(config, CENTRES, np.random.default_rng(3))
    exact = geodetic_from_enu(CENTRES, np.array(ORIGIN_GEODETIC))
    metres = np.array([111_170.0, 76_170.0, 1.0])  # of a degree at 46.9 north
    return (measured - exact)[:, [1, 0, 2]] * metres[[1, 0, 2]]


def test_a_share_of_the_gps_is_wrong_by_so_many_metres():
    error = enu_error(TownConfig(gps_noise_m=0.5, gps_gross_share=0.2, gps_gross_m=80))
    off = np.linalg.norm(error[:, :2], axis=1)
    assert (off > 10).sum() == 8
    np.testing.assert_allclose(off[off > 10], 80, atol=4)
    assert np.abs(error[:, 2]).max() < 3, "gross errors are sideways"


def test_the_altitude_is_wrong_alike():
    right, wrong = enu_error(TownConfig()), enu_error(TownConfig(gps_altitude_off_m=-48))
    np.testing.assert_allclose(wrong - right, np.tile([0, 0, -48], (40, 1)), atol=2e-3)


def test_a_flight_without_gps_knows_no_place():
    assert measured_places(TownConfig(gps=False), CENTRES, np.random.default_rng(0)) is None
