"""The plane sweep: exact geometry, inputs in any order and number, and that it learns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from aug3d_core.dataset.batches import Wanted, draw
from aug3d_core.dataset.projection import project
from aug3d_core.dataset.scene import no_fine_images
from aug3d_core.dataset.warp import Inputs, Target, lookup
from aug3d_core.heads.head import build
from aug3d_core.heads.sweep.config import SweepConfig
from aug3d_core.heads.sweep.head import _reshaped
from aug3d_core.heads.sweep.network import Given, PlaneConv, Shown, Sight, _filled
from aug3d_core.judging.cheap_answers import ground_homography
from tests.toy_scene import toy_scene

SMALL = SweepConfig(planes=16, features=8, crop_px=32)
CPU = torch.device("cpu")
WHOLE = (0, 0, 48, 36)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 48, 36)


def head(config=SMALL):
    torch.manual_seed(0)
    return build(config)


def test_points_on_rays_lie_where_the_rest_of_the_project_sees_them(scene):
    depth = torch.rand(1, 36, 48) * 20 + 30
    xy_px, inside = Inputs.of(scene, 40, np.array([38, 41]), CPU).project(Target.of(scene, 40, WHOLE, CPU), depth)
    pose = scene.world_from_cam[40]
    v, u = np.mgrid[:36, :48] + 0.5
    fx, fy, cx, cy = scene.intrinsics[40]
    rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], axis=-1) @ pose[:3, :3].T
    points = (pose[:3, 3] + rays * depth[0, ..., None].numpy()).reshape(-1, 3)
    for place, view in enumerate((38, 41)):
        there, ahead = project(scene, view, points)
        assert np.allclose(xy_px[place, 0].reshape(-1, 2)[ahead], there[ahead], atol=1e-2)
        within = ahead & ((there >= 0) & (there <= [48, 36])).all(axis=1)
        assert np.array_equal(inside[place, 0].numpy().ravel(), within)


def test_heights_and_depths_are_inverse_and_end_at_the_slab(scene):
    target = Target.of(scene, 40, WHOLE, CPU)
    heights = torch.rand(3, 36, 48)
    depths = target.depth_at(heights)
    for height, depth in zip(heights, depths, strict=True):
        assert torch.allclose(target.height_of(depth), height, atol=1e-4)
    truth = torch.from_numpy(scene.depth[40].astype(np.float32))
    found = target.height_of(truth)
    assert found.min() > -0.01 and found.max() < 1.01, "all that the toy shows is in its slab"


def test_a_window_is_a_part_of_the_whole(scene):
    whole, part = Target.of(scene, 40, WHOLE, CPU), Target.of(scene, 40, (8, 4, 16, 12), CPU)
    assert torch.equal(part.rays, whole.rays[4:16, 8:24])


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_a_feature_stands_for_the_middle_of_its_square(stride):
    """A ramp that is shrunk and looked up is the ramp."""
    ramp = torch.arange(48.0).expand(36, 48)[None, None] + 0.5
    maps = torch.nn.functional.avg_pool2d(ramp, stride)
    xy_px = torch.rand(1, 1, 5, 7, 2) * torch.tensor([40.0, 28.0]) + 4
    assert torch.allclose(lookup(maps, xy_px, stride)[0, 0], xy_px[0, ..., 0], atol=1e-3)


def test_at_the_true_depth_the_blend_shows_the_target(scene):
    """Before it has learned anything: what is left is what the inputs do not show, and that edges might stand elsewhere."""
    target, *inputs = scene.groups["test"][0]
    off, shown = blended_error(scene, int(target), np.array(inputs[:3]))
    flat = np.abs(ground_homography(scene, int(target), np.array(inputs[:3])) / 255.0 - scene.images[target] / 255.0)
    assert off[shown].mean() < 0.6 * flat[shown].mean()


def test_finer_inputs_bring_the_blend_nearer_to_the_target(scene):
    coarse = replace(scene, fine_images=no_fine_images(len(scene), (scene.width_px, scene.height_px)))
    for target, *inputs in scene.groups["test"]:
        (fine, shown), (soft, _) = (blended_error(one, int(target), np.array(inputs[:3])) for one in (scene, coarse))
        assert (fine[shown] ** 2).mean() < (soft[shown] ** 2).mean()


def test_an_input_that_looks_from_beside_the_target_is_what_is_shown(scene):
    """What the last layers add counts the less, the less far beside: nothing at the target's own pose."""
    target, aside = scene.groups["test"][0][:2]
    model = head()
    added = []
    for given in (target, aside):
        views = []
        for size in (0.0, 10.0):
            with torch.no_grad():
                torch.nn.init.constant_(model.network.blend.leave.bias, size)
            views.append(model.predict_bare(scene, int(target), np.array([given])))
        plain, more = views
        added.append(np.abs(more.colour.astype(float) - plain.colour)[plain.seen])
    assert added[0].max() <= 1 and added[1].mean() > 20


def blended_error(scene, target, views):
    """Return how far the blend at the true depth is from a photograph, and where any input shows it."""
    network, rays, given = head().network, Target.of(scene, target, WHOLE, CPU), given_of(scene, views)
    depth = torch.from_numpy(true_depth(scene, target))
    with torch.no_grad():
        sight = Sight(rays, Inputs.of(scene, target, views, CPU), given)
        colour, shown = network.blend(sight, depth, torch.zeros(3, 12, 18, 24))
    return np.abs(colour.movedim(0, -1).numpy() - scene.images[target] / 255.0), shown.numpy()


def given_of(scene, views):
    rgba = torch.from_numpy(np.concatenate([scene.images[views], scene.alpha[views][..., None]], -1) / 255.0).float()
    rgba = rgba.movedim(-1, 1)
    return Given(rgba, torch.from_numpy(scene.fine(views) / 255.0).float().movedim(-1, 1), rgba[:, :3])


def true_depth(scene, view):
    """Return the depth of a photograph of the toy, which its data set does not hold."""
    from tests.toy_scene import _shoot, toy_world

    fx, fy, cx, cy = scene.intrinsics[view]
    return _shoot(toy_world(np.random.default_rng(0)), scene.world_from_cam[view], (fx, fy, cx, cy), 48, 36)[1].astype(
        np.float32
    )


def test_the_order_of_the_inputs_is_nothing_to_it(scene):
    model, members = head().eval(), scene.groups["test"][0]
    one, other = (model.predict(scene, int(members[0]), members[order]) for order in ([1, 2, 3], [3, 1, 2]))
    assert np.abs(one.colour.astype(int) - other.colour).max() <= 1
    assert np.allclose(one.depth, other.depth, rtol=1e-3)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_it_takes_any_number_of_inputs(scene, count):
    members = scene.groups["test"][0]
    view = head().eval().predict(scene, int(members[0]), members[1 : 1 + count])
    assert view.colour.shape == (36, 48, 3)
    assert np.isfinite(view.depth).all() and (view.depth > 0).all()


def test_a_prediction_repeats_and_does_not_look_at_the_target(scene):
    members, model = scene.groups["test"][0], head().eval()
    images = scene.images.copy()
    images[members[0]] = 0
    views = [model.predict(one, int(members[0]), members[1:4]) for one in (scene, scene, replace(scene, images=images))]
    assert all(np.array_equal(views[0].colour, view.colour) for view in views[1:])


@pytest.mark.parametrize(("width", "height"), [(44, 28), (42, 27)])
def test_odd_sizes_are_predicted_whole(width, height):
    scene = toy_scene(0, width, height)
    members = scene.groups["test"][0]
    assert head().eval().predict(scene, int(members[0]), members[1:4]).colour.shape == (height, width, 3)


def test_without_noise_the_loss_repeats(scene):
    model = head()
    groups = draw([scene], Wanted(2, 3, 0.5, None), np.random.default_rng(0))
    first, second = (model.loss([scene], groups, None) for _ in range(2))
    assert first[0].item() == second[0].item()
    assert first[1].keys() == second[1].keys() >= {"error", "height_error"}


def test_it_learns_the_height_of_what_renders_show(scene):
    model = head()
    groups = draw([scene], Wanted(2, 3, 1.0, None), np.random.default_rng(0))
    optimiser = torch.optim.Adam(model.parameters(), lr=3e-3)
    told = []
    for step in range(40):
        loss, measured = model.loss([scene], groups, torch.Generator().manual_seed(step % 4))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        told.append(measured["height_error"].item())
    assert np.mean(told[-8:]) < 0.7 * np.mean(told[:8])


def test_planes_convolved_one_by_one_are_a_convolution_in_three_dimensions():
    torch.manual_seed(0)
    whole, planes = torch.nn.Conv3d(4, 5, 3, stride=2, padding=1), PlaneConv(4, 5, stride=2, rectified=False)
    with torch.no_grad():
        planes.each.weight.copy_(torch.cat(whole.weight.unbind(2)))
        planes.each.bias.copy_(torch.cat([torch.zeros(5), whole.bias, torch.zeros(5)]))
    x = torch.rand(7, 4, 9, 8, requires_grad=True)
    found, expected = planes(x), whole(x.movedim(1, 0)[None])[0].movedim(0, 1)
    assert torch.allclose(found, expected, atol=1e-5)
    weight = torch.rand_like(expected)
    (of_found,), (of_expected,) = (torch.autograd.grad((one * weight).sum(), x) for one in (found, expected))
    assert torch.allclose(of_found, of_expected, atol=1e-5)


def test_what_an_input_is_masked_at_has_no_say_in_heights(scene):
    members, volume = scene.groups["test"][0], head().network.coarse
    target = Target.of(scene, int(members[0]), WHOLE, CPU)
    inputs = Inputs.of(scene, int(members[0]), members[1:4], CPU)
    heights = torch.linspace(0, 1, 8)[:, None, None].expand(-1, 9, 12)
    maps = torch.rand(3, SMALL.features + 4, 9, 12)
    other = torch.cat([torch.rand_like(maps[:1]), maps[1:]])
    masked = torch.ones(3, 1, 36, 48)
    masked[0] = 0
    for used, alike in ((None, False), (torch.ones_like(masked), False), (masked, True)):
        one, two = (volume(target.at_stride(4), inputs, each, used, heights, heights, 4) for each in (maps, other))
        assert torch.equal(one, two) == alike


def test_a_scaffold_is_what_depth_is_looked_for_about(scene):
    """Untrained, the depth is within the reach of the fine planes of the scaffold, and no edge of it is blurred."""
    members, model = scene.groups["test"][0], head().eval()
    view = model.predict(scene, int(members[0]), members[1:4])
    target = Target.of(scene, int(members[0]), WHOLE, CPU)
    off = target.height_of(torch.from_numpy(view.depth).float()) - target.height_of(
        torch.from_numpy(scene.scaffold[members[0]].astype(np.float32))
    )
    assert off.abs().max() < 0.05
    assert (view.started_from, set(view.parts)) == ("scaffold", {"inputs_alone"})
    alone = replace(scene, scaffold=np.zeros_like(scene.scaffold))
    assert np.array_equal(model.predict(alone, int(members[0]), members[1:4]).colour, view.parts["inputs_alone"])


def test_the_bare_prediction_is_the_same_without_its_parts(scene):
    model, members = head().eval(), scene.groups["test"][0]
    for one in (scene, replace(scene, scaffold=np.zeros_like(scene.scaffold))):
        view = model.predict(one, int(members[0]), members[1:4])
        bare = model.predict_bare(one, int(members[0]), members[1:4])
        assert np.array_equal(bare.colour, view.colour) and np.array_equal(bare.depth, view.depth)
        assert bare.started_from == view.started_from and not bare.parts


def test_what_no_input_sees_is_marked_and_the_mesh_shows_it(scene):
    members, model = scene.groups["test"][0], head().eval()
    poses = scene.world_from_cam.copy()
    poses[members[1:], 0, 3] += 1e4
    away = replace(scene, world_from_cam=poses)
    view = model.predict(away, int(members[0]), members[1:4])
    assert not view.seen.any()
    assert np.array_equal(view.colour, scene.images[members[0]]), "the toy's mesh shows the truth"
    assert np.isfinite(view.parts["inputs_alone"]).all()


def test_a_scaffold_with_holes_is_used_around_them(scene):
    members, model = scene.groups["test"][0], head().eval()
    holed = scene.scaffold.copy()
    holed[:, 8:20, 8:30] = 0
    view = model.predict(replace(scene, scaffold=holed), int(members[0]), members[1:4])
    assert np.isfinite(view.depth).all() and (view.depth > 0).all()
    whole = model.predict(scene, int(members[0]), members[1:4])
    assert np.allclose(view.depth[26:], whole.depth[26:], rtol=1e-2)


@pytest.mark.parametrize("seed", range(24))
def test_a_hole_of_a_scaffold_has_no_say_in_the_heights_about_it(seed):
    """In a hole the height is that of the camera: spread, it would stand about the hole like a wall."""
    heights = torch.rand((20, 30), generator=torch.Generator().manual_seed(seed))
    known = torch.ones_like(heights, dtype=torch.bool)
    known[5:9, 10:18] = known[:, 28:] = False
    whole = _reshaped(heights, torch.ones_like(known), torch.Generator().manual_seed(seed))
    found = _reshaped(torch.where(known, heights, 50.0), known, torch.Generator().manual_seed(seed))
    assert found[known].min() >= 0 and found[known].max() <= 1
    assert torch.allclose(found[:, :1], whole[:, :1])  # far from any


def test_a_target_that_looks_at_the_sky_is_predicted_and_marked(scene):
    members, model = scene.groups["test"][0], head().eval()
    poses, bare = scene.world_from_cam.copy(), scene.scaffold.copy()
    poses[members[0], :3, 1:3] *= -1
    bare[members[0]] = 0
    view = model.predict(replace(scene, world_from_cam=poses, scaffold=bare), int(members[0]), members[1:4])
    assert np.isfinite(view.depth).all() and view.colour.shape == (36, 48, 3)
    assert view.seen.mean() < 0.5


def test_colours_are_continued_smoothly_to_where_nothing_is_seen():
    colour, some = torch.rand(3, 24, 32), torch.zeros(1, 24, 32)
    some[:, :, :10] = 1
    filled = _filled(colour, some)
    assert torch.equal(filled[:, :, :10], colour[:, :, :10])
    beyond = filled[:, :, 10:]
    assert beyond.min() >= colour[:, :, :10].min() and beyond.max() <= colour[:, :, :10].max()
    assert torch.equal(_filled(colour, torch.ones(1, 24, 32)), colour)
    assert torch.isfinite(_filled(colour, torch.zeros(1, 24, 32))).all()


@pytest.fixture(scope="module")
def mixed(scene):
    """What an untrained head's edges make of heights with a step of 0.2 in the middle, or as given, and of a colour of -1."""
    target, *views = scene.groups["test"][0]
    views, edges = np.array(views[:3]), head().network.blend.edges
    sight = Sight(
        Target.of(scene, int(target), WHOLE, CPU), Inputs.of(scene, int(target), views, CPU), given_of(scene, views)
    )
    step = torch.full((36, 48), 0.2)
    step[:, 24:] = 0.4

    def of(seen, heights=step):
        own = Shown(torch.full((3, 36, 48), -1.0), torch.zeros(1, 36, 48), torch.full((1, 36, 48), seen))
        with torch.no_grad():
            return edges(sight, heights, torch.zeros(3, 1, 36, 48), own, torch.zeros(16, 36, 48))

    return of


def test_away_from_edges_of_the_depth_a_pixel_keeps_its_own_colour(mixed):
    colour, some = mixed(1.0, torch.full((36, 48), 0.3))
    assert torch.allclose(colour, torch.full_like(colour, -1.0)) and some.all()


def test_beside_an_edge_a_pixel_takes_part_of_what_either_side_shows(mixed):
    """Its own colour is half of it at least; more than three pixels off nothing is taken."""
    colour, _ = mixed(1.0)
    taken = (colour[:, 8:28] + 1).amax(dim=(0, 1))
    assert (taken[21:27] > 0.05).all(), "shown by the inputs at the other side's height"
    assert taken[22:26].mean() > taken[[21, 26]].mean(), "less where only the wider of both looks reaches"
    assert taken[:21].max() < 1e-5 and taken[27:].max() < 1e-5
    assert (colour <= 0.5).all()


def test_what_only_a_side_of_an_edge_shows_is_shown(mixed):
    colour, some = mixed(0.0)
    assert (colour[:, 8:28, 22:26] >= 0).all(), "nothing of its own colour"
    assert some[0, 8:28, 22:26].all() and not some[0, :, :21].any()


def test_what_only_a_side_of_an_edge_shows_is_not_counted_as_seen(scene, monkeypatch):
    """So that the mesh shows it: a wall that no input sees had the colour of the roof above it."""
    members, model = scene.groups["test"][0], head().eval()
    poses = scene.world_from_cam.copy()
    poses[members[1:], 0, 3] += 1e4

    def all_shown(_, __, ___, own, ____):
        return own.colour, torch.ones_like(own.share)

    monkeypatch.setattr(model.network.blend.edges, "forward", all_shown)
    assert not model.predict(replace(scene, world_from_cam=poses), int(members[0]), members[1:4]).seen.any()
