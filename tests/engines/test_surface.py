import numpy as np
import pytest
from aug3d_core.geometry.transforms import apply, look_at
from aug3d_core.surface.evidence import Evidence
from aug3d_core.surface.poisson import octree_depth, reconstruct, simplify
from aug3d_core.surface.raycast import Raycaster, pixel_rays

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
