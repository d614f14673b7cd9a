from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.ground_tiles import EVERYWHERE, leaves
from aug3d_core.geometry.stored_points import IndexedPoints, StoredPoints
from aug3d_core.surface.tiles import plan_tiles


def scattered(count: int = 7000, long: float = 110.0) -> np.ndarray:
    """Points over a long strip of ground, far denser at one end."""
    rng = np.random.default_rng(0)
    return np.column_stack([long * rng.random(count) ** 2, 70 * rng.random(count), rng.random(count)]).astype(
        np.float32
    )


def saved(folder: Path, xyz: np.ndarray) -> StoredPoints:
    n = len(xyz)
    fused = Fused(
        xyz, np.tile(np.float32([0, 0, 1]), (n, 1)), np.zeros((n, 3), np.uint8), np.arange(n).astype(np.uint8)
    )
    fused.save(folder / "fused.npz")
    return StoredPoints.open(folder / "fused.npz")


@pytest.mark.parametrize("most", [7000, 3600, 1000, 300])
def test_every_point_lies_in_one_tile_and_all_have_about_as_many(tmp_path, most):
    xyz = scattered()
    tiles = list(leaves(plan_tiles(saved(tmp_path, xyz), most)))
    inside = np.stack([tile.ground.holds(xyz) for tile in tiles])
    assert (inside.sum(axis=0) == 1).all()
    assert len(tiles) == 2 ** np.ceil(np.log2(len(xyz) / most))
    counts = inside.sum(axis=1)
    assert counts.max() <= most
    assert counts.min() > 0.95 * counts.max()


def test_ground_is_halved_across_its_longer_side_wherever_strays_lie(tmp_path):
    xyz = scattered()
    xyz[0, 1], xyz[1] = 1e5, np.nan
    plan = plan_tiles(saved(tmp_path, xyz), 3600)
    assert plan.axis == 0
    assert EVERYWHERE.holds(xyz).sum() == len(xyz) - 1


def test_a_tile_is_read_with_what_lies_in_its_margin_and_nothing_else(tmp_path):
    xyz = scattered()
    stored = saved(tmp_path, xyz)
    tile = list(leaves(plan_tiles(stored, 1000)))[3]
    points = IndexedPoints.of(stored).over(tile.ground.grown(5.0))
    low, high = np.array(tile.ground.low) - 5, np.array(tile.ground.high) + 5
    wanted = ((xyz[:, :2] >= low) & (xyz[:, :2] < high)).all(axis=1)
    np.testing.assert_array_equal(points.xyz, xyz[wanted])
    np.testing.assert_array_equal(points.views, np.arange(len(xyz)).astype(np.uint8)[wanted])
    assert wanted.sum() > tile.ground.holds(xyz).sum()


def test_the_spacing_is_about_that_of_a_net(tmp_path):
    x, y = np.meshgrid(np.arange(120) * 0.5, np.arange(80) * 0.5)
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]).astype(np.float32)
    tiles = list(leaves(plan_tiles(saved(tmp_path, xyz), 2500)))
    np.testing.assert_allclose([tile.spacing for tile in tiles], 0.5, rtol=0.05)


def test_points_that_no_border_parts_stay_together(tmp_path):
    xyz = np.tile(np.float32([1, 2, 3]), (50, 1))
    assert len(list(leaves(plan_tiles(saved(tmp_path, xyz), 10)))) == 1
