"""Race the small network against the paper's, plainly computed: `python -m aug3d_core.nerf.race job.json`.

The paper's is trained for a while and judged on held-out photographs; then the small one is trained until it is as good.
Only time spent training counts, not time spent judging.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import numpy as np
import torch

from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import Scene
from aug3d_core.nerf.batch import draw
from aug3d_core.nerf.config import EvaluationConfig, TrainingConfig
from aug3d_core.nerf.evaluation import evaluate
from aug3d_core.nerf.model import PixelNeRF, TensorRays
from aug3d_core.nerf.reference import encode_plainly, render_plainly
from aug3d_core.nerf.run import Run
from aug3d_core.nerf.run import begin as begin_run
from aug3d_core.nerf.speed_job import RaceJob, RaceTold
from aug3d_core.nerf.training import train
from aug3d_core.worker import begin

JUDGED_AFTER = 1.5  # times as many steps as before


class _AsGood(Exception):
    """The small network has caught up."""


def main() -> None:
    """Run the race of the job named on the command line, and report its end."""
    job, report = begin(RaceJob)
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    scene = read(job.scene)
    plain = train_plainly(scene, job.plain, job.seconds)
    goal = test_psnr(plain.model, scene)
    fast, reached = catch_up(scene, job.fast, goal)
    report(
        RaceTold(
            plain_psnr=goal,
            plain_seconds=plain.seconds,
            plain_steps=len(plain.losses),
            fast_psnr=reached,
            fast_seconds=fast.seconds if reached >= goal else None,
            fast_steps=fast.step,
        ).model_dump_json()
    )


class Plain:
    """A plain training run: the model, its losses, and the seconds it took."""

    def __init__(self, model: PixelNeRF) -> None:
        self.model = model
        self.losses: list[float] = []
        self.seconds = 0.0


def train_plainly(scene: Scene, config: TrainingConfig, seconds: float) -> Plain:
    """Train as the paper does, for at least one step and until time is up: Adam at one rate, the sum of both errors."""
    begun = begin_run(config, torch.device("cpu"))
    run, start = Plain(begun.model), time.monotonic()
    while not run.losses or run.seconds < seconds:
        step = len(run.losses)
        batch = draw(scene, config, np.random.default_rng([config.seed, step]))
        truth = torch.from_numpy(batch.colour.astype(np.float32))
        weight = torch.from_numpy(batch.weight.astype(np.float32))[:, None]
        maps = encode_plainly(run.model, scene, batch.inputs)
        rays, noise = TensorRays.of(batch.rays, len(batch.inputs)), torch.Generator().manual_seed(step)
        coarse, fine = render_plainly(run.model, scene, batch.inputs, maps, rays, noise)
        loss = sum(((pixels.colour - truth) ** 2 * weight).mean() for pixels in (coarse, fine))
        assert isinstance(loss, torch.Tensor)
        begun.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        begun.optimiser.step()
        run.losses.append(loss.item())
        run.seconds = time.monotonic() - start
    return run


def catch_up(scene: Scene, config: TrainingConfig, goal: float) -> tuple[Run, float]:
    """Train until the test PSNR is at least the goal, or training ends; return the run and the last PSNR."""
    reached, judged, last = -np.inf, 0.0, None

    def judge(run: Run) -> None:
        nonlocal reached, judged, last
        last = run
        if run.step > judged * JUDGED_AFTER:
            judged, reached = run.step, test_psnr(run.model, scene)
            if reached >= goal:
                raise _AsGood

    with tempfile.TemporaryDirectory() as folder:
        try:
            run = train(scene, config, Path(folder), judge)
        except _AsGood:
            assert last is not None
            return last, reached
        return run, test_psnr(run.model, scene)


def test_psnr(model: PixelNeRF, scene: Scene) -> float:
    """Return the mean over held-out photographs, dB; the model goes on in the mode that it was in."""
    training = model.training
    table = evaluate(model.eval(), scene, EvaluationConfig())
    model.train(training)
    return float(np.mean(table["psnr"].to_numpy()))


if __name__ == "__main__":
    main()
