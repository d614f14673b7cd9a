"""Steps and views of the heads on a device of one's choice, timed one by one."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, UInt8

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.reader import read
from aug3d_core.heads.saved import load
from aug3d_core.heads.sweep.config import SHIPPED
from aug3d_core.training.ahead import Ahead
from aug3d_core.training.config import TrainingConfig, presets
from aug3d_core.training.ddp import ALONE
from aug3d_core.training.loop import take_step
from aug3d_core.training.loss_step import Step
from aug3d_core.training.state import Run, begin, start

_WARM = 3  # steps or views before those that count: memory is asked for, kernels are chosen
_INPUTS, _VIEWS, _REPEATED = 3, 12, 10


@dataclass(frozen=True)
class Steps:
    """Wall seconds of training steps, and the most memory that torch had on the GPU."""

    seconds: Float[np.ndarray, " n"]
    gpu_peak_mib: float


@dataclass(frozen=True)
class Views:
    """Wall seconds of predicted views, and the views."""

    seconds: Float[np.ndarray, " n"]
    colours: UInt8[np.ndarray, "n h w 3"]


def gpu_here() -> bool:
    """Return whether torch sees a CUDA GPU."""
    return torch.cuda.is_available()


def steps_of(packed: Path, preset: str, head: str, steps: int, device: str, cores: int) -> Steps:
    """Train on a packed town, and time each step: its loss and its gradient are numbers on the CPU when it ends."""
    config = presets(head)[preset]
    if device == "cuda":  # kernels are chosen for each new size of arrays, once
        _trained(packed, config, _WARM + steps, device, cores)
    _, seconds = _trained(packed, config, _WARM + steps, device, cores)
    peak = torch.cuda.max_memory_allocated() / 2**20 if device == "cuda" else 0.0
    return Steps(np.array(seconds[_WARM:]), peak)


def repeated(packed: Path, device: str) -> float:
    """Take the same steps twice; return how far apart the weights end, over their size: a GPU adds in no fixed order."""
    ends = []
    for _ in range(2):
        run, _ = _trained(packed, presets("sweep")["tiny"], _REPEATED, device, 1)
        ends.append(torch.cat([value.detach().flatten() for value in run.head.parameters()]))
    return float((ends[0] - ends[1]).norm() / ends[0].norm())


def views_of(packed: Path, device: str, cores: int) -> Views:
    """Predict test views from three inputs alone with the shipped weights."""
    torch.set_num_threads(cores)
    scene, head = read(packed / SCENE_ZARR), load(SHIPPED).to(device)
    free = replace(scene, scaffold=np.zeros_like(scene.scaffold))
    groups = free.groups["test"]
    seconds, colours = [], []
    for members in groups[np.arange(_WARM + _VIEWS) % len(groups)]:
        begun = time.perf_counter()
        view = head.predict_bare(free, int(members[0]), members[1 : 1 + _INPUTS])  # ends in arrays on the CPU
        seconds.append(time.perf_counter() - begun)
        colours.append(view.colour)
    return Views(np.array(seconds[_WARM:]), np.stack(colours[_WARM:]))


def _trained(packed: Path, config: TrainingConfig, steps: int, device: str, cores: int) -> tuple[Run, list[float]]:
    torch.set_num_threads(cores)
    scenes = [read(packed / SCENE_ZARR)]
    if "encoder_weights" in type(config.head).model_fields:  # the file of an encoder makes no step faster
        config = config.model_copy(update={"head": config.head.model_copy(update={"encoder_weights": "random"})})
    run = begin(config, torch.device(device))
    start(run)
    step, batches = Step(run.head, scenes), Ahead(scenes, config.wanted, ALONE.share)
    seconds = []
    for _ in range(steps):
        begun = time.perf_counter()
        take_step(run, step, batches, config, ALONE)
        seconds.append(time.perf_counter() - begun)
    return run, seconds
