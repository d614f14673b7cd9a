"""What one training step sees: groups, some of their members as inputs, and rays of the others (all in numpy)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from aug3d_core.dataset.rays import Rays, pixel_rays
from aug3d_core.dataset.scene import Scene
from aug3d_core.heads.pixelnerf.config import TrainingConfig
from aug3d_core.run.errors import InputError


@dataclass(frozen=True)
class Batch:
    """Groups of a step: the inputs of each, and the rays of its targets (group after group)."""

    inputs: Int[np.ndarray, "g v"]
    rays: Rays
    colour: Float[np.ndarray, "r 3"]  # truth in [0, 1]
    weight: Float[np.ndarray, " r"]  # 0 where a render shows nothing


def check_groups(scene: Scene, config: TrainingConfig) -> None:
    """Raise InputError unless every group set to be drawn from can give inputs and at least one target."""
    sets = _sets(scene, config)
    if not sets:
        raise InputError("the data set has no training group", "give the scene more photographs that overlap")
    for name in sets:
        members = scene.groups[name].shape[1]
        if config.input_views >= members:
            raise InputError(
                f"input_views = {config.input_views} leaves no target in the {members} members of groups/{name}",
                f"set input_views below {members}, or group more views together",
            )


def draw(scene: Scene, config: TrainingConfig, rng: np.random.Generator) -> Batch:
    """Draw a training step."""
    sets = _sets(scene, config)
    shares = [config.rendered_share if name == "rendered" else 1 - config.rendered_share for name in sets]
    shares = np.array(shares if len(sets) > 1 else [1.0])
    inputs, targets = [], []
    for _ in range(config.groups_per_step):
        groups = scene.groups[sets[rng.choice(len(sets), p=shares)]]
        order = rng.permutation(groups[rng.integers(len(groups))])
        inputs.append(order[: config.input_views])
        targets.append(rng.choice(order[config.input_views :], config.rays_per_group))
    return _rays(scene, config, np.stack(inputs), np.concatenate(targets), rng)


def _rays(
    scene: Scene, config: TrainingConfig, inputs: np.ndarray, view: np.ndarray, rng: np.random.Generator
) -> Batch:
    x, y = rng.integers(scene.width_px, size=len(view)), rng.integers(scene.height_px, size=len(view))
    rays = pixel_rays(scene, view, np.stack([x, y], axis=1) + 0.5, config.slab_bounds)
    return Batch(inputs, rays, scene.images[view, y, x] / 255.0, (scene.alpha[view, y, x] >= 128).astype(float))


def _sets(scene: Scene, config: TrainingConfig) -> list[str]:
    """Return the group sets to draw from: those that exist and have a share."""
    wanted = [("real", 1 - config.rendered_share), ("rendered", config.rendered_share)]
    found = [name for name, share in wanted if share > 0 and len(scene.groups[name])]
    return found or [name for name, _ in wanted if len(scene.groups[name])]
