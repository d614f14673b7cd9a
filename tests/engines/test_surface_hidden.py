"""The surface beside a house that hides the ground at its wall: level up to the wall, not a ramp from the eaves."""

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.geometry.fused import Fused
from aug3d_core.geometry.raycast import Raycaster
from aug3d_core.geometry.views import Views
from aug3d_core.surface.clock import Clock
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.draw import draw
from tests.surface.test_hidden import EAST, HOUSE, WEST, lit, net

CONFIG = SurfaceConfig(max_error_gsd=0.1)


@pytest.fixture
def fused(tmp_path) -> Path:
    points = net(lit)
    grey, seen_by = np.full(points.xyz.shape, 90, np.uint8), np.full(len(points.xyz), 3, np.uint8)
    path = tmp_path / "fused.npz"
    Fused(points.xyz.astype(np.float32), points.normals.astype(np.float32), grey, seen_by).save(path)
    return path


def heights(fused: Path, views: Views, most: int) -> np.ndarray:
    """The surface's heights from above, along three lines from the wall at x = 40 to the end of its strip."""
    drawn = draw(fused, views, np.arange(len(views)), CONFIG, Clock(), most=most, at_once=1)
    caster = Raycaster(drawn.shape.xyz, drawn.shape.triangles)
    down = np.array([[0.0, 0.0, -1.0]], np.float32)
    eyes = np.array([[[x, y, 50.0] for x in np.arange(41.0, 45.5, 0.5)] for y in (26.0, 30.0, 34.0)], np.float32)
    return np.array([[50 - float(caster.cast(eye, down).distance[0]) for eye in line] for line in eyes])


@pytest.mark.parametrize("most", [100_000, 8_000])
def test_the_ground_before_a_wall_is_level_where_the_house_hides_it(fused, most):
    level, ramp = heights(fused, WEST, most), heights(fused, EAST, most)
    assert np.abs(level).max() < 0.1 * HOUSE
    # Photographs that see the strip would have given it points: what is there is not known to be ground
    assert ramp[:, 0].min() > 0.5 * HOUSE
