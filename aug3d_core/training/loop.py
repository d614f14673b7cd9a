"""The training loop.

Step n draws its batch and its noise from the seed, the restarts so far and n alone, so a run resumed from a checkpoint
goes on as if it had never been killed, and two runs with the same seed, threads and machine end in the same bits.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from aug3d_core.dataset.batches import check_groups
from aug3d_core.dataset.scene import Scene
from aug3d_core.run.errors import InputError
from aug3d_core.training.ahead import Ahead
from aug3d_core.training.checkpoint import forget_after, load_state, save_state, saved_steps
from aug3d_core.training.config import TrainingConfig
from aug3d_core.training.ddp import ALONE, Team
from aug3d_core.training.divergence import Trouble, find_trouble
from aug3d_core.training.loss_step import Step
from aug3d_core.training.schedule import Probe, enough, last_step, probe_due, rate
from aug3d_core.training.state import Restart, Run, begin, begin_again, start

MOST_RESTARTS = 3
BEFORE = 50  # steps before the onset of trouble within which a state is not trusted any more
PROBE_SEEDS = (MOST_RESTARTS + 1, MOST_RESTARTS + 2)  # of two batches, unlike those that steps draw


def train(
    scenes: Sequence[Scene],
    config: TrainingConfig,
    checkpoints: Path,
    report: Callable[[Run], None] = lambda run: None,
    team: Team = ALONE,
) -> Run:
    """Train across the groups of scenes, from the last checkpoint that is whole if there is one, until it is enough.

    Raises InputError if training runs into trouble again and again.
    """
    check_groups(scenes, config.wanted)
    torch.set_num_threads(max(len(os.sched_getaffinity(0)) // team.size, 1))
    run = begin(config, team.device)
    if not _go_on(run, checkpoints, saved_steps(checkpoints)):
        start(run)
    step, batches = team.wrap(Step(run.head, scenes)), Ahead(scenes, config.wanted, team.share)
    while run.step < last_step(config, run.tail_from):
        take_step(run, step, batches, config, team)
        trouble = find_trouble(run.history, run.head.symptoms)
        if trouble:
            _start_again(run, trouble, config, checkpoints, team)
            continue
        if probe_due(config, run.step):
            _probe(run, step, batches, config, team)
        if team.leads and run.step % config.checkpoint_every == 0:
            save_state(checkpoints, run.step, run.state())
        report(run)
    run.head.finish()
    return run


def take_step(run: Run, step: nn.Module, batches: Ahead, config: TrainingConfig, team: Team) -> None:
    """Draw groups, improve the model by them, and note what they showed."""
    begun = time.monotonic()
    seeds = [config.seed, len(run.restarts), run.step]
    groups = batches.draw(seeds)
    drawn = time.monotonic()
    for parameters in run.optimiser.param_groups:
        parameters["lr"] = rate(config, run.step, run.tail_from, len(run.restarts))
    loss, measured = step(groups, noise_of([*seeds, team.rank]))
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    trained = run.optimiser.param_groups[0]["params"]
    gradient = nn.utils.clip_grad_norm_(trained, config.max_gradient_norm or math.inf)
    run.optimiser.step()
    run.history.append({**_means(measured, team), "gradient": gradient.item()})
    run.waited += drawn - begun
    run.seconds += time.monotonic() - begun


def noise_of(seeds: list[int]) -> torch.Generator:
    """Return where a step's samples come from."""
    return torch.Generator().manual_seed(int(np.random.SeedSequence(seeds).generate_state(1)[0]))


def _means(measured: Mapping[str, Tensor], team: Team) -> dict[str, float]:
    """Average the measures of a step over the team, in one exchange."""
    return dict(zip(measured, team.mean(torch.stack(list(measured.values()))).tolist(), strict=True))


def _go_on(run: Run, checkpoints: Path, steps: list[int]) -> bool:
    """Take over the newest of these states that is not damaged; say whether there was one."""
    for step in reversed(steps):
        try:
            state = load_state(checkpoints, step)
        except InputError as error:
            print(f"{error.problem}: an older one is tried", flush=True)  # into the stage's log
            continue
        _take_over(run, checkpoints, state)
        return True
    return False


def _take_over(run: Run, checkpoints: Path, state: dict[str, Any]) -> None:
    if state.get("config") != run.config.model_dump(mode="json"):
        raise InputError("the checkpoint is of another configuration", f"delete {checkpoints} to train from the start")
    run.load(state)


def _start_again(run: Run, trouble: Trouble, config: TrainingConfig, checkpoints: Path, team: Team) -> None:
    """Go back to a state from before the trouble, and on from it more slowly, with other batches and noise.

    A state that led into trouble once is not tried twice: without a newer one, an older one is.
    """
    past = run.restarts
    if len(past) == MOST_RESTARTS:
        raise InputError(
            f"training cannot go on: {trouble.what} at step {trouble.seen_at}, after {MOST_RESTARTS} restarts and with"
            f" the learning rate down at {config.learning_rate / 3**MOST_RESTARTS:.2g}",
            f"lower learning_rate (now {config.learning_rate:g}) or raise warmup_steps (now {config.warmup_steps})",
        )
    tried = past[-1].again_from if past else 0
    good = [step for step in saved_steps(checkpoints) if step <= trouble.onset - BEFORE and step != tried]
    if not _go_on(run, checkpoints, good):
        begin_again(run)
    run.restarts = [*past, Restart(trouble, run.step)]
    team.wait()  # nobody may remove what another has yet to read
    if team.leads:
        forget_after(checkpoints, run.step)
        save_state(checkpoints, run.step, run.state())


def _probe(run: Run, step: nn.Module, batches: Ahead, config: TrainingConfig, team: Team) -> None:
    """Measure the error on fixed groups; if training has learned enough, begin the tail."""
    with torch.no_grad():
        run.head.eval()
        errors = [_means(step(batches.fixed([config.seed, n]), None)[1], team)["error"] for n in PROBE_SEEDS]
        run.head.train()
    run.probes.append(Probe(run.step, -10 * math.log10(max(float(np.mean(errors)), 1e-10))))
    if run.tail_from is None and enough(config, run.probes):
        run.tail_from = run.step
