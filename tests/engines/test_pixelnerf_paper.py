"""The paper's network: what it is made of, and that the fast way computes what the plain one does."""

import weakref
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from aug3d_core.dataset.batches import Wanted, draw, pixel_colours
from aug3d_core.dataset.rays import pixel_rays, view_rays
from aug3d_core.heads.pixelnerf.config import PRESETS
from aug3d_core.heads.pixelnerf.cpu_mlp import ROWS, ResidualStack
from aug3d_core.heads.pixelnerf.encoder import Encoded, PaperEncoder
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays
from aug3d_core.heads.pixelnerf.reference import encode_plainly, render_plainly
from aug3d_core.heads.pixelnerf.resnet import ResNet34, used_weights
from tests.toy_scene import toy_scene

PAPER = PRESETS["paper"]["head"].model_copy(
    update={"hidden": 16, "coarse_samples": 8, "fine_samples": 4, "depth_samples": 4, "encoder_weights": "random"}
)


@pytest.fixture(scope="module")
def scene():
    return toy_scene(0, 32, 24)


def awake(config):
    """Return a network in which no layer is zero, so that nothing is hidden by it."""
    torch.manual_seed(0)
    model = PixelNeRF(config)
    with torch.no_grad():
        for parameter in model.parameters():
            if not parameter.any():
                parameter.normal_(0, 0.1)
    return model


# The network


def test_the_preset_is_the_papers_network():
    model = PixelNeRF(PRESETS["paper"]["head"])
    assert model.encoder.channels == 512
    names = {name.split(".")[0] for name, _ in model.coarse.named_parameters()}
    assert names == {"features", "enter", "per_view", "pooled", "leave"}  # no height, no votes
    assert model.coarse.enter.weight.shape == (256, 3 + 3 * 2 * 6 + 3)
    assert model.coarse.features.weight.shape == (3 * 256, 512)
    assert (len(model.coarse.per_view), len(model.coarse.pooled)) == (3, 2)
    for block in (*model.coarse.per_view, *model.coarse.pooled):
        assert not block.second.weight.any()
        assert block.first.weight.std().item() == pytest.approx(np.sqrt(2 / 256), rel=0.05)  # Kaiming
    assert not any(parameter.requires_grad for parameter in model.encoder.parameters())
    assert sum(p.numel() for p in model.encoder.parameters()) == 8_170_304  # torchvision's resnet34 up to layer3


def test_the_trunk_has_torchvisions_names_and_shapes():
    """Spot checks of the names that torchvision's file of weights has, and that the rest of that file is left out."""
    weights = ResNet34().state_dict()
    assert weights["conv1.weight"].shape == (64, 3, 7, 7)
    assert weights["layer1.2.bn2.running_var"].shape == (64,)
    assert weights["layer2.0.downsample.0.weight"].shape == (128, 64, 1, 1)
    assert weights["layer3.5.conv2.weight"].shape == (256, 256, 3, 3)
    assert not any(name.startswith("layer1.0.downsample") for name in weights)
    assert used_weights({**weights, "layer4.0.conv1.weight": torch.ones(1), "fc.bias": torch.ones(1)}) == weights


def test_the_encoder_is_four_maps_at_the_size_of_the_first():
    encoder, images = PaperEncoder(frozen=True), torch.rand(2, 3, 24, 32)
    maps = encoder(images)
    assert maps.shape == (2, 512, 12, 16)
    first, *others = encoder.trunk(images)
    assert [tuple(one.shape[1:]) for one in (first, *others)] == [(64, 12, 16), (64, 6, 8), (128, 3, 4), (256, 2, 2)]
    assert torch.equal(maps[:, :64], first)
    deepest = maps[:, 256:]
    assert torch.allclose(deepest[..., 0, 0], others[2][..., 0, 0], atol=1e-5)  # corners aligned
    assert torch.allclose(deepest[..., -1, -1], others[2][..., -1, -1], atol=1e-5)


def test_the_first_map_lies_where_its_grid_says():
    """A bright pixel at column 2j answers most strongly at column j under a kernel that looks at its centre alone."""
    encoder = PaperEncoder(frozen=True)
    with torch.no_grad():
        encoder.trunk.conv1.weight.zero_()
        encoder.trunk.conv1.weight[:, :, 3, 3] = 1
    image = torch.zeros(1, 3, 16, 16)
    image[..., 6, 10] = 1
    row, column = np.unravel_index(int(encoder(image)[0, 0].argmax()), (8, 8))
    assert encoder.grid.first_px + column * encoder.grid.stride_px == 10.5
    assert encoder.grid.first_px + row * encoder.grid.stride_px == 6.5


def test_a_frozen_encoder_never_goes_back_to_training():
    frozen, free = PaperEncoder(frozen=True).train(), PaperEncoder(frozen=False).train()
    assert not frozen.trunk.bn1.training
    assert free.trunk.bn1.training
    before = frozen.trunk.bn1.running_mean.clone()
    assert not frozen(torch.rand(1, 3, 16, 16)).requires_grad
    assert torch.equal(frozen.trunk.bn1.running_mean, before)


def test_what_a_frozen_encoder_made_is_kept_within_its_limit(scene):
    made = []

    def encode(new):
        made.append(new.tolist())
        return torch.arange(len(new)).float().reshape(-1, 1, 1, 1).expand(-1, 2, 2, 4)

    encoded = Encoded(limit_bytes=3 * 2 * 2 * 4 * 4)
    first = encoded.maps(scene, np.array([5, 3]), encode)
    again = encoded.maps(scene, np.array([3, 5, 9]), encode)
    assert made == [[0, 1], [2]]
    assert torch.equal(again[:2], first[[1, 0]])
    encoded.maps(scene, np.array([1]), encode)  # view 5, the oldest, goes
    encoded.maps(scene, np.array([5]), encode)
    assert len(made) == 4
    other = toy_scene(1, 8, 8)
    for one in (other, scene, other):  # scenes that take turns keep their maps
        encoded.maps(one, np.array([5]), encode)
    assert len(made) == 5


def test_maps_go_with_the_pictures_they_are_of(scene):
    """A viewer makes a scene for each frame, of the same pictures until other inputs are chosen."""
    made = []

    def encode(new):
        made.append(torch.zeros(len(new), 2, 2, 4))
        return made[-1]

    encoded, first = Encoded(), replace(scene, images=np.array(scene.images))
    for _ in range(3):
        encoded.maps(replace(first, scaffold=scene.scaffold.copy()), np.array([5, 3]), encode)
    assert len(made) == 1
    pictures = weakref.ref(first.images)
    kept = [weakref.ref(one) for one in encoded._kept.values()]
    assert len(kept) == 2
    del first
    assert pictures() is None
    encoded.maps(scene, np.array([1]), encode)
    assert all(one() is None for one in kept)


def test_other_weights_make_other_maps_of_the_same_views(scene):
    model, views = awake(PAPER), np.array([[1, 2]])
    before = model.encode(scene, views).coarse
    other = {name: value + 0.01 if value.is_floating_point() else value for name, value in model.state_dict().items()}
    model.load_state_dict(other)
    fresh = PixelNeRF(PAPER)
    fresh.load_state_dict(other)
    assert torch.equal(model.encode(scene, views).coarse, fresh.encode(scene, views).coarse)
    assert not torch.equal(model.encode(scene, views).coarse, before)


# Equal to the plain network


@pytest.mark.parametrize("changes", [{}, {"encoder_frozen": False}, {"normalised_z": False, "slab_bounds": True}])
def test_the_fast_network_computes_what_the_plain_one_does(scene, changes):
    config = PAPER.model_copy(update=changes)
    model = awake(config)
    groups = draw([scene], Wanted(2, 3, 0.0, 24), np.random.default_rng(0))
    inputs, pixels = np.stack([group.inputs for group in groups]), np.concatenate([group.pixels for group in groups])
    rays = TensorRays.of(pixel_rays(scene, pixels[:, 0], pixels[:, 1:] + 0.5, config.slab_bounds), 2)
    truth = torch.from_numpy(pixel_colours(scene, pixels)[0]).float()
    found = []
    for render in (
        lambda noise: model(model.encode(scene, inputs), rays, noise),
        lambda noise: render_plainly(model, scene, inputs, encode_plainly(model, scene, inputs), rays, noise),
    ):
        model.zero_grad(set_to_none=True)
        coarse, fine = render(torch.Generator().manual_seed(1))
        (((coarse.colour - truth) ** 2).mean() + ((fine.colour - truth) ** 2).mean()).backward()
        grads = {name: p.grad.clone() for name, p in model.named_parameters() if p.grad is not None}
        found.append((coarse.colour.detach(), fine.colour.detach(), fine.depth.detach(), grads))
    fast, plain = found
    for one, other in zip(fast[:3], plain[:3], strict=True):
        assert torch.allclose(one, other, atol=1e-5, rtol=1e-5)
    assert fast[3].keys() == plain[3].keys()
    for name, grad in plain[3].items():
        assert torch.allclose(fast[3][name], grad, atol=1e-3 * grad.abs().max().item() + 1e-8), name
    assert len(np.unique(fast[1].numpy().round(4), axis=0)) > 10  # rays differ: the comparison says something


def test_the_plain_network_refuses_what_is_not_the_papers(scene):
    model = PixelNeRF(PAPER.model_copy(update={"blend_inputs": True}))
    views, rays = np.array([[1, 2]]), TensorRays.of(view_rays(scene, 3, False), 1)
    with pytest.raises(AssertionError, match="does not know blend_inputs"):
        render_plainly(model, scene, views, encode_plainly(model, scene, views), rays, None)


@pytest.mark.parametrize("count", [1, ROWS + 7])
def test_the_stack_is_its_blocks_one_after_another(count):
    torch.manual_seed(0)
    known, features = torch.randn(count, 5), torch.randn(count, 3 * 8, requires_grad=True)
    weights = [torch.randn(shape, requires_grad=True) for shape in ((8, 5), (3, 8, 8), (3, 8), (3, 8, 8))]
    enter, first, bias, second = weights
    x = known @ enter.T
    for i, some in enumerate(features.split(8, dim=1)):
        x = x + some
        x = x + F.relu(F.relu(x) @ first[i].T + bias[i]) @ second[i].T
    fast = ResidualStack.apply(known, features, *weights, True)
    assert torch.allclose(fast, x, rtol=1e-4, atol=1e-4)
    assert torch.equal(ResidualStack.apply(known, features, *weights, False), fast)
    toward, wanted = torch.randn(count, 8), (features, *weights)
    pairs = zip(torch.autograd.grad(fast, wanted, toward), torch.autograd.grad(x, wanted, toward), strict=True)
    for one, other in pairs:
        assert torch.allclose(one, other, rtol=1e-3, atol=1e-3 * other.abs().max().item())


def test_the_layers_of_a_gpu_do_what_the_stack_does(scene):
    model = awake(PAPER)
    blocks = model.coarse.per_view
    known, features = torch.randn(50, model.coarse.enter.in_features), torch.randn(50, 3 * 16)
    weights = (
        torch.stack([block.first.weight for block in blocks]),
        torch.stack([block.first.bias for block in blocks]),
        torch.stack([block.second.weight for block in blocks]),
    )
    stacked = ResidualStack.apply(known, features, model.coarse.enter.weight, *weights, False)
    assert torch.allclose(model.coarse._in_layers(known, features), stacked, rtol=1e-4, atol=1e-4)
