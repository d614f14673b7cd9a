from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.domes.cameras import Plan
from aug3d_core.domes.conditioning import GOOD, REASONS, faults, lacks
from aug3d_core.domes.config import SamplingConfig
from aug3d_core.domes.methods import METHODS
from aug3d_core.domes.methods.grid import cell_centres, choose_scales, choose_step
from aug3d_core.domes.methods.spiral import TURNS, on_run
from aug3d_core.domes.place import dome_over, looked_at
from aug3d_core.domes.site import edge_length, lens_like, photo_sampling
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import invert, look_at
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError
from tests.engines.little_town import CONFIG, SIZE, VIEWS_PER_DOME, config, site_over, town


def planned(mesh: Mesh, config: SamplingConfig = CONFIG, seed: int = 0, method: str = "grid") -> Plan:
    surface, site = site_over(mesh)
    return METHODS[method](surface, site, config, np.random.default_rng(seed))


def test_the_ground_knows_heights_and_holes():
    ground = site_over(town(tower=7.0))[1].ground
    np.testing.assert_allclose(ground.extent, [80, 60], atol=2 * ground.square)
    np.testing.assert_allclose(ground.window(np.zeros(2), 2.0), 7.0, atol=1e-4)
    np.testing.assert_allclose(ground.window(np.array([-20.0, -20.0]), 5.0), 0.0, atol=1e-4)
    assert np.isnan(ground.window(np.array([33.0, 22.0]), 5.0)).all()
    places = np.array([[0.0, 0.0], [-40.0, 0.0], [33.0, 22.0], [20.0, -30.0], [500.0, 500.0]])
    np.testing.assert_allclose(ground.covered_share(places, 10.0), [1, 0.5, 0, 0.5, 0], atol=0.03)
    points = ground.points()
    assert len(points) == ground.covered.sum()
    on_tower = (abs(points[:, :2]) < 2).all(axis=1)
    np.testing.assert_allclose(points[on_tower, 2], 7.0, atol=1e-4)


def test_a_flatter_scene_gets_finer_cells_in_relation_to_its_width():
    site = site_over(town())[1]
    finest = looked_at(site, 0.0)
    for high, scales in [(15, (60, 30)), (4, (32, 16, 8)), (3, (24, 12, 6)), (0, (2 * finest, finest))]:
        np.testing.assert_allclose(choose_scales(replace(site, relief=float(high))), scales, rtol=0.01)
    assert choose_scales(replace(site, relief=40.0)) == (float(site.ground.extent.min()),)


def test_cells_lie_on_the_ground_and_their_number_is_what_was_wanted():
    site = site_over(town())[1]
    for side, wanted in [(20.0, 7), (10.0, 12), (30.0, 1)]:
        step = choose_step(site, CONFIG, side, wanted)
        centres = cell_centres(site.ground, side, step)
        covered = site.ground.covered_share(centres, looked_at(site, side)) >= CONFIG.min_cell_covered
        assert abs(covered.sum() - wanted) <= 2
        low, high = site.ground.low, site.ground.low + site.ground.extent
        assert (centres - side / 2 >= low - 1e-3).all() and (centres + side / 2 <= high + 1e-3).all()


def test_no_cell_is_finer_than_photos_and_mesh():
    surface, site = site_over(town())
    coarse = replace(site, finest_sampling=0.4)
    answer = METHODS["grid"](surface, coarse, config(domes=100), np.random.default_rng(0))
    used = [dome for dome in answer.domes if dome.views]
    assert min(dome.radius for dome in used) / coarse.focal_px >= 0.4 - 1e-9


@pytest.mark.parametrize("method", ["spiral", "dome", "grid"])
def test_domes_stand_on_the_surface_with_equally_many_views_that_see_it(method):
    mesh = town(tower=2.0)
    surface, site = site_over(mesh)
    eased = config(min_cell_covered=0.6, min_view_covered=0.6) if method != "grid" else CONFIG
    answer = planned(mesh, eased, method=method)
    used = [dome for dome in answer.domes if dome.views]
    assert 8 <= len(used) <= CONFIG.domes + 2
    assert np.bincount(answer.cameras.dome_id).tolist() == [VIEWS_PER_DOME] * len(used)
    np.testing.assert_array_equal(answer.cameras.view_id, np.arange(len(answer.cameras)))
    for dome, pose in zip(np.repeat(used, VIEWS_PER_DOME), answer.cameras.world_from_cam, strict=True):
        radius = np.linalg.norm(pose[:3, 3] - (dome.x, dome.y, dome.z))
        assert dome.radius * (1 - 1e-9) <= radius <= dome.radius * (1 + CONFIG.radius_spread) * (1 + 1e-9)
    poses = invert(answer.cameras.world_from_cam[:, :3])
    worst = lacks(surface, poses, site, site.size).max(axis=0)
    assert worst[0] <= 1 - eased.min_view_covered and worst[1] <= eased.max_back_faces and worst[2] == 0
    assert all(dome.tried >= dome.views + sum(dome.rejected.values()) for dome in used)


def test_the_whole_scene_is_seen_from_one_dome_and_cells_from_many():
    assert len({(dome.x, dome.y, dome.cell) for dome in planned(town(), method="dome").domes}) == 1
    assert len({dome.cell for dome in planned(town(tower=3.0)).domes}) >= 2


def test_the_spiral_moves_outwards_evenly_with_its_azimuth():
    ways, inner, outer = (
        on_run(start, end, CONFIG, np.random.default_rng(0), 500) for start, end in [(0, 1), (0, 0.5), (0.5, 1)]
    )
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1)
    nearest, farthest = np.cos(np.radians([CONFIG.max_elevation_deg, CONFIG.min_elevation_deg]))
    part = (np.hypot(ways[:, 0], ways[:, 1]) - nearest) / (farthest - nearest)
    turned = np.arctan2(ways[:, 1], ways[:, 0]) - 2 * np.pi * TURNS * part
    np.testing.assert_allclose(np.cos(turned), 1, atol=1e-9)
    assert part.min() >= -1e-9 and part.max() <= 1 + 1e-9
    assert np.hypot(*inner[:, :2].T).max() <= np.hypot(*outer[:, :2].T).min()


def test_no_camera_is_inside_or_under_or_too_near_a_tower():
    mesh = town(tower=60.0)
    surface, site = site_over(mesh)
    placed = [
        dome_over(surface, site, CONFIG, np.random.default_rng(seed), np.array([7.0, 0.0]), 16.0, "a place")
        for seed in range(8)
    ]
    assert any(cameras.size for _, cameras in placed)
    reasons = {reason for dome, _ in placed for reason, count in dome.rejected.items() if count}
    assert {"too_near", "inside"} <= reasons
    for dome, cameras in placed:
        if len(cameras):
            places = invert(cameras)[:, :, 3]
            assert surface.distance(places).min() >= CONFIG.min_clearance * dome.radius - 1e-6
            assert np.isinf(surface.cast(places, np.array([0.0, 0.0, 1.0])).distance).all()


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """A closed box, wound so that its outside is outside."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.subtract(high, low) + low
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))], np.int32)
    return Mesh(corners.astype(np.float32), np.full((8, 3), 90, np.uint8), triangles)


def joined(*meshes: Mesh) -> Mesh:
    first = np.cumsum([0, *(len(mesh.xyz) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.xyz for mesh in meshes]),
        np.concatenate([mesh.rgb for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, first, strict=False)]).astype(np.int32),
    )


def blackened(mesh: Mesh) -> Mesh:
    return Mesh(mesh.xyz, np.zeros_like(mesh.rgb), mesh.triangles)


def turned_over(mesh: Mesh) -> Mesh:
    return Mesh(mesh.xyz, mesh.rgb, mesh.triangles[:, ::-1].copy())


@pytest.mark.parametrize(
    ("reason", "mesh", "place", "aim"),
    [
        ("inside", joined(town(), box((-9, -9, 0), (9, 9, 30))), (2, 0.1, 15), (0, 0, 0)),
        ("inside", town(), (0, 0.1, -8), (0, 0, -30)),  # under the ground
        ("under", joined(town(), box((-9, -9, 20), (9, 9, 21))), (2, 0.1, 12), (0, 0, 0)),  # a bridge
        ("too_near", joined(town(), box((2, -9, 0), (9, 9, 30))), (0, 0.1, 15), (0, 0, 0)),
        ("aim_hidden", joined(town(), box((-1, -1, 6), (1, 1, 9))), (0, 0.1, 16), (0, 0, 0)),
        ("empty", town(), (33, 22.1, 15), (33, 22, 0)),
        ("back_faces", turned_over(town()), (0, 0.1, 15), (0, 0, 0)),
        ("black", blackened(town()), (0, 0.1, 15), (0, 0, 0)),
        (None, town(), (0, 0.1, 15), (0, 0, 0)),
    ],
)
def test_each_camera_that_is_no_use_is_told_why(reason, mesh, place, aim):
    surface, site = site_over(mesh)
    place, aim = np.array(place, float), np.array(aim, float)
    camera = look_at(place, aim)[None]
    fault = faults(surface, camera, np.array([np.linalg.norm(place - aim)]), site, CONFIG)
    assert (None if fault[0] == GOOD else REASONS[fault[0]]) == reason


def test_the_seed_alone_decides():
    a, b, c = planned(town()), planned(town()), planned(town(), seed=1)
    np.testing.assert_array_equal(a.cameras.world_from_cam, b.cameras.world_from_cam)
    assert not np.allclose(a.cameras.world_from_cam[0], c.cameras.world_from_cam[0])


def test_the_lens_is_that_of_the_photos_cut_to_the_view():
    poses = np.stack([look_at(np.array([x, 1e-3, 20.0]), np.array([x, 0.0, 0.0])) for x in np.linspace(-20, 20, 6)])
    photos = Views(np.arange(6), poses, np.tile([400.0, 400.0, 256.0, 144.0], (6, 1)), np.tile([512, 288], (6, 1)))
    # 288 rows become 72, so that 512 columns become 128, of which 96 stay
    np.testing.assert_allclose(lens_like(photos, SIZE), [100.0, 100.0, 48.0, 36.0])
    assert np.isclose(photo_sampling(photos, town(), SIZE), 0.2)  # 20 above the ground, 100 px
    assert np.isclose(edge_length(town()), 0.5)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 45.0])
def test_a_pixels_size_is_that_of_what_photos_frame_however_wide_the_ground_is(tilt_deg):
    """Against the median depth of the ground that the frame shows, from a fine grid of its own."""
    ahead = 20 * np.tan(np.radians(tilt_deg))
    poses = np.stack([look_at(np.array([x, 0.0, 20.0]), np.array([x, ahead + 1e-3, 0.0])) for x in (-3.0, 0.0, 3.0)])
    photos = Views(np.arange(3), poses, np.tile([400.0, 400.0, 256.0, 144.0], (3, 1)), np.tile([512, 288], (3, 1)))
    x, y = np.meshgrid(np.linspace(-200, 200, 801), np.linspace(-200, 200, 801))
    xyz = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    wide = Mesh(xyz.astype(np.float32), np.zeros(xyz.shape, np.uint8), np.zeros((0, 3), np.int32))
    u, v = np.meshgrid(np.arange(512) + 0.5, np.arange(288) + 0.5)
    down = (np.stack([(u - 256) / 400, (v - 144) / 400, np.ones_like(u)], -1) @ poses[0, :, :3])[..., 2]
    depth = -20 / down.ravel()
    # Pixels count here by the ground that they show: along a ray its area grows with the cube of the depth
    order, area = np.argsort(depth), depth**3
    middle = depth[order][np.searchsorted(np.cumsum(area[order]), area.sum() / 2)]
    assert np.isclose(photo_sampling(photos, wide, SIZE), middle / 100, rtol=0.03)


def test_photos_that_frame_nothing_count_for_nothing():
    sights = [((0.0, 1e-3, 20.0), (0.0, 0.0, 0.0)), ((0.0, 1e-3, 20.0), (0.0, 0.0, 40.0))]
    poses = np.stack([look_at(np.array(at), np.array(target)) for at, target in sights])
    photos = Views(np.arange(2), poses, np.tile([400.0, 400.0, 256.0, 144.0], (2, 1)), np.tile([512, 288], (2, 1)))
    assert np.isclose(photo_sampling(photos, town(), SIZE), 0.2)
    with pytest.raises(InputError, match="no train photo frames any of the mesh"):
        photo_sampling(photos.take(np.array([1])), town(), SIZE)
