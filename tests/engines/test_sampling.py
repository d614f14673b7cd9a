from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from aug3d_core.errors import InputError
from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.transforms import invert, look_at
from aug3d_core.geometry.views import Views
from aug3d_core.sampling.cameras import Cameras, Plan
from aug3d_core.sampling.config import SamplingConfig
from aug3d_core.sampling.grid import cell_centres, choose_side, looked_at, plan
from aug3d_core.sampling.ground import ground_of
from aug3d_core.sampling.site import Site, edge_length, lens_like, photo_sampling
from aug3d_core.sampling.stage import run
from aug3d_core.store import layout
from aug3d_core.surface.raycast import Raycaster

CONFIG = SamplingConfig(domes=12)
SIZE = np.array([96, 72])
LENS = np.array([90.0, 90.0, 48.0, 36.0])  # at a radius of 15 it shows 16 x 12 of the ground
VIEWS_PER_DOME = 5


def town(tower: float = 0.0) -> Mesh:
    """A level ground of 80 x 60, one corner of it missing, with a tower of that height on the middle."""
    x, y = np.meshgrid(np.arange(401) / 5 - 40, np.arange(301) / 5 - 30)
    a = (np.arange(300)[:, None] * 401 + np.arange(400)).ravel()
    triangles = np.concatenate([np.stack([a, a + 1, a + 402], 1), np.stack([a, a + 402, a + 401], 1)])
    z = np.where((abs(x) < 3) & (abs(y) < 3), tower, 0.0)
    xyz = np.stack([x, y, z], -1).reshape(-1, 3)
    missing = (xyz[triangles] > (20, 10, -1)).all(axis=(1, 2))
    rgb = np.full(xyz.shape, 128, np.uint8)
    return Mesh(xyz.astype(np.float32), rgb, triangles[~missing].astype(np.int32))


def site_of(mesh: Mesh) -> tuple[Raycaster, Site]:
    surface = Raycaster(mesh.xyz, mesh.triangles)
    return surface, Site(ground_of(mesh, surface), LENS, SIZE, 0.05, VIEWS_PER_DOME)


def planned(mesh: Mesh, config: SamplingConfig = CONFIG, seed: int = 0) -> Plan:
    surface, site = site_of(mesh)
    return plan(surface, site, config, np.random.default_rng(seed))


def test_the_ground_knows_heights_and_holes():
    ground = site_of(town(tower=7.0))[1].ground
    np.testing.assert_allclose(ground.extent, [80, 60], atol=2 * ground.square)
    np.testing.assert_allclose(ground.window(np.zeros(2), 2.0), 7.0, atol=1e-4)
    np.testing.assert_allclose(ground.window(np.array([-20.0, -20.0]), 5.0), 0.0, atol=1e-4)
    assert np.isnan(ground.window(np.array([33.0, 22.0]), 5.0)).all()
    places = np.array([[0.0, 0.0], [-40.0, 0.0], [33.0, 22.0], [20.0, -30.0], [500.0, 500.0]])
    np.testing.assert_allclose(ground.covered_share(places, 10.0), [1, 0.5, 0, 0.5, 0], atol=0.03)


def test_cells_tile_the_ground_and_their_number_is_what_was_wanted():
    site = site_of(town())[1]
    side = choose_side(site, CONFIG)
    centres = cell_centres(site.ground, side)
    covered = site.ground.covered_share(centres, looked_at(site, side)) >= CONFIG.min_cell_covered
    assert abs(covered.sum() - CONFIG.domes) <= 2
    np.testing.assert_allclose(centres.mean(axis=0), site.ground.low + site.ground.extent / 2, atol=1e-9)
    assert (np.ptp(centres, axis=0) + side >= site.ground.extent - 1e-6).all()


def test_no_cell_is_finer_than_photos_and_mesh():
    surface, site = site_of(town())
    coarse = replace(site, finest_sampling=0.5)
    answer = plan(surface, coarse, replace_config(domes=1000), np.random.default_rng(0))
    used = [dome for dome in answer.domes if dome.views]
    assert min(dome.radius for dome in used) / coarse.focal_px >= 0.5 - 1e-9


def replace_config(**changes) -> SamplingConfig:
    return CONFIG.model_copy(update=changes)


def test_domes_stand_on_the_surface_with_equally_many_views_that_see_it():
    mesh = town()
    surface, site = site_of(mesh)
    answer = planned(mesh)
    used = [dome for dome in answer.domes if dome.views]
    assert 8 <= len(used) <= CONFIG.domes + 2
    assert any(dome.views == 0 and "surface under" in dome.why for dome in answer.domes)
    assert np.bincount(answer.cameras.dome_id).tolist() == [VIEWS_PER_DOME] * len(used)
    np.testing.assert_array_equal(answer.cameras.view_id, np.arange(len(answer.cameras)))
    for dome, pose in zip(np.repeat(used, VIEWS_PER_DOME), answer.cameras.world_from_cam, strict=True):
        aim = np.array([dome.x, dome.y, dome.z])
        radius = np.linalg.norm(pose[:3, 3] - aim)
        assert dome.radius <= radius * (1 + 1e-9)
        assert radius <= dome.radius * (1 + CONFIG.radius_spread) * (1 + 1e-9)
        hits = surface.view(invert(pose[:3]), LENS, SIZE)
        assert (hits.triangle >= 0).mean() >= CONFIG.min_view_covered - 0.1  # planned on a coarse net of rays
    # Seen from right above, the long side of the view is one cell
    assert np.isclose(used[0].radius / site.focal_px * SIZE[0], used[0].cell)


def test_no_camera_is_inside_or_under_or_too_near_a_tower():
    mesh = town(tower=60.0)
    surface, _ = site_of(mesh)
    answer = planned(mesh)
    places = answer.cameras.world_from_cam[:, :3, 3]
    smallest = min(dome.radius for dome in answer.domes)
    assert len(places)
    assert surface.distance(places).min() >= CONFIG.min_clearance * smallest - 1e-6
    assert np.isinf(surface.cast(places, np.array([0.0, 0.0, 1.0])).distance).all()


def test_the_seed_alone_decides():
    a, b, c = planned(town()), planned(town()), planned(town(), seed=1)
    np.testing.assert_array_equal(a.cameras.world_from_cam, b.cameras.world_from_cam)
    assert not np.allclose(a.cameras.world_from_cam[0], c.cameras.world_from_cam[0])


def photos(count: int = 6) -> Views:
    poses = np.stack([look_at(np.array([x, 1e-3, 20.0]), np.array([x, 0.0, 0.0])) for x in np.linspace(-20, 20, count)])
    intrinsics = np.tile([400.0, 400.0, 256.0, 144.0], (count, 1))
    return Views(np.arange(count), poses, intrinsics, np.tile([512, 288], (count, 1)))


def test_the_lens_is_that_of_the_photos_cut_to_the_view():
    # 288 rows become 72, so that 512 columns become 128, of which 96 stay
    np.testing.assert_allclose(lens_like(photos(), SIZE), [100.0, 100.0, 48.0, 36.0])
    assert np.isclose(photo_sampling(photos(), town(), SIZE), 0.2)  # 20 above the ground, 100 px
    assert np.isclose(edge_length(town()), 0.2)


def stage_inputs(folder, mesh: Mesh):
    """Return the stage's inputs over a mesh, and its output folder."""
    sfm, grouping, surface, out = (folder / name for name in ("sfm", "grouping", "surface", "out"))
    for each in (sfm, grouping, surface, out):
        each.mkdir()
    photos().save(sfm / layout.VIEWS)
    role = ["train"] * 5 + ["target"]
    pd.DataFrame({"view": range(6), "photo_id": range(6), "role": role}).to_parquet(grouping / layout.SPLIT_TABLE)
    np.savez(grouping / layout.GROUPS, members=np.zeros((3, 4), int), test_members=np.zeros((1, 4), int))
    mesh.save(surface / layout.MESH)
    return {"sfm": sfm, "grouping": grouping, "surface": surface}, out


def test_over_a_patchy_surface_domes_make_do_with_less_and_say_so(tmp_path):
    whole = town()
    east = whole.xyz[whole.triangles].mean(axis=1)[:, 0]
    patchy = Mesh(whole.xyz, whole.rgb, whole.triangles[np.mod(east, 4.0) < 2.6])  # strips: two thirds of the ground
    inputs, out = stage_inputs(tmp_path, patchy)
    outcome = run(inputs, CONFIG, out, lambda done, total, what: None)
    assert outcome.metrics["domes"] >= 1 and outcome.metrics["min_view_covered"] < CONFIG.min_view_covered
    assert outcome.state == "degraded" and "the surface is patchy" in outcome.notes[0]


def test_the_stage_writes_what_the_renderer_reads(tmp_path):
    inputs, out = stage_inputs(tmp_path, town())
    outcome = run(inputs, CONFIG, out, lambda done, total, what: None)
    cameras, table = Cameras.load(out / layout.CAMERAS), pd.read_parquet(out / layout.DOME_TABLE)
    assert outcome.metrics["views_planned"] == len(cameras) == 4 * outcome.metrics["domes"]
    assert table[table.views > 0].dome_id.tolist() == sorted(set(cameras.dome_id.tolist()))
    assert (table[table.views == 0].dome_id == -1).all()
    with pytest.raises(InputError, match="no dome stands"):
        run(inputs, replace_config(min_clearance=0.99, min_elevation_deg=5, max_elevation_deg=5.1), out, print)
