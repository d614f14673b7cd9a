import numpy as np

from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.shape import Shape, triangle_areas
from aug3d_core.surface.trim import bridged, trim


def sheet(side: int = 60, height: float = 0.0) -> Shape:
    """A level sheet of unit squares over [0, side]^2."""
    x, y = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    b, c, d = a + 1, a + side + 2, a + side + 1
    xyz = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
    return Shape(xyz, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32))


def points(low: float, high: float, hole: float = 0.0, height: float = 0.0) -> Evidence:
    """A net of spacing 1 over a square, without a round hole about (30, 30)."""
    x, y = np.meshgrid(*2 * [np.arange(low, high + 0.1)])
    xyz = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
    xyz = xyz[np.linalg.norm(xyz[:, :2] - 30, axis=1) >= hole]
    return Evidence(xyz, np.tile([0.0, 0.0, 1.0], (len(xyz), 1)), 1.0)


def middle(shape: Shape) -> bool:
    """Tell whether there is surface at (30, 30)."""
    centre = shape.xyz[shape.triangles].mean(axis=1)[:, :2]
    return bool((np.linalg.norm(centre - 30, axis=1) < 1.0).any())


def test_what_bridges_a_gap_is_counted():
    net = points(0, 60, hole=12)
    area = triangle_areas(sheet())[bridged(sheet(), net)].sum()
    assert 9**2 < area / np.pi < 12**2
    assert not bridged(sheet(), points(0, 60)).any()


def test_a_small_hole_is_closed_and_a_wide_one_stays():
    assert middle(trim(sheet(), points(0, 60, hole=3.5), 8.0, 0))
    wide = trim(sheet(), points(0, 60, hole=12), 8.0, 0)
    assert not middle(wide)
    assert 60**2 - np.pi * 12**2 < triangle_areas(wide).sum() < 60**2 - np.pi * 9**2


def test_a_long_hole_is_judged_by_its_width():
    net = points(0, 60)
    for half, closed in ((3.0, True), (8.0, False)):
        slit = (np.abs(net.xyz[:, 0] - 30) < half) & (np.abs(net.xyz[:, 1] - 30) < 25)
        assert middle(trim(sheet(), Evidence(net.xyz[~slit], net.normals[~slit], 1.0), 8.0, 0)) == closed


def test_nothing_grows_beyond_the_points():
    kept = trim(sheet(), points(20, 40), 8.0, 0)
    assert kept.xyz[:, :2].min() >= 18
    assert kept.xyz[:, :2].max() <= 42


def test_floaters_go_and_a_roof_that_hangs_free_stays():
    ground, roof, crumb = sheet(), sheet(25, 6.0), sheet(4, 15.0)
    first = np.cumsum([0, len(ground.xyz), len(roof.xyz)])
    parts = (ground, roof, crumb)
    all_three = Shape(
        np.concatenate([s.xyz for s in parts]),
        np.concatenate([s.triangles + n for s, n in zip(parts, first, strict=True)]).astype(np.int32),
    )
    nets = [points(0, 60), points(0, 25, height=6.0), points(0, 4, height=15.0)]
    evidence = Evidence(*(np.concatenate([getattr(n, f) for n in nets]) for f in ("xyz", "normals")), 1.0)
    assert set(trim(all_three, evidence, 8.0, 400).xyz[:, 2]) == {0.0, 6.0}


def test_where_there_is_no_point_there_is_nothing():
    assert len(trim(sheet(), points(200, 240), 8.0, 0).triangles) == 0


def test_a_bubble_about_a_few_points_goes_however_large_it_is():
    ground, bubble = sheet(), sheet(30, 9.0)
    both = Shape(
        np.concatenate([ground.xyz, bubble.xyz]), np.concatenate([ground.triangles, bubble.triangles + len(ground.xyz)])
    )
    stray = np.array([[x, y, 9.0] for x in (2, 6, 10, 14) for y in (2, 6, 10, 14)])
    net = points(0, 60)
    evidence = Evidence(np.concatenate([net.xyz, stray]), np.tile([0.0, 0.0, 1.0], (len(net.xyz) + 16, 1)), 1.0)
    assert set(trim(both, evidence, 8.0, 0).xyz[:, 2]) == {0.0, 9.0}
    assert set(trim(both, evidence, 8.0, 100).xyz[:, 2]) == {0.0}
