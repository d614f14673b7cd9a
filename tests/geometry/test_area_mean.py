import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from aug3d_core.geometry.area_mean import area_mean

CUTS = st.floats(min_value=0, max_value=3)


def by_primitive(values: np.ndarray, low: float, high: float, count: int) -> np.ndarray:
    """Integrate along the first axis: the primitive of a row of pixels runs straight between their edges."""
    until = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    edges, places = np.linspace(low, high, count + 1), np.arange(len(until))
    columns = [np.interp(edges, places, column) for column in until.reshape(len(until), -1).T]
    return np.diff(np.stack(columns, axis=1), axis=0).reshape(count, *values.shape[1:]) * count / (high - low)


def test_a_ramp_shrunk_by_one_and_a_half_stays_in_its_place():
    """A target pixel covers one source pixel and half of the next or the one before."""
    across, down = np.arange(12), np.arange(9)[:, None]
    ramp = (6 * across + 60 * down).astype(np.float32)
    of_threes = np.array([(0 + 1 / 2) / 1.5, (1 / 2 + 2) / 1.5])
    columns, rows = ((3 * np.arange(count)[:, None] + of_threes).ravel() for count in (4, 3))
    assert area_mean(ramp, (8, 6)) == pytest.approx(6 * columns + 60 * rows[:, None], abs=1e-3)


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 40), st.integers(1, 40), CUTS, CUTS, st.integers(0, 9))
def test_it_is_the_integral_over_each_target_pixel(width, height, wide, high, left, bottom, seed):
    values = np.random.default_rng(seed).uniform(0, 255, (height, width, 2))
    crop = min(left, width / 2), 0.0, float(width), max(height - bottom, height / 2)
    down = by_primitive(values, crop[1], crop[3], high)
    exact = by_primitive(down.swapaxes(0, 1), crop[0], crop[2], wide).swapaxes(0, 1)
    assert area_mean(values, (wide, high), crop) == pytest.approx(exact, abs=1e-3)


@given(st.integers(1, 60), st.integers(1, 60), st.integers(1, 60), st.integers(1, 60), st.integers(0, 255))
def test_what_is_the_same_everywhere_stays(width, height, wide, high, grey):
    found = area_mean(np.full((height, width, 3), grey, np.uint8), (wide, high))
    assert found.dtype == np.float32 and found == pytest.approx(grey, abs=1e-3)


@pytest.mark.parametrize("ratio", [1, 2, 3, 4, 5])
def test_at_whole_ratios_it_is_pillow_s_box(ratio):
    values = np.random.default_rng(ratio).integers(0, 256, (12 * ratio, 20 * ratio, 3), dtype=np.uint8)
    boxes = [Image.fromarray(one.astype(np.float32)) for one in np.moveaxis(values, -1, 0)]
    box = np.stack([np.asarray(one.resize((20, 12), Image.Resampling.BOX)) for one in boxes], axis=-1)
    assert np.array_equal(np.rint(area_mean(values, (20, 12))), np.rint(box))
