import numpy as np
import pytest

from aug3d_core.town.generator.season import in_season

LAWN, ASPHALT, SOIL = (97, 112, 61), (102, 102, 104), (92, 71, 54)


def patch(colour):
    return np.broadcast_to(np.array(colour, np.uint8), (4, 5, 3)).copy()


def test_summer_is_as_it_was_painted():
    assert in_season(patch(LAWN), "summer") is not None
    assert np.array_equal(in_season(patch(LAWN), "summer"), patch(LAWN))


@pytest.mark.parametrize("season", ["dry", "autumn", "winter"])
def test_what_grows_changes_and_streets_do_not(season):
    assert np.abs(in_season(patch(LAWN), season, ground=True).astype(int) - LAWN).max() > 15
    assert np.abs(in_season(patch(ASPHALT), season, ground=True).astype(int) - ASPHALT).max() <= 3


def test_snow_lies_on_the_ground_alone():
    assert in_season(patch(SOIL), "winter", ground=True).mean() > 1.5 * np.mean(SOIL)
    assert np.abs(in_season(patch(SOIL), "winter").astype(int) - SOIL).max() <= 3
