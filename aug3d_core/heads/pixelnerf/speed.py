"""Measure the network against its plain version: `python -m aug3d_core.heads.pixelnerf.speed job.json`.

Both do the same work with the same weights, turn by turn in one process; processor time counts.
"""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from aug3d_core.dataset.batches import Group, Wanted, draw, pixel_colours
from aug3d_core.dataset.rays import pixel_rays, view_rays
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import Scene, no_fine_images
from aug3d_core.heads.pixelnerf.compositing import Pixels
from aug3d_core.heads.pixelnerf.model import PixelNeRF, TensorRays
from aug3d_core.heads.pixelnerf.reference import encode_plainly, render_plainly
from aug3d_core.heads.pixelnerf.speed_job import FAST, PLAIN, SpeedJob, SpeedTold
from aug3d_core.run.helper_process import begin

RAYS_AT_A_TIME = 256  # when rendering: what the cache holds

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Network:
    """A way to compute what the model is: encode input views (g v), then render rays of their groups."""

    encode: Callable[[np.ndarray], Any]
    render: Callable[[np.ndarray, Any, TensorRays, torch.Generator | None], tuple[Pixels, Pixels]]


def main() -> None:
    """Measure what the job named on the command line says, and report it."""
    job, report = begin(SpeedJob)
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    scene = cropped(read(job.scene), job.side_px)
    report(measure(scene, job).model_dump_json())


def cropped(scene: Scene, side_px: int) -> Scene:
    """Return the middle square of every view."""
    top, left = (scene.height_px - side_px) // 2, (scene.width_px - side_px) // 2
    assert min(top, left) >= 0, f"views of {scene.width_px} x {scene.height_px} px are smaller than {side_px} px"
    rows, columns = slice(top, top + side_px), slice(left, left + side_px)
    return replace(
        scene,
        images=scene.images[:, rows, columns],
        fine_images=no_fine_images(len(scene), (side_px, side_px)),
        alpha=scene.alpha[:, rows, columns],
        depth=scene.depth[:, rows, columns],
        scaffold=scene.scaffold[:, rows, columns],
        intrinsics=scene.intrinsics - [0, 0, left, top],
        baseline_images=scene.baseline_images[:, rows, columns],
        baseline_alpha=scene.baseline_alpha[:, rows, columns],
    )


def measure(scene: Scene, job: SpeedJob) -> SpeedTold:
    """Train and render with both networks, turn by turn; or with one alone, for its memory."""
    model = _awake(job)
    wanted = Wanted(1, job.input_views, 0.0, job.config.rays_per_group)
    (group,) = draw([scene], wanted, np.random.default_rng(job.seed))
    networks = {
        FAST: Network(partial(model.encode, scene), lambda _, inputs, *rays: model(inputs, *rays)),
        PLAIN: Network(partial(encode_plainly, model, scene), partial(render_plainly, model, scene)),
    }
    if job.memory_of:
        networks = {job.memory_of: networks[job.memory_of]}
    whole = TensorRays.of(view_rays(scene, int(group.inputs[0]), job.config.slab_bounds), 1)
    steps = {name: partial(_step, model, network, scene, group) for name, network in networks.items()}
    views = {name: partial(_view, model, network, group.inputs[None], whole) for name, network in networks.items()}
    trained, train_seconds = _turns(steps, job.repeats)
    rendered, render_seconds = _turns(views, job.repeats)
    apart = (0.0, 0.0)
    if not job.memory_of:
        colours = [(trained[FAST][0], trained[PLAIN][0]), (rendered[FAST], rendered[PLAIN])]
        apart = max((a - b).abs().max().item() for a, b in colours), _apart(trained[FAST][1], trained[PLAIN][1])
    return SpeedTold(
        train_seconds=train_seconds,
        render_seconds=render_seconds,
        train_rays=wanted.pixels or 0,
        render_rays=whole.near.numel(),
        output_difference=apart[0],
        gradient_difference=apart[1],
        peak_mib=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


def _awake(job: SpeedJob) -> PixelNeRF:
    """Return a network in which no layer is still zero, as after some training: nothing is hidden by it."""
    torch.manual_seed(job.seed)
    model = PixelNeRF(job.config)
    with torch.no_grad():
        for parameter in model.parameters():
            if not parameter.any():
                parameter.normal_(0, 0.02)
    return model


def _step(model: PixelNeRF, network: Network, scene: Scene, group: Group) -> tuple[Tensor, dict[str, Tensor]]:
    """Return the colours of a training step's rays, and the gradients."""
    model.train().zero_grad(set_to_none=True)
    assert group.pixels is not None
    truth = torch.from_numpy(pixel_colours(scene, group.pixels)[0].astype(np.float32))
    noise, views = torch.Generator().manual_seed(0), group.inputs[None]
    lines = pixel_rays(scene, group.pixels[:, 0], group.pixels[:, 1:] + 0.5, model.config.slab_bounds)
    coarse, fine = network.render(views, network.encode(views), TensorRays.of(lines, 1), noise)
    (((coarse.colour - truth) ** 2).mean() + ((fine.colour - truth) ** 2).mean()).backward()
    gradients = {name: p.grad.clone() for name, p in model.named_parameters() if p.grad is not None}
    return fine.colour.detach(), gradients


@torch.inference_mode()
def _view(model: PixelNeRF, network: Network, views: np.ndarray, rays: TensorRays) -> Tensor:
    """Return the colours of a whole view; both networks take its rays in parts of the same size."""
    model.eval()
    encoded = network.encode(views)
    parts = (part.split(RAYS_AT_A_TIME, dim=1) for part in (rays.origins, rays.directions, rays.near, rays.far))
    some = (TensorRays(*part) for part in zip(*parts, strict=True))
    return torch.cat([network.render(views, encoded, rays, None)[1].colour for rays in some])


def _turns(ways: dict[str, Callable[[], Answer]], repeats: int) -> tuple[dict[str, Answer], dict[str, list[float]]]:
    """Run every way once for warmth, then all by turns; return what the first runs gave, and the seconds of the others."""
    answers = {name: way() for name, way in ways.items()}
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            start = time.process_time()
            way()
            seconds[name].append(time.process_time() - start)
    return answers, seconds


def _apart(one: dict[str, Tensor], other: dict[str, Tensor]) -> float:
    """Return the largest difference within a parameter's gradient, over its largest value."""
    assert one.keys() == other.keys()
    return max(
        ((one[name] - grad).abs().max() / grad.abs().max().clamp(min=1e-12)).item() for name, grad in other.items()
    )


if __name__ == "__main__":
    main()
