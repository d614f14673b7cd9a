from pathlib import Path

import numpy as np
from PIL import Image

from aug3d_core.geometry.masks import save_mask
from aug3d_core.geometry.transforms import apply, look_at, project
from aug3d_core.geometry.views import Tracks, Views
from aug3d_core.photos.files import image_name
from aug3d_core.surface.colour import Colours, Photographs, Places, Spots, ground_sampling, paint_vertices
from aug3d_core.surface.shape import Shape, split_to

RED, BLUE = (250, 10, 10), (10, 10, 250)


def square(half: float, height: float) -> Shape:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]) * half
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return split_to(Shape(np.column_stack([corners, np.full(4, height)]), triangles), 0.5, 10_000)


def photos(folder: Path, heights: tuple[float, ...], colours: tuple[tuple[int, int, int], ...]) -> Views:
    """Photos of one colour each, from straight above at these heights, each wide enough to see all."""
    for i, colour in enumerate(colours):
        Image.new("RGB", (81, 61), colour).save(folder / image_name(i))
    poses = np.stack([look_at(np.array([0.0, 0.0, h]), np.zeros(3)) for h in heights])
    n = len(heights)
    return Views(np.arange(n), poses, np.tile([20.0, 20.0, 40.5, 30.5], (n, 1)), np.tile([81, 61], (n, 1)))


def painted(shape: Shape, views: Views, folder: Path, best: int = 1) -> Colours:
    photographs = Photographs(views, np.arange(len(views)), folder, folder / "masks", shape, 0.5)
    return paint_vertices(photographs, shape, best, lambda: None)


def test_the_photo_that_sees_sharpest_wins_in_any_order(tmp_path):
    for heights, colours in (((20.0, 10.0), (RED, BLUE)), ((10.0, 20.0), (BLUE, RED))):
        views = photos(tmp_path, heights, colours)
        assert (painted(square(2, 0.0), views, tmp_path).rgb == BLUE).all()
        blended = painted(square(2, 0.0), views, tmp_path, best=2).rgb
        assert (blended[:, 2] > 230).all()  # a quarter of the score, to the fourth power, hardly counts


def test_ground_under_a_roof_takes_no_colour_from_the_roof(tmp_path):
    low, roof = square(10, 0.0), square(4, 5.0)
    both = Shape(np.concatenate([low.xyz, roof.xyz]), np.concatenate([low.triangles, roof.triangles + len(low.xyz)]))
    colours = painted(both, photos(tmp_path, (12.0,), (RED,)), tmp_path)
    middle = np.abs(both.xyz[:, :2]).max(axis=1) < 0.3
    on_roof = both.xyz[:, 2] > 1
    assert colours.known[on_roof].all()
    assert not colours.known[middle & ~on_roof].any()  # too far from daylight for colour to creep in
    assert colours.known[np.abs(both.xyz[:, :2]).max(axis=1) > 8].all()


def test_what_faces_away_or_lies_outside_is_unknown(tmp_path):
    sheet = square(2, 0.0)
    views = photos(tmp_path, (12.0,), (RED,))
    assert not painted(Shape(sheet.xyz, sheet.triangles[:, ::-1]), views, tmp_path).known.any()
    assert not painted(Shape(sheet.xyz + np.array([500.0, 0, 0]), sheet.triangles), views, tmp_path).known.any()


def test_what_is_masked_in_the_best_photo_is_taken_from_the_next(tmp_path):
    """Not a hue of it comes along, though a sample is the mean of many pixels and lies between them."""
    views = photos(tmp_path, (20.0, 10.0), (BLUE, BLUE))
    with Image.open(tmp_path / image_name(1)) as image:
        best = np.array(image)
    car = (slice(20, 37), slice(30, 45))
    best[car] = RED
    Image.fromarray(best).save(tmp_path / image_name(1))
    ground = square(4, 0.0)
    assert (painted(ground, views, tmp_path).rgb == RED).all(axis=1).any(), "or there is nothing to leave out"
    used = np.ones(best.shape[:2], bool)
    used[car] = False
    save_mask(used, tmp_path / "masks" / image_name(1))
    for spots in (1, 2):
        colours = painted(ground, views, tmp_path, best=spots)
        assert colours.known.all()
        assert (colours.rgb == BLUE).all()


def test_what_is_masked_in_every_photo_has_no_colour(tmp_path):
    views = photos(tmp_path, (10.0,), (RED,))
    used = np.ones((61, 81), bool)
    used[:, 41:] = False  # east of the middle
    save_mask(used, tmp_path / "masks" / image_name(0))
    sheet = square(8, 0.0)
    photographs = Photographs(views, np.arange(1), tmp_path, tmp_path / "masks", sheet, 0.5)
    normals = np.tile([0.0, 0, 1], (len(sheet.xyz), 1))
    known = photographs.paint(Places(sheet.xyz, normals), 1, lambda: None, "sheet").known
    assert not known[sheet.xyz[:, 0] > 0.25].any()
    assert known[sheet.xyz[:, 0] < -0.6].all()


def test_masked_points_do_not_count_for_the_exposure(tmp_path):
    """Half of what the second photo shows is a bright lorry."""
    views = photos(tmp_path, (10.0, 10.0), ((60, 60, 60), (120, 120, 120)))
    with Image.open(tmp_path / image_name(1)) as image:
        pixels = np.array(image)
    pixels[:, 30:] = 30
    Image.fromarray(pixels).save(tmp_path / image_name(1))
    used = np.ones(pixels.shape[:2], bool)
    used[:, 30:] = False
    save_mask(used, tmp_path / "masks" / image_name(1))
    count = 40
    x = np.linspace(5, 75, count)
    tracks = Tracks(
        np.repeat(np.arange(count), 2),
        np.tile([0, 1], count),
        np.repeat(np.stack([x, np.full(count, 30)], 1), 2, axis=0),
    )
    photographs = Photographs(views, np.arange(2), tmp_path, tmp_path / "masks", square(2, 0.0), 0.5)
    photographs.even_out(tracks)
    np.testing.assert_allclose(photographs.gains[0] / photographs.gains[1], 2, rtol=0.02)


def looking(*sights: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Views:
    """Views of 100 x 80 px, each from a centre to a target."""
    poses = np.stack([look_at(np.array(centre), np.array(target)) for centre, target in sights])
    n = len(sights)
    return Views(np.arange(n), poses, np.tile([200.0, 200.0, 50.0, 40.0], (n, 1)), np.tile([100, 80], (n, 1)))


DOWN, OBLIQUE = ((0.0, 0.0, 40.0), (0.0, 0.0, 0.0)), ((-50.0, 0.0, 40.0), (-10.0, 0.0, 0.0))
AWAY = ((0.0, 0.0, 40.0), (0.0, 0.0, 80.0))


def test_a_pixels_size_is_that_of_what_the_view_frames_however_large_the_rest_is():
    small, large = square(20, 0.0), square(60, 0.0)
    assert np.isclose(ground_sampling(small, looking(DOWN), [0]), 40 / 200)
    assert np.isclose(ground_sampling(small, looking(OBLIQUE), [0]), np.hypot(40, 40) / 200, rtol=0.1)
    assert np.isclose(
        ground_sampling(large, looking(OBLIQUE), [0]), ground_sampling(small, looking(OBLIQUE), [0]), rtol=0.03
    )


def test_what_frames_nothing_counts_for_nothing():
    assert np.isnan(ground_sampling(square(20, 0.0), looking(AWAY), [0]))
    assert np.isclose(ground_sampling(square(20, 0.0), looking(AWAY, AWAY, DOWN), [0, 1, 2]), 40 / 200)


def test_blocks_that_are_skipped_hold_nothing_that_a_view_frames():
    rng = np.random.default_rng(3)
    xyz = rng.uniform(-60, 60, (20_000, 3))
    xyz = xyz[np.lexsort((xyz[:, 1] // 15, xyz[:, 0] // 15))]
    views = looking(DOWN, OBLIQUE, AWAY, ((0.0, 0.0, 1.0), (5.0, 2.0, 0.0)))
    for view in range(len(views)):
        in_cam = apply(views.cam_from_world[view], xyz)
        xy = project(in_cam, views.intrinsics[view])
        true = np.flatnonzero((in_cam[:, 2] > 0) & ((xy > 1) & (xy < views.size[view] - 1)).all(axis=1))
        framed = Spots(xyz).framed(views, view, 1.0)
        assert 0 < len(true) < len(xyz) / 2
        np.testing.assert_array_equal(framed.spot, true)
        np.testing.assert_allclose(np.stack([framed.x, framed.y], axis=1), xy[true])
        np.testing.assert_allclose(framed.depth, in_cam[true, 2])
