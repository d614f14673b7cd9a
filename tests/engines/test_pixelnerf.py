import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn import functional as F

from aug3d_core.dataset.projection import project
from aug3d_core.dataset.rays import view_rays
from aug3d_core.heads.pixelnerf import sampling
from aug3d_core.heads.pixelnerf.cameras import PIXELS, Grid, lookup
from aug3d_core.heads.pixelnerf.compositing import composite
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.pixelnerf.encoder import SmallEncoder
from aug3d_core.heads.pixelnerf.field import Field, encode
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays
from aug3d_core.judging.cheap_answers import bilinear
from tests.toy_scene import toy_scene

SMALL = PixelNerfConfig(hidden=16, encoder_channels=4, coarse_samples=6, fine_samples=4, depth_samples=2)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 12, 8)


# Cameras


def test_lookup_agrees_with_grid_sample():
    maps = torch.rand(2, 3, 5, 7, 11)
    xy_px = torch.rand(2, 3, 40, 2) * torch.tensor([30.0, 20.0]) - 4
    found = lookup(xy_px, Grid(2, 1.0), 11, 7)(maps.movedim(2, -1))
    grid = xy_px / torch.tensor([22.0, 14.0]) * 2 - 1
    there = F.grid_sample(maps.flatten(0, 1), grid.flatten(0, 1)[:, None], padding_mode="border", align_corners=False)
    assert torch.allclose(found, there[:, :, 0].movedim(1, -1).reshape(found.shape), atol=1e-5)


def test_lookup_of_an_image_agrees_with_the_cheap_answers():
    image = np.random.default_rng(0).integers(0, 256, (7, 11, 3), dtype=np.uint8)
    xy_px = np.random.default_rng(1).uniform(-2, 13, (30, 2))
    maps = torch.from_numpy(image.astype(np.float32))[None, None]
    found = lookup(torch.from_numpy(xy_px.astype(np.float32))[None, None], PIXELS, 11, 7)(maps)
    assert np.allclose(found[0, 0].numpy(), bilinear(image, xy_px), atol=1e-3)


def test_projecting_maps_and_sampling_commute():
    field = Field(SMALL, channels=6)
    maps, xy_px = torch.rand(2, 5, 9, 6), torch.rand(1, 2, 30, 2) * 16
    look = lookup(xy_px, Grid(2, 1.0), 9, 5)
    assert torch.allclose(look(field.project(maps)[None]), field.project(look(maps[None])), atol=1e-5)


def test_cameras_project_as_the_rest_of_the_project_does(scene):
    model = PixelNeRF(SMALL)
    cameras = model.encode(scene, np.array([[3, 9]])).cameras
    points = np.random.default_rng(0).uniform(-40, 40, (50, 3)) * [1, 1, 0.2]
    xy_px, inside = cameras.project(cameras.points_in_cam(torch.from_numpy(points.astype(np.float32))[None]))
    for v, view in enumerate((3, 9)):
        there, ahead = project(scene, view, points)
        assert np.allclose(xy_px[0, v].numpy(), there, atol=1e-2)
        within = ((there >= 0) & (there <= [12, 8])).all(axis=1) & ahead
        assert np.array_equal(inside[0, v].numpy(), within)


def test_points_behind_a_view_are_not_seen(scene):
    cameras = PixelNeRF(SMALL).encode(scene, np.array([[3]])).cameras
    behind = scene.world_from_cam[3, :3, 3] - scene.world_from_cam[3, :3, 2] * 5
    _, inside = cameras.project(cameras.points_in_cam(torch.from_numpy(behind.astype(np.float32))[None, None]))
    assert not inside.any()


# Encoder


@pytest.mark.parametrize(("height", "width"), [(8, 12), (7, 11)])
def test_encoder_gives_maps_of_its_stride(height, width):
    maps = SmallEncoder(4)(torch.rand(2, 3, height, width))
    assert maps.shape == (2, 12, height // 2, width // 2)


def test_encoder_keeps_the_picture_in_place():
    """A mirrored image has the mirrored map when the kernels are mirrored: nothing shifts by half a pixel."""
    encoder, mirrored = SmallEncoder(4), SmallEncoder(4)
    weights = encoder.state_dict()
    mirrored.load_state_dict({n: w.flip(-1) if w.ndim == 4 else w for n, w in weights.items()})
    image = torch.rand(1, 3, 16, 24)
    assert torch.allclose(encoder(image).flip(-1), mirrored(image.flip(-1)), atol=1e-5)


# Sampling


@given(st.integers(0, 1000))
def test_samples_are_in_order_and_within_the_ray(seed):
    generator = torch.Generator().manual_seed(seed)
    near = torch.rand(5, generator=generator) + 0.1
    far = near + torch.rand(5, generator=generator) + 0.1
    t = sampling.stratified(near, far, torch.rand(5, 7, generator=generator))
    borders = sampling.edges(t, near, far)
    more = sampling.by_importance(borders, torch.rand(5, 7, generator=generator), torch.rand(5, 9, generator=generator))
    around = sampling.around_depth(far, near, far, torch.rand(5, 4, generator=generator))
    for values in (t, borders, more, around):
        assert (values >= near[:, None] - 1e-5).all()
        assert (values <= far[:, None] + 1e-5).all()
    for values in (t, borders, more):
        assert (values.diff(dim=1) >= -1e-5).all()
    assert torch.allclose(sampling.edges(t, near, far).diff(dim=1).sum(dim=1), far - near)


def test_importance_puts_samples_where_the_weight_is():
    borders = torch.linspace(0, 10, 11)[None]
    weights = torch.zeros(1, 10)
    weights[0, 6] = 1
    t = sampling.by_importance(borders, weights, torch.full((1, 50), 0.5))
    assert ((t > 6) & (t < 7)).float().mean() > 0.95


def test_even_weights_give_even_samples():
    t = sampling.by_importance(torch.linspace(0, 1, 6)[None], torch.ones(1, 5), torch.full((1, 10), 0.5))
    assert torch.allclose(t[0], (torch.arange(10) + 0.5) / 10, atol=1e-5)


# Compositing


def test_light_is_conserved_when_the_end_is_opaque():
    density, t = torch.rand(6, 8) * 5, torch.rand(6, 8).sort(dim=1).values
    pixels = composite(torch.rand(6, 8, 3), density, t, torch.rand(6, 8), opaque_end=True)
    assert torch.allclose(pixels.weights.sum(dim=1), torch.ones(6), atol=1e-5)


def test_a_wall_hides_what_is_behind_it():
    colour, density = torch.rand(1, 5, 3), torch.tensor([[0.0, 0, 1e6, 1, 1]])
    t = torch.arange(5.0)[None]
    pixels = composite(colour, density, t, torch.ones(1, 5), opaque_end=False)
    assert torch.allclose(pixels.colour, colour[:, 2], atol=1e-5)
    assert pixels.depth.item() == pytest.approx(2.0, abs=1e-5)


def test_empty_space_shows_nothing_or_the_end():
    colour, empty, t = torch.rand(1, 5, 3), torch.zeros(1, 5), torch.arange(5.0)[None]
    assert composite(colour, empty, t, torch.ones(1, 5), opaque_end=False).colour.abs().max() < 1e-5
    assert torch.allclose(composite(colour, empty, t, torch.ones(1, 5), opaque_end=True).colour, colour[:, -1])


def test_fog_follows_the_law_of_beer():
    pixels = composite(
        torch.ones(1, 50, 3), torch.full((1, 50), 0.7), torch.arange(50.0)[None], torch.full((1, 50), 0.04), False
    )
    assert pixels.weights.sum().item() == pytest.approx(1 - np.exp(-0.7 * 0.04 * 50), abs=1e-5)


# Field and model


def test_the_encoding_has_the_position_and_two_waves_an_octave():
    position, sines, cosines = encode(torch.tensor([[0.0, 0.1, 0.2]]), 2)
    assert torch.equal(position, torch.tensor([[0.0, 0.1, 0.2]]))
    assert torch.allclose(sines, torch.tensor([[0.0, 0.15, 0.3, 0.0, 0.3, 0.6]]).sin())
    assert torch.allclose(cosines, torch.tensor([[0.0, 0.15, 0.3, 0.0, 0.3, 0.6]]).cos())


def rendered(model, scene, inputs, view, **changes):
    encoded = model.encode(scene, np.array([inputs]))
    return model(encoded, TensorRays.of(view_rays(scene, view, True), 1), None)


def test_an_untrained_model_shows_the_inputs_on_the_ground(scene):
    """It starts thin and with the blend alone, so it starts as a homography: better than any constant."""
    torch.manual_seed(0)
    target, *inputs = scene.groups["test"][0]
    _, fine = rendered(PixelNeRF(SMALL).eval(), scene, inputs[:3], int(target))
    truth = torch.from_numpy(scene.images[target] / 255).reshape(-1, 3).float()
    assert ((fine.colour - truth) ** 2).mean() < ((truth - truth.mean(dim=0)) ** 2).mean()


def test_the_order_of_the_inputs_does_not_matter(scene):
    torch.manual_seed(0)
    model = _awake(PixelNeRF(SMALL).eval())
    _, one = rendered(model, scene, [3, 9, 4], 10)
    _, other = rendered(model, scene, [4, 3, 9], 10)
    assert torch.allclose(one.colour, other.colour, atol=1e-4)


def test_an_input_that_sees_nothing_of_it_changes_nothing_but_the_fallback(scene):
    torch.manual_seed(0)
    model = _awake(
        PixelNeRF(SMALL.model_copy(update={"even_exposure": False})).eval()
    )  # it counts in a group's exposure
    away = scene.world_from_cam.copy()
    away[20, :3, 3] += 1e4
    moved = _with(scene, world_from_cam=away)
    _, one = rendered(model, moved, [3, 9], 10)
    _, other = rendered(model, moved, [3, 9, 20], 10)
    reached = (one.colour - other.colour).abs().amax(dim=1) < 1e-4
    assert reached.float().mean() > 0.3  # the rest of the view is seen by no input and shows the inputs' mean colour


def test_rendering_without_noise_repeats(scene):
    model = PixelNeRF(SMALL).eval()
    first, second = (rendered(model, scene, [3, 9], 10)[1].colour for _ in range(2))
    assert torch.equal(first, second)


@pytest.mark.parametrize(
    "name", ["blend_inputs", "encode_height", "even_exposure", "mask_unseen", "opaque_end", "see_pixels", "slab_bounds"]
)
def test_each_difference_from_the_paper_can_be_set_back(scene, name):
    config = SMALL.model_copy(update={name: False})
    coarse, fine = rendered(PixelNeRF(config), scene, [3, 9], 10)
    assert torch.isfinite(fine.colour).all()
    assert fine.colour.shape == coarse.colour.shape == (96, 3)


def test_a_groups_exposure_is_nothing_to_what_the_network_knows(scene):
    """Half as bright in, half as bright out: the network is shown the same, and what is blended has its own exposure."""
    bright = _with(scene, images=scene.images // 2 * 2)
    dark = _with(scene, images=scene.images // 2)
    shown = []
    for blended in (False, True):
        torch.manual_seed(0)
        model = _awake(PixelNeRF(SMALL.model_copy(update={"blend_inputs": blended})))
        encoded = [model.encode(one, np.array([[3, 9]])) for one in (bright, dark)]
        assert torch.allclose(encoded[0].fine, encoded[1].fine, atol=1e-4)
        shown = [rendered(model, one, [3, 9], 10)[1].colour for one in (bright, dark)]
        if not blended:
            within = (shown[0] > 0) & (shown[0] < 1)
            assert within.float().mean() > 0.5
            assert torch.allclose(shown[1][within] * 2, shown[0][within], atol=1e-3)
    assert 1.5 < (shown[0].mean() / shown[1].mean()).item() < 2.5
    told = [
        rendered(_awake(PixelNeRF(SMALL.model_copy(update={"even_exposure": False}))), one, [3, 9], 10)[1].colour
        for one in (bright, dark)
    ]
    assert not torch.allclose(told[1] * 2, told[0], atol=1e-3), "the paper's network sees the difference"


def test_without_extra_samples_the_fine_pass_uses_the_coarse_ones(scene):
    config = SMALL.model_copy(update={"fine_samples": 0, "depth_samples": 0})
    coarse, fine = rendered(PixelNeRF(config), scene, [3, 9], 10)
    assert coarse.weights.shape == fine.weights.shape


def _awake(model: PixelNeRF) -> PixelNeRF:
    """Give the layers that start at zero some weight, so that nothing is hidden by it."""
    with torch.no_grad():
        for parameter in model.parameters():
            if not parameter.any():
                parameter.normal_(0, 0.1)
    return model


def _with(scene, **changes):
    from dataclasses import replace

    return replace(scene, **changes)
