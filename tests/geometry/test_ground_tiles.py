"""Ground in tiles: every sample lies in one of them."""

import numpy as np

from aug3d_core.geometry.ground_tiles import EVERYWHERE, Tile, halve, leaves


def test_halves_and_growing():
    low, high = Tile((0, -1), (4, 3)).halves(1, 2.0)
    assert (low, high) == (Tile((0, -1), (4, 2)), Tile((0, 2), (4, 3)))
    assert low.grown(1) == Tile((-1, -2), (5, 3))
    assert EVERYWHERE.grown(-3) == EVERYWHERE


def test_every_sample_lies_in_one_tile_that_stands_for_no_more_than_asked():
    xy = np.random.default_rng(0).random((640, 2)) * [90, 40]
    tiles = [*leaves(halve(xy, 10, 900))]
    inside = np.stack([tile.ground.holds(np.column_stack([xy, xy[:, 0]])) for tile in tiles])
    assert (inside.sum(axis=0) == 1).all()
    assert (10 * inside.sum(axis=1) <= 900).all()
    assert len(tiles) == 8


def test_ground_without_samples_is_one_tile():
    assert [tile.ground for tile in leaves(halve(np.zeros((0, 2)), 5, 1))] == [EVERYWHERE]
