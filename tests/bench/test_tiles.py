"""What `aug3d bench tiles` says of borders is true of small meshes."""

import numpy as np

from aug3d_core.bench.borders import halvings, near_border
from aug3d_core.bench.tiles import open_share
from aug3d_core.geometry.ground_tiles import EVERYWHERE, Halved, Planned
from aug3d_core.surface.clip import clip_to
from aug3d_core.surface.join import join
from aug3d_core.surface.shape import Shape
from tests.surface.test_shape import patch


def quartered() -> Halved:
    """Ground halved at x = 3.3, and its left part at y = 5.7."""
    left, right = EVERYWHERE.halves(0, 3.3)
    front, back = left.halves(1, 5.7)
    inner = Halved(left, 1, 5.7, Planned(front, 1.0), Planned(back, 1.0))
    return Halved(EVERYWHERE, 0, 3.3, inner, Planned(right, 1.0))


def test_points_are_near_a_border_only_where_it_goes():
    xyz = np.array([[3.2, 100, 5], [3.5, 100, 5], [1, 5.6, 5], [5, 5.6, 5]], float)
    assert near_border(xyz, quartered(), 0.15).tolist() == [True, False, True, False]
    assert len([*halvings(quartered())]) == 2


def test_of_a_border_that_is_joined_nothing_is_open_and_else_all():
    whole = quartered()
    cut = Halved(EVERYWHERE, 0, 3.3, Planned(whole.below.ground, 1.0), whole.above)
    low, high = clip_to(patch(), cut.below.ground), clip_to(patch(), cut.above.ground)
    assert open_share(join(low, high, cut, 0.1), cut) == 0
    apart = join(low, Shape(high.xyz + np.array([0, 0, 9.0]), high.triangles), cut, 0.1)
    assert np.isclose(open_share(apart, cut), 1)
