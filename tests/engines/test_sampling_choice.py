import numpy as np
import pytest

from aug3d_core.domes.choice import as_drawn, by_coverage, together, views_ratio
from aug3d_core.domes.justified import sampling_by_photos
from aug3d_core.domes.methods import METHODS
from aug3d_core.domes.reach import Curve, Reach
from aug3d_core.domes.sight import DIRECTIONS, SPREAD, spread_over
from aug3d_core.geometry.transforms import invert, look_at
from aug3d_core.geometry.views import Views
from tests.engines.little_town import CONFIG, LENS, SIZE, VIEWS_PER_DOME, config, site_over, town


def photos_from(places, aims, lens=LENS, size=SIZE) -> Views:
    poses = np.stack([look_at(np.array(p, float), np.array(a, float)) for p, a in zip(places, aims, strict=True)])
    return Views(np.arange(len(poses)), poses, np.tile(lens, (len(poses), 1)), np.tile(size, (len(poses), 1)))


@pytest.fixture(scope="module")
def scene():
    """A town, its site with thrice the cameras needed, plans and what one photo sees."""
    mesh = town(tower=6.0)
    surface, site = site_over(mesh, drawn=3 * VIEWS_PER_DOME)
    plans = [METHODS["grid"](surface, site, CONFIG, np.random.default_rng(seed)) for seed in (0, 1)]
    photos = photos_from([(0.0, 0.1, 15.0)], [(0.0, 0.0, 0.0)])
    return mesh, surface, site, plans, Reach(mesh, surface, photos, site, np.random.default_rng(0))


def test_points_lie_on_the_surface_and_evenly():
    mesh = town()
    samples = spread_over(mesh, 8000, np.ones(1), np.random.default_rng(0))
    np.testing.assert_allclose(samples.xyz[:, 2], 0, atol=1e-6)
    np.testing.assert_allclose(samples.normal, np.tile([0, 0, 1], (8000, 1)), atol=1e-6)
    assert abs((samples.xyz[:, 0] < -20).mean() - 20 * 60 / (80 * 60 - 400)) < 0.02


def test_a_camera_sees_what_is_in_its_view_and_nothing_hides():
    mesh = town(tower=10.0)
    surface, _ = site_over(mesh)
    samples = spread_over(mesh, 4000, np.array([0.1, 1.0]), np.random.default_rng(0))
    camera = look_at(np.array([-15.0, 0.0, 5.0]), np.array([0.0, 0.0, 5.0]))
    seen = samples.seen(surface, camera, LENS, SIZE)
    points = samples.xyz[np.unique(seen // (2 * DIRECTIONS))]
    assert len(points) and (points[:, 0] > -15).all()
    assert not ((points[:, 0] > 3.5) & (abs(points[:, 1]) < 3)).any()  # the tower hides what is behind it
    assert ((points[:, 0] > 3.5) & (abs(points[:, 1]) > 6)).any()
    # One pixel spans 0.1 at 9 from the camera
    fine = samples.xyz[np.unique(seen[seen % 2 == 0] // (2 * DIRECTIONS))]
    assert (fine[:, 0] < -6 + 1e-6).all()


def test_directions_of_sights_lead_to_the_camera():
    mesh = town()
    surface, _ = site_over(mesh)
    samples = spread_over(mesh, 2000, np.ones(1), np.random.default_rng(0))
    place = np.array([3.0, -4.0, 15.0])
    seen = samples.seen(surface, look_at(place, np.array([0.0, 0.0, 0.0])), LENS, SIZE)
    towards = place - samples.xyz[seen // DIRECTIONS]
    cosine = np.einsum("sk,sk->s", SPREAD[seen % DIRECTIONS], towards / np.linalg.norm(towards, axis=1, keepdims=True))
    assert np.degrees(np.arccos(cosine.min())) < 25


def test_the_sky_is_open_over_a_field_and_half_closed_beside_a_wall():
    mesh = town(tower=40.0)
    samples = spread_over(mesh, 3000, np.ones(1), np.random.default_rng(0))
    free = samples.open(site_over(mesh)[0], 30.0)[:, :, 0].sum(axis=1)
    ground = samples.xyz[:, 2] < 0.1
    far = ground & (np.abs(samples.xyz[:, :2]).max(axis=1) > 28)
    near = ground & (np.abs(samples.xyz[:, :2]).max(axis=1) < 4)
    assert np.ptp(free[far]) <= 3 and free[near].max() < free[far].min() and near.any()


def test_the_choice_reaches_more_with_as_many_views_and_as_much_with_fewer(scene):
    _, _, _, (wanted, more), reach = scene
    seen = reach.of_domes(wanted.cameras)
    uniform = as_drawn(wanted, seen, VIEWS_PER_DOME, reach)
    both = together(wanted, more)
    chosen = by_coverage(both, seen + reach.of_domes(more.cameras), VIEWS_PER_DOME, reach, config(min_gain=0.0))
    count = min(len(chosen.plan.cameras), len(uniform.plan.cameras))
    assert chosen.curve.sights[0] == uniform.curve.sights[0]
    assert chosen.curve.sights[count] > uniform.curve.sights[count]
    assert (np.diff(chosen.curve.sights) >= 0).all() and chosen.curve.sights[-1] <= 1
    assert views_ratio(chosen.curve, uniform.curve) < 0.7
    # Whole domes of K views, and all that was not kept is in the table with a reason
    assert np.bincount(chosen.plan.cameras.dome_id).tolist() == [VIEWS_PER_DOME] * chosen.domes
    assert chosen.domes == sum(dome.views > 0 for dome in chosen.plan.domes) <= CONFIG.domes
    assert len(chosen.plan.domes) == len(wanted.domes) + len(more.domes)
    assert all("left out" in dome.why or "passed over" in dome.why for dome in chosen.plan.domes if not dome.views)


def test_views_of_a_kept_dome_are_among_those_drawn_for_it(scene):
    _, _, _, (wanted, _), reach = scene
    chosen = by_coverage(wanted, reach.of_domes(wanted.cameras), VIEWS_PER_DOME, reach, CONFIG)
    used = [index for index, dome in enumerate(d for d in wanted.domes if d.views)]
    drawn = {index: wanted.cameras.world_from_cam[wanted.cameras.dome_id == index] for index in used}
    standing = [dome for dome in chosen.plan.domes if dome.views]
    for dome_id, dome in enumerate(standing):
        place = next(
            i
            for i, d in enumerate(d for d in wanted.domes if d.views)
            if (d.x, d.y, d.cell) == (dome.x, dome.y, dome.cell)
        )
        for pose in chosen.plan.cameras.world_from_cam[chosen.plan.cameras.dome_id == dome_id]:
            assert (pose == drawn[place]).all(axis=(1, 2)).sum() == 1


def test_asking_more_of_a_dome_keeps_fewer(scene):
    _, _, _, (wanted, _), reach = scene
    seen = reach.of_domes(wanted.cameras)
    counts = [
        by_coverage(wanted, seen, VIEWS_PER_DOME, reach, config(min_gain=gain)).domes for gain in (0.0, 0.3, 0.6, 1.0)
    ]
    assert counts == sorted(counts, reverse=True) and counts[0] > counts[-1]


def test_where_photos_were_taken_from_the_very_places_no_dome_is_needed(scene):
    mesh, surface, site, (wanted, _), _ = scene
    cameras = wanted.cameras
    photos = Views(cameras.view_id, invert(cameras.world_from_cam[:, :3]), cameras.intrinsics, cameras.size)
    reach = Reach(mesh, surface, photos, site, np.random.default_rng(0))
    chosen = by_coverage(wanted, reach.of_domes(cameras), VIEWS_PER_DOME, reach, CONFIG)
    assert chosen.domes == 0 and len(chosen.plan.cameras) == 0
    assert all(dome.views == 0 for dome in chosen.plan.domes)


def test_views_from_one_place_overlap_wholly_and_of_opposite_corners_not_at_all(scene):
    mesh, surface, site, _, reach = scene
    samples = spread_over(mesh, 4000, site.limits, np.random.default_rng(0))
    a, b = (
        samples.seen(surface, look_at(np.array([x, x + 0.1, 15.0]), np.array([x, x, 0.0])), LENS, SIZE)
        for x in (-20.0, 20.0 - 12)
    )
    assert reach.overlap([[a, a]]) == 1.0 and reach.overlap([[a, b]]) == 0.0
    assert reach.overlap([[a, a], [a, b]]) == 0.5
    assert reach.overlap([]) is None


def test_the_ratio_counts_views_until_nearly_all_is_reached():
    def curve(*sights: float) -> Curve:
        return Curve(np.array(sights), np.array(sights))

    uniform = curve(0.2, 0.3, 0.4, 0.5, 0.6)
    assert views_ratio(curve(0.2, 0.5, 0.58, 0.6), uniform) == 2 / 4
    assert views_ratio(curve(0.2, 0.3, 0.31), uniform) is None
    assert views_ratio(curve(0.2, 0.5), curve(0.2, 0.2)) is None


def test_two_photos_must_see_a_place_and_aslant_they_see_it_coarsely():
    mesh = town()
    surface, _ = site_over(mesh)
    down = photos_from([(-20.0, 0.1, 15.0)] * 2, [(-20.0, 0.0, 0.0)] * 2)
    aslant = photos_from([(-35.0, 0.1, 15.0)] * 2, [(-20.0, 0.0, 0.0)] * 2)
    middle = mesh.xyz[mesh.triangles].mean(axis=1)[:, :2]
    about = np.linalg.norm(middle - (-20.0, 0.0), axis=1) < 1
    below, beside, alone = (
        sampling_by_photos(mesh, surface, photos, np.random.default_rng(0))
        for photos in (down, aslant, down.take(np.array([0])))
    )
    np.testing.assert_allclose(below[about], 15 / 90, rtol=0.05)
    # 21.2 away, seen at 45 degrees
    np.testing.assert_allclose(beside[about], 15 * 2 / 90, rtol=0.15)
    assert np.isinf(below[np.linalg.norm(middle - (20.0, 0.0), axis=1) < 1]).all() and np.isinf(alone).all()
