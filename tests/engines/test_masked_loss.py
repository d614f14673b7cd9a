"""What is masked is not trained on: the loss, and where it leads, are the same whatever stands there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from aug3d_core.dataset.batches import Wanted, draw
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.config import HeadConfig
from aug3d_core.heads.head import build
from aug3d_core.heads.pixelnerf.config import PixelNerfConfig
from aug3d_core.heads.sweep.config import SweepConfig
from tests.toy_scene import toy_scene

NERF = PixelNerfConfig(
    hidden=16, encoder_channels=4, coarse_samples=6, fine_samples=4, depth_samples=2, rays_per_group=400
)
SWEEP = SweepConfig(planes=16, features=8, crop_px=48)
HOLE = (slice(8, 28), slice(10, 36))


def with_hole(scene: Scene, views: np.ndarray, seed: int) -> Scene:
    """Return the scene with a part of views masked, in which anything stands; nothing is known of its depth."""
    alpha, images, depth = scene.alpha.copy(), scene.images.copy(), scene.depth.copy()
    for view in views:
        alpha[view][HOLE], depth[view][HOLE] = 0, 0
        images[view][HOLE] = np.random.default_rng(seed).integers(0, 256, images[view][HOLE].shape)
    return replace(scene, alpha=alpha, images=images, depth=depth)


@pytest.mark.parametrize("config", [NERF, SWEEP], ids=["pixelnerf", "sweep"])
def test_masked_pixels_of_targets_are_in_no_loss_and_no_gradient(config: HeadConfig) -> None:
    scene = toy_scene(0, 48, 36)
    pixels = NERF.rays_per_group if config is NERF else None
    groups = draw([scene], Wanted(2, 3, 0.5, pixels), np.random.default_rng(0))
    targets = np.unique(np.concatenate([group.targets for group in groups]))
    targets = np.setdiff1d(targets, np.concatenate([group.inputs for group in groups]))
    found = []
    for one in (scene, with_hole(scene, targets, 1), with_hole(scene, targets, 2)):
        torch.manual_seed(0)
        head = build(config)
        loss, measured = head.loss([one], groups, torch.Generator().manual_seed(1))
        loss.backward()
        gradient = torch.cat([p.grad.flatten() for p in head.parameters() if p.grad is not None])
        found.append((loss.detach(), measured, gradient))
    (plain, _, steep), (loss, measured, gradient), (other, told, same) = found
    assert loss == other
    assert torch.equal(gradient, same)
    assert all(torch.equal(measured[name], told[name]) for name in measured)
    assert loss != plain and not torch.equal(gradient, steep), "or the hole is in no target that was drawn"


def test_masked_pixels_of_inputs_are_not_blended() -> None:
    """Nothing masked is left in a packed photograph; here it is, and of it only a rim, mixed with what is beside it, shows."""
    scene = toy_scene(0, 48, 36)
    target, *inputs = scene.groups["test"][0, :4].tolist()
    images, fine, alpha = scene.images.copy(), scene.fine_images.copy(), scene.alpha.copy()
    images[inputs[0]][HOLE], alpha[inputs[0]][HOLE] = (255, 0, 255), 0
    fine[inputs[0]][tuple(slice(2 * edge.start, 2 * edge.stop) for edge in HOLE)] = (255, 0, 255)
    seen = replace(scene, images=images, fine_images=fine)
    hidden = replace(seen, alpha=alpha)
    torch.manual_seed(0)
    head = build(SWEEP)
    shown, masked = (head.predict_bare(one, target, np.array(inputs)).colour.astype(int) for one in (seen, hidden))
    purple = (shown[..., 0] - shown[..., 1] > 120) & (shown[..., 2] - shown[..., 1] > 120)
    assert purple.any(), "or the hole is not in view"
    off = (masked[..., 0] - masked[..., 1] > 120) & (masked[..., 2] - masked[..., 1] > 120)
    assert off.sum() < 0.1 * purple.sum()
