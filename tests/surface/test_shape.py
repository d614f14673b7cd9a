import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aug3d_core.surface.shape import (
    Shape,
    drop_degenerate,
    drop_small_pieces,
    edges,
    split_to,
    triangle_areas,
    triangle_neighbours,
    vertex_normals,
)


def patch(columns: int = 7, rows: int = 11, seed: int = 0) -> Shape:
    """A bumpy sheet over [0, columns] x [0, rows]; counter-clockwise seen from above."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    xyz = np.stack([x, y, rng.normal(0, 0.3, x.shape)], -1).reshape(-1, 3)
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    return Shape(xyz, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32))


def border(shape: Shape) -> int:
    """Count edges that belong to one triangle only."""
    t = shape.triangles
    directed = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    counts = np.unique(directed, axis=0, return_counts=True)[1]
    assert counts.max() <= 2
    return int((counts == 1).sum())


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), spacing=st.floats(0.2, 2.0))
def test_splitting_keeps_area_winding_and_leaves_no_cracks(seed, spacing):
    shape = patch(seed=seed)
    split = split_to(shape, spacing, 100_000)
    assert np.isclose(triangle_areas(split).sum(), triangle_areas(shape).sum())
    length = np.linalg.norm(np.diff(split.xyz[edges(split)], axis=1), axis=-1)
    assert length.max() <= 1.5 * spacing
    # Euler: a disc stays a disc, so no crack and no double vertex
    assert len(split.xyz) - len(edges(split)) + len(split.triangles) == 1
    assert border(split) >= border(shape)
    a, b, c = split.xyz[split.triangles.T]
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_splitting_stops_at_the_budget():
    assert len(split_to(patch(), 0.01, 500).xyz) == 500
    assert len(split_to(patch(), 0.01, 5).xyz) == len(patch().xyz)


def test_normals_of_a_flat_sheet_point_up():
    sheet = patch()
    flat = Shape(sheet.xyz * (1, 1, 0), sheet.triangles)
    np.testing.assert_allclose(vertex_normals(flat), np.tile([0, 0, 1.0], (len(flat.xyz), 1)))


def test_crumbs_are_dropped_and_the_largest_piece_stays():
    big, small = patch(), patch(1, 1)
    both = Shape(
        np.concatenate([big.xyz, small.xyz + 100]), np.concatenate([big.triangles, small.triangles + len(big.xyz)])
    )
    worth = np.ones(len(both.xyz))
    kept = drop_small_pieces(both, worth, len(small.xyz) + 1)
    np.testing.assert_array_equal(kept.xyz, big.xyz)
    np.testing.assert_array_equal(kept.triangles, big.triangles)
    assert len(drop_small_pieces(both, worth, 1e9).triangles) == len(big.triangles)
    assert len(drop_small_pieces(both, worth, len(small.xyz)).triangles) == len(both.triangles)


def test_neighbours_share_an_edge_and_every_inner_edge_makes_a_pair():
    shape = patch()
    pairs = triangle_neighbours(shape)
    shared = [len(set(shape.triangles[a]) & set(shape.triangles[b])) for a, b in pairs]
    assert set(shared) == {2}
    assert len(pairs) == len(edges(shape)) - border(shape)


def test_keep_uses_only_what_it_needs():
    shape = patch()
    first = np.arange(len(shape.triangles)) == 0
    kept = shape.keep(first)
    np.testing.assert_array_equal(kept.xyz[kept.triangles[0]], shape.xyz[shape.triangles[0]])
    assert kept.xyz.shape == (3, 3)


def test_triangles_without_area_go():
    shape = Shape(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 1, 3]], np.int32))
    assert len(drop_degenerate(shape).triangles) == 1
