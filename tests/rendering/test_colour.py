import numpy as np

from aug3d_core.rendering.colour import linear_from_srgb, srgb_from_linear


def test_every_level_survives_the_round_trip():
    levels = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(srgb_from_linear(linear_from_srgb(levels)), levels)


def test_known_values_and_clipping():
    np.testing.assert_allclose(linear_from_srgb(np.array([0, 188, 255], np.uint8)), [0.0, 0.5029, 1.0], atol=1e-4)
    np.testing.assert_array_equal(srgb_from_linear(np.array([-1.0, 0.0, 0.214041, 1.0, 7.0])), [0, 0, 127, 255, 255])
