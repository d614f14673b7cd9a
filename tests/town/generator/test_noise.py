import numpy as np

from aug3d_core.town.generator.noise import fractal, per_cell


def test_noise_has_the_asked_shape_zero_mean_and_unit_deviation():
    noise = fractal((701, 1103), [1, 4, 16], np.random.default_rng(0))
    assert noise.shape == (701, 1103)
    assert abs(noise.mean()) < 0.05 and 0.8 < noise.std() < 1.2


def test_lumps_have_the_asked_size():
    noise = fractal((512, 512), [16.0], np.random.default_rng(1))
    near = np.mean(noise[:, 4:] * noise[:, :-4]) / noise.var()
    far = np.mean(noise[:, 40:] * noise[:, :-40]) / noise.var()
    assert near > 0.75 and abs(far) < 0.2


def test_odd_and_tiny_shapes_and_the_same_seed():
    for shape in ((7, 11), (1, 5), (11, 7)):
        a, b = (fractal(shape, [1, 3, 60], np.random.default_rng(2)) for _ in range(2))
        assert a.shape == shape
        np.testing.assert_array_equal(a, b)


def test_a_cell_has_one_value():
    rows, columns = np.array([3, 3, 4]), np.array([5, 5, 5])
    a, b, c = per_cell(rows, columns, np.random.default_rng(3))
    assert a == b != c
