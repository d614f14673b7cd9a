from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from aug3d_core.errors import InputError
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import apply, look_at
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.store import layout
from aug3d_core.surface.config import SurfaceConfig
from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.poisson import octree_depth, reconstruct, simplify
from aug3d_core.surface.raycast import Raycaster, pixel_rays
from aug3d_core.surface.stage import run

WIDTH, HEIGHT = 7, 11
INTRINSICS = np.array([8.0, 9.0, 3.1, 5.7])


def ground(size: float = 100.0, height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles that make a level square about the origin."""
    xy = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]) * size
    return np.column_stack([xy, np.full(4, height)]), np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def colours(xyz: np.ndarray, size: float = 100.0) -> np.ndarray:
    """Red grows with x, green with y: linear, so that interpolation is exact."""
    return np.column_stack([(xyz[:, :2] / size + 1) * 100, np.full(len(xyz), 50)]).round().astype(np.uint8)


@pytest.mark.parametrize("far", [0.0, 5.0e5])
def test_render_of_the_ground_is_exact(far):
    xyz, triangles = ground()
    rgb = colours(xyz)
    camera = look_at(np.array([3.0, -20.0, 30.0]), np.array([1.0, 2.0, 0.0]))
    moved = camera.copy()
    moved[:, 3] -= camera[:, :3] @ np.array([far, -far, far])
    shift = np.array([far, -far, far])
    render = Raycaster(xyz + shift, triangles).render(rgb, moved, INTRINSICS, np.array([WIDTH, HEIGHT]))
    assert render.rgb.shape == (HEIGHT, WIDTH, 3)
    # Truth by intersecting each pixel's ray with z = 0
    origin, directions = pixel_rays(camera, INTRINSICS, np.array([WIDTH, HEIGHT]))
    depth = -origin[2] / directions[..., 2]
    truth = origin + depth[..., None] * directions
    assert (render.alpha == 255).all()
    np.testing.assert_allclose(render.depth, depth, rtol=1e-4 if far else 1e-5)
    np.testing.assert_allclose(render.rgb, colours(truth.reshape(-1, 3)).reshape(render.rgb.shape), atol=1)


def test_pixel_rays_go_through_pixel_centres_with_unit_depth():
    camera = look_at(np.array([3.0, -20.0, 30.0]), np.array([1.0, 2.0, 0.0]))
    origin, directions = pixel_rays(camera, INTRINSICS, np.array([WIDTH, HEIGHT]))
    in_cam = apply(camera, (origin + 4.2 * directions).reshape(-1, 3)).reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(in_cam[..., 2], 4.2)
    pixels = in_cam[..., :2] / in_cam[..., 2:] * INTRINSICS[:2] + INTRINSICS[2:]
    np.testing.assert_allclose(pixels[10, 6], [6.5, 10.5])
    np.testing.assert_allclose(pixels[0, 0], [0.5, 0.5])


def test_nothing_is_hit_beside_the_mesh():
    xyz, triangles = ground(1.0)
    camera = look_at(np.array([0.0, 0.0, 50.0]), np.array([0.0, 40.0, 0.0]))
    render = Raycaster(xyz, triangles).render(colours(xyz, 1.0), camera, INTRINSICS, np.array([WIDTH, HEIGHT]))
    assert not render.alpha.all()
    assert not render.depth[render.alpha == 0].any()
    assert not render.rgb[render.alpha == 0].any()


def test_a_roof_hides_the_ground_under_it():
    low, triangles = ground(10.0)
    roof, _ = ground(2.0, height=5.0)
    caster = Raycaster(np.concatenate([low, roof]), np.concatenate([triangles, triangles + 4]))
    points = np.array([[0.0, 0.0, 0.1], [9.0, 9.0, 0.1]])
    assert caster.occluded(points, np.array([0.0, 0.0, 50.0]) - points, 0.0, 1.0).tolist() == [True, False]
    np.testing.assert_allclose(caster.distance(np.array([[0.0, 0.0, 8.0], [9.0, 9.0, 4.0]])), [3.0, 4.0], rtol=1e-5)
    hits = caster.cast(np.array([[0.0, 0.0, 9.0], [9.0, 9.0, 9.0]]), np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(hits.distance, [4.0, 9.0], rtol=1e-5)


def sphere(count: int = 2000) -> Evidence:
    direction = np.random.default_rng(0).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return Evidence(5 * direction + (100, 200, 300), direction, 0.3)


def test_poisson_finds_a_sphere_and_repeats_its_bytes():
    shape = reconstruct(sphere())
    radius = np.linalg.norm(shape.xyz - (100, 200, 300), axis=1)
    np.testing.assert_allclose(radius, 5, atol=0.1)
    again = reconstruct(sphere())
    np.testing.assert_array_equal(shape.xyz, again.xyz)
    np.testing.assert_array_equal(shape.triangles, again.triangles)
    assert octree_depth(sphere()) == 6  # 11 units in cells of at most 0.3
    assert len(simplify(shape, 500).triangles) <= 500


def hills(count: int = 161, half: float = 40.0) -> Mesh:
    """A hilly square with soft colours of its own."""
    x, y = np.meshgrid(np.linspace(-half, half, count), np.linspace(-half, half, count))
    z = 2 * np.sin(x / 9) * np.cos(y / 7)
    waves = [np.sin(x / 5 + y / 11), np.cos(y / 4 - x / 13), np.sin((x - y) / 6)]
    rgb = np.stack([128 + 90 * wave for wave in waves], -1).round().astype(np.uint8)
    a = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    b, c, d = a + 1, a + count + 1, a + count
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    return Mesh(np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32), rgb.reshape(-1, 3), triangles)


@pytest.fixture(scope="module")
def flight(tmp_path_factory) -> tuple[Path, Path]:
    """The folders of sfm and grouping after a flight over the hills with perfect matching; photo 4 is the target."""
    sfm, grouping = tmp_path_factory.mktemp("sfm"), tmp_path_factory.mktemp("grouping")
    truth = hills()
    caster = Raycaster(truth.xyz, truth.triangles)
    places = [(x, y) for y in (-15.0, 0.0, 15.0) for x in (-15.0, -5.0, 5.0, 15.0)]
    poses = np.stack([look_at(np.array([x, y, 40.0]), np.array([x, y + 1e-3, 0.0])) for x, y in places])
    n = len(poses)
    views = Views(np.arange(n), poses, np.tile([90.0, 90.0, 50.0, 37.0], (n, 1)), np.tile([101, 75], (n, 1)))
    (sfm / layout.VIEW_IMAGES).mkdir()
    for i in range(n):
        photo = caster.render(truth.rgb, poses[i], views.intrinsics[i], views.size[i]).rgb
        Image.fromarray(photo).save(sfm / layout.VIEW_IMAGES / layout.image_name(i))
    chosen = np.random.default_rng(0).choice(len(truth.xyz), 4000, replace=False)
    in_cam = apply(poses, np.broadcast_to(truth.xyz[chosen].astype(float), (n, 4000, 3)))
    xy = in_cam[..., :2] / in_cam[..., 2:] * views.intrinsics[:, None, :2] + views.intrinsics[:, None, 2:]
    view, point = np.nonzero(((xy > 0) & (xy < (101, 75))).all(axis=-1))
    views.save(sfm / layout.VIEWS)
    Points(truth.xyz[chosen].astype(float), truth.rgb[chosen], np.full(4000, 0.3)).save(sfm / layout.POINTS)
    Tracks(point, view, xy[view, point]).save(sfm / layout.TRACKS)
    role = np.full(n, "train", object)
    role[[4]], role[[5, 8]] = "target", "support"
    pd.DataFrame({"view": np.arange(n), "photo_id": np.arange(n), "role": role}).to_parquet(
        grouping / layout.SPLIT_TABLE
    )
    return sfm, grouping


def build_surface(flight: tuple[Path, Path], out: Path, **settings):
    out.mkdir(exist_ok=True)
    inputs = {"sfm": flight[0], "grouping": flight[1]}
    return run(inputs, SurfaceConfig(vertex_budget=20_000, **settings), out, lambda done, total, what: None)


def test_the_mesh_lies_on_the_hills_and_looks_like_the_photos(flight, tmp_path):
    outcome = build_surface(flight, tmp_path)
    truth = hills()
    caster = Raycaster(truth.xyz, truth.triangles)
    for name in (layout.MESH, layout.BASELINE_MESH):
        xyz = Mesh.load(tmp_path / name).xyz.astype(float)
        seen_twice = (np.abs(xyz[:, :2]) < 25).all(axis=1)  # around it the ground only goes on
        assert np.percentile(caster.distance(xyz[seen_twice]), 95) < 0.3  # under a pixel of the photos
    assert outcome.metrics["render_psnr"] > 28
    assert outcome.metrics["target_render_psnr"] > 26
    assert outcome.metrics["covered_share"] > 0.9
    assert outcome.state == "ok"
    with Image.open(tmp_path / layout.BASELINE_RENDERS / layout.image_name(4)) as render:
        assert render.size == (101, 75)
        assert render.mode == "RGBA"
    assert all((tmp_path / path).is_file() for path in outcome.pictures.values())


def test_the_same_input_gives_the_same_bytes(flight, tmp_path):
    build_surface(flight, tmp_path / "a")
    build_surface(flight, tmp_path / "b")
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) >= 5
    assert all((tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes() for f in files)


def test_no_pixel_of_a_held_out_photo_reaches_the_mesh_of_train_photos(flight, tmp_path):
    build_surface(flight, tmp_path / "a")
    black = tmp_path / "sfm"
    black.mkdir()
    for name in (layout.VIEWS, layout.POINTS, layout.TRACKS):
        (black / name).write_bytes((flight[0] / name).read_bytes())
    (black / layout.VIEW_IMAGES).mkdir()
    for photo in (flight[0] / layout.VIEW_IMAGES).iterdir():
        with Image.open(photo) as image:
            hidden = photo.name in {layout.image_name(i) for i in (4, 5, 8)}
            (Image.new("RGB", image.size) if hidden else image).save(black / layout.VIEW_IMAGES / photo.name)
    build_surface((black, flight[1]), tmp_path / "b")
    assert (tmp_path / "a" / layout.MESH).read_bytes() == (tmp_path / "b" / layout.MESH).read_bytes()
    assert (tmp_path / "a" / layout.BASELINE_MESH).read_bytes() != (tmp_path / "b" / layout.BASELINE_MESH).read_bytes()


def test_too_few_good_points_is_an_error_that_says_so(flight, tmp_path):
    with pytest.raises(InputError, match="fewer than 100 good points"):
        build_surface(flight, tmp_path, max_error_px=0.1)
