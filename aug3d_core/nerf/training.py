"""The training loop.

Step n draws its batch and its noise from the seed and n alone, so a run resumed from a checkpoint goes on as if it had
never been killed, and two runs with the same seed, threads and machine end in the same bits.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from aug3d_core.dataset.scene import Scene
from aug3d_core.errors import InputError
from aug3d_core.nerf.batch import Batch, check_groups, draw
from aug3d_core.nerf.checkpoint import load_state, save_state
from aug3d_core.nerf.config import TrainingConfig
from aug3d_core.nerf.model import PixelNeRF, TensorRays

MAX_GRADIENT = 1.0  # norm at which gradients are clipped; a single bad batch must not undo the others


@dataclass
class Run:
    """A training run under way: the model, its optimiser, and what every step measured."""

    model: PixelNeRF
    optimiser: torch.optim.Adam
    losses: list[float] = field(default_factory=list)  # coarse + fine mean squared error
    errors: list[float] = field(default_factory=list)  # fine mean squared error
    seconds: float = 0.0

    def state(self, config: TrainingConfig) -> dict[str, object]:
        """Return all that a later process needs to go on."""
        return {
            "config": config.model_dump(mode="json"),
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "losses": self.losses,
            "errors": self.errors,
            "seconds": self.seconds,
        }


def train(
    scene: Scene, config: TrainingConfig, checkpoints: Path, report: Callable[[Run], None] = lambda run: None
) -> Run:
    """Train across the scene's groups, from the last checkpoint if there is one."""
    check_groups(scene, config)
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    run = _resume(config, checkpoints)
    while len(run.losses) < config.steps:
        start = time.monotonic()
        take_step(run, scene, config, len(run.losses))
        run.seconds += time.monotonic() - start
        if len(run.losses) % config.checkpoint_every == 0:
            save_state(checkpoints, run.state(config))
        report(run)
    return run


def rate(config: TrainingConfig, step: int) -> float:
    """Return the learning rate: a linear warm-up, then half a cosine down to the last."""
    if step < config.warmup_steps:
        return config.learning_rate * (step + 1) / config.warmup_steps
    done = (step - config.warmup_steps) / max(config.steps - config.warmup_steps, 1)
    last = config.final_rate_share
    return config.learning_rate * (last + (1 - last) * (1 + math.cos(math.pi * done)) / 2)


def _resume(config: TrainingConfig, checkpoints: Path) -> Run:
    torch.manual_seed(config.seed)
    model = PixelNeRF(config).train()
    run = Run(model, torch.optim.Adam(model.parameters(), lr=config.learning_rate))
    state = load_state(checkpoints)
    if state is None:
        return run
    if state.get("config") != config.model_dump(mode="json"):
        raise InputError("the checkpoint is of another configuration", f"delete {checkpoints} to train from the start")
    model.load_state_dict(state["model"])
    run.optimiser.load_state_dict(state["optimiser"])
    run.losses, run.errors, run.seconds = state["losses"], state["errors"], state["seconds"]
    return run


def take_step(run: Run, scene: Scene, config: TrainingConfig, step: int) -> None:
    """Draw a batch, improve the model by it, and note its errors; raise InputError if they are not finite."""
    batch = draw(scene, config, np.random.default_rng([config.seed, step]))
    noise = torch.Generator().manual_seed(config.seed * 1_000_003 + step)
    for group in run.optimiser.param_groups:
        group["lr"] = rate(config, step)
    inputs = run.model.encode(scene, batch.inputs)
    coarse, fine = run.model(inputs, TensorRays.of(batch.rays, len(batch.inputs)), noise)
    coarse_error, fine_error = (_error(pixels.colour, batch) for pixels in (coarse, fine))
    loss = coarse_error + fine_error
    if not math.isfinite(loss.item()):
        raise InputError(
            f"training diverged: the loss at step {step} is {loss.item()}",
            f"lower learning_rate (now {config.learning_rate:g}) or raise warmup_steps (now {config.warmup_steps})",
        )
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(run.model.parameters(), MAX_GRADIENT)
    run.optimiser.step()
    run.losses.append(loss.item())
    run.errors.append(fine_error.item())


def _error(colour: Tensor, batch: Batch) -> Tensor:
    """Return the mean squared error over rays that have a truth."""
    truth = torch.from_numpy(batch.colour.astype(np.float32))
    weight = torch.from_numpy(batch.weight.astype(np.float32))
    return (((colour - truth) ** 2).mean(dim=-1) * weight).sum() / weight.sum().clamp(min=1)
