import tracemalloc

import numpy as np
import pytest

from aug3d_core.surface import exposure
from aug3d_core.surface.exposure import exposure_gains

PHOTOS, PLACES = 9, 1500


def flight(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A row of photos, each over a third of the places: (place, photo, colour) of every sight."""
    x, colour = rng.uniform(0, PHOTOS, PLACES), rng.uniform(40, 180, (PLACES, 3))
    place, photo = np.nonzero(np.abs(x[:, None] - np.arange(PHOTOS) - 0.5) < 1.5)
    return place, photo, colour[place] * rng.normal(1, 0.03, (len(place), 3))


def even(gains: np.ndarray) -> np.ndarray:
    return gains / np.exp(np.log(gains).mean(axis=0))


def test_known_exposures_are_recovered_to_two_percent():
    rng = np.random.default_rng(0)
    place, photo, rgb = flight(rng)
    factor = rng.uniform(0.5, 1.3, (PHOTOS, 3))
    found = exposure_gains(place, photo, rgb * factor[photo], PHOTOS)
    np.testing.assert_allclose(even(found), even(1 / factor), rtol=0.02)


def test_a_bright_and_a_dark_half_meet_though_a_tenth_of_the_sights_is_wrong():
    rng = np.random.default_rng(1)
    place, photo, rgb = flight(rng)
    factor = np.where(np.arange(PHOTOS) < 4, 0.6, 1.2)[:, None] * np.ones(3)
    wrong = rng.random(len(rgb)) < 0.1
    rgb[wrong] = rng.uniform(20, 240, (wrong.sum(), 3))
    found = exposure_gains(place, photo, rgb * factor[photo], PHOTOS)
    np.testing.assert_allclose(even(found), even(1 / factor), rtol=0.02)


def test_equal_exposures_give_ones():
    place, photo, rgb = flight(np.random.default_rng(2))
    np.testing.assert_allclose(exposure_gains(place, photo, rgb, PHOTOS), 1, atol=0.01)


def test_the_mean_brightness_stays():
    rng = np.random.default_rng(6)
    place, photo, rgb = flight(rng)
    rgb *= rng.uniform(0.5, 1.3, (PHOTOS, 3))[photo]
    found = exposure_gains(place, photo, rgb, PHOTOS)
    np.testing.assert_allclose((rgb * found[photo]).mean(axis=0), rgb.mean(axis=0), rtol=2e-3)


def test_clipped_colours_say_nothing():
    place, photo, rgb = flight(np.random.default_rng(3))
    clipped = np.random.default_rng(4).random(len(rgb)) < 0.2
    found = exposure_gains(place, photo, np.where(clipped[:, None], 255.0, rgb), PHOTOS)
    np.testing.assert_allclose(found, 1, atol=0.02)


@pytest.mark.parametrize("level", [0.0, 255.0])
def test_a_photo_without_a_usable_sight_keeps_its_exposure(level):
    place, photo, rgb = flight(np.random.default_rng(5))
    rgb[photo == 3] = level
    assert (exposure_gains(place, photo, rgb, PHOTOS + 1)[[3, PHOTOS]] == 1).all()
    assert (exposure_gains(place[:0], photo[:0], rgb[:0], 2) == 1).all()


def test_a_round_solves_its_least_squares():
    """The same log gains come from the problem itself, with the places' colours among the unknowns."""
    rng = np.random.default_rng(7)
    place, photo, rgb = flight(rng)
    value, weight = np.log(rgb[:, 0]), rng.uniform(0.2, 1, len(rgb))
    pull = exposure.PULL * np.bincount(photo, weight, PHOTOS).mean()
    rows = np.zeros((len(rgb), PHOTOS + PLACES))
    rows[np.arange(len(rgb)), photo], rows[np.arange(len(rgb)), PHOTOS + place] = 1, -1
    design = np.concatenate([rows * np.sqrt(weight)[:, None], np.sqrt(pull) * np.eye(PHOTOS, PHOTOS + PLACES)])
    right = np.concatenate([-np.sqrt(weight) * value, np.zeros(PHOTOS)])
    truth = np.linalg.solve(design.T @ design, design.T @ right)[:PHOTOS]
    np.testing.assert_allclose(exposure._solve(place, photo, value, weight, PHOTOS), truth, atol=1e-8)


def test_thousands_of_photos_take_no_table_of_all_pairs():
    photos = 2000
    place = np.repeat(np.arange(3 * photos), 2)
    photo = np.minimum(place // 3 + np.tile([0, 1], 3 * photos), photos - 1)
    rgb = np.random.default_rng(8).uniform(40, 180, (len(place), 3))
    tracemalloc.start()
    exposure_gains(place, photo, rgb, photos)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * photos**2 / 2
