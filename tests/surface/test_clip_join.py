"""Cutting a mesh into tiles and joining them: what was one surface is one surface again."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aug3d_core.geometry.ground_tiles import EVERYWHERE, Halved, Planned, Tile
from aug3d_core.surface.clip import clip_to
from aug3d_core.surface.join import join, rim_edges
from aug3d_core.surface.shape import Shape, edges, triangle_areas
from tests.surface.test_shape import border, patch


def halved(axis: int, at: float, ground: Tile = EVERYWHERE) -> Halved:
    below, above = ground.halves(axis, at)
    return Halved(ground, axis, at, Planned(below, 1.0), Planned(above, 1.0))


def euler(shape: Shape) -> int:
    return len(shape.xyz) - len(edges(shape)) + len(shape.triangles)


def quarters(shapes: list[Shape], reach: float) -> Shape:
    """Cut one mesh for each quarter of the ground about (3.3, 5.7), and join them: below, above in y; then in x."""
    whole = halved(0, 3.3)
    sides = []
    for ground, pair in zip((whole.below.ground, whole.above.ground), (shapes[:2], shapes[2:]), strict=True):
        cut = halved(1, 5.7, ground)
        parts = [clip_to(shape, half.ground) for shape, half in zip(pair, (cut.below, cut.above), strict=True)]
        sides.append(join(*parts, cut, reach))
    return join(*sides, whole, reach)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), axis=st.integers(0, 1), at=st.floats(0.5, 6.5))
def test_parts_keep_to_their_side_and_are_the_whole_together(seed, axis, at):
    shape = patch(seed=seed)
    low, high = (clip_to(shape, half) for half in EVERYWHERE.halves(axis, at))
    assert low.xyz[:, axis].max() == high.xyz[:, axis].min() == at
    area = triangle_areas(shape).sum()
    assert np.isclose(triangle_areas(low).sum() + triangle_areas(high).sum(), area)
    for part in (low, high):
        assert euler(part) == 1
        a, b, c = part.xyz[part.triangles.T]
        assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    joined = join(low, high, halved(axis, at), 0.1)
    assert euler(joined) == 1
    assert not len(rim_edges(joined, halved(axis, at)))
    assert np.isclose(triangle_areas(joined).sum(), area)


def test_a_border_through_corners_makes_no_new_ones():
    shape = patch()
    low, high = (clip_to(shape, half) for half in EVERYWHERE.halves(0, 3.0))
    assert len(low.xyz) + len(high.xyz) == len(shape.xyz) + 12
    joined = join(low, high, halved(0, 3.0), 0.1)
    assert len(joined.xyz) == len(shape.xyz)
    assert len(joined.triangles) == len(shape.triangles)


def test_what_lies_within_the_border_alone_or_beside_it_goes():
    shape = patch()
    assert len(clip_to(shape, Tile((20.0, -np.inf))).triangles) == 0
    wall = Shape(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1.0]]), np.array([[0, 1, 2]], np.int32))
    assert not any(len(clip_to(wall, half).triangles) for half in EVERYWHERE.halves(0, 0.0))


def bent(columns: int, rows: int) -> Shape:
    """A hill of its own triangles over [0, 7] x [0, 11]: corners of two of them are at different places."""
    flat = patch(columns, rows)
    x, y = flat.xyz[:, 0] * 7 / columns, flat.xyz[:, 1] * 11 / rows
    return Shape(np.column_stack([x, y, np.sin(x / 3) + np.cos(y / 4)]), flat.triangles)


@pytest.mark.parametrize("sizes", [((14, 22), (13, 17), (9, 25), (17, 11)), ((14, 22),) * 4])
def test_four_tiles_of_unlike_triangles_have_neither_crack_nor_overlap(sizes):
    joined = quarters([bent(*size) for size in sizes], 0.4)
    assert euler(joined) == 1
    assert border(joined) == len(edges(joined)) * 2 - len(joined.triangles) * 3
    inner = halved(0, 3.3), halved(1, 5.7)
    assert not any(len(rim_edges(joined, one)) for one in inner)
    # Seen from above, all of the ground is covered once
    a, b, c = (joined.xyz[joined.triangles[:, i], :2] for i in range(3))
    seen = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (seen > -1e-9).all()
    assert np.isclose(seen.sum(), 77)


def test_a_small_step_at_the_border_is_closed_and_a_large_one_stays():
    cut = halved(0, 3.3)
    low, high = clip_to(bent(14, 22), cut.below.ground), clip_to(bent(13, 17), cut.above.ground)
    for step, at_the_ends in ((0.2, True), (2.0, False)):
        joined = join(low, Shape(high.xyz + np.array([0, 0, step]), high.triangles), cut, 0.4)
        y = joined.xyz[rim_edges(joined, cut), 1]
        assert (np.minimum(y, 11 - y).max() < 0.2) == at_the_ends


def test_nothing_on_one_side_leaves_the_other_as_it_is():
    cut = halved(0, 3.3)
    low = clip_to(patch(), cut.below.ground)
    none = Shape(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    for joined in (join(low, none, cut, 0.4), join(none, low, cut, 0.4)):
        np.testing.assert_array_equal(joined.xyz[joined.triangles], low.xyz[low.triangles])
    assert not len(join(none, none, cut, 0.4).triangles)
