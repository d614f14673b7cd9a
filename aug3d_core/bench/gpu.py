"""What a CUDA GPU adds: training and views beside this machine's processors, memory, and how far apart the answers are."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from aug3d_core.bench.figure import Figure, at_least, in_own_process
from aug3d_core.bench.gpu_job import gpu_here, repeated, steps_of, views_of
from aug3d_core.judging.scores import psnr
from aug3d_core.run.errors import InputError
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial
from aug3d_core.training.config import presets

WIDTHS = (256, 512)  # of views, px
GOAL_TRAINING, GOAL_VIEWS = 10.0, 20.0  # times two cores; of 512 x 384 px, 1/s
ALIKE_DB = 50.0  # between the views of GPU and CPU: here and there one step of 8 bits
COMPARED = (("tiny", 256, 20), ("small", 512, 6))  # presets of the plane sweep, px, steps
PAPER = (("sweep", 10), ("pixelnerf", 20))  # heads with the paper's preset, steps: on the GPU alone
TWO = 2  # cores


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Pack the town at both sizes, and measure on it; raises InputError where there is no GPU."""
    if not in_own_process(gpu_here):
        raise InputError(
            "torch sees no CUDA GPU: there is nothing to measure",
            "run `aug3d doctor`, which tells whether there is a GPU and whether this torch was built for one",
        )
    packed: dict[int, Path] = {}
    for width in WIDTHS:
        size = (f"dataset.width_px={width}", f"dataset.height_px={width * 3 // 4}")
        measured = Measured(scene.preset, (*scene.overrides, *size))
        trial = run_trial(store, "dataset", measured, (), directly(store, say))
        if trial.failure:
            return {"gpu": Figure(None, "", None, None, trial.failure)}
        packed[width] = store.files_dir(trial.records["dataset"])
    return measure(packed, say)


def measure(packed: Mapping[int, Path], say: Say) -> dict[str, Figure]:
    """Measure on data sets by the width of their views, each part in a process of its own."""
    found: dict[str, Figure] = {}
    for preset, width, steps in COMPARED:
        say("gpu", 0, 1, f"training, preset {preset}")
        found |= training_figures(packed[width], preset, steps)
    for head, steps in PAPER:
        say("gpu", 0, 1, f"training, preset paper, {head}")
        found |= paper_figures(packed[max(WIDTHS)], head, steps)
    for width in WIDTHS:
        say("gpu", 0, 1, f"views of {width} px")
        found |= view_figures(packed[width], width)
    apart = in_own_process(partial(repeated, packed[min(WIDTHS)], "cuda"))
    return found | {"repeated_weights_rel_diff": Figure(apart, "1")}


def training_figures(packed: Path, preset: str, steps: int) -> dict[str, Figure]:
    """Take the same steps of the plane sweep on the GPU, on two cores and on all: medians, and of the ratios step by step."""
    timed = partial(steps_of, packed, preset, "sweep", steps)
    cores = len(os.sched_getaffinity(0))
    gpu, two, all_ = (in_own_process(partial(timed, *on)) for on in (("cuda", TWO), ("cpu", TWO), ("cpu", cores)))
    return {
        f"train_step_seconds_{preset}": Figure(_median(gpu.seconds), "s"),
        f"train_step_seconds_{preset}_2_cores": Figure(_median(two.seconds), "s"),
        f"train_step_seconds_{preset}_all_cores": Figure(_median(all_.seconds), "s"),
        f"train_speedup_{preset}_over_2_cores": at_least(GOAL_TRAINING, _median(two.seconds / gpu.seconds), "ratio"),
        f"train_speedup_{preset}_over_all_cores": Figure(_median(all_.seconds / gpu.seconds), "ratio"),
        f"train_gpu_peak_mib_{preset}": Figure(gpu.gpu_peak_mib, "MiB"),
    }


def paper_figures(packed: Path, head: str, steps: int) -> dict[str, Figure]:
    """Take some steps of the paper's preset on the GPU; what all of them take follows from the median."""
    timed = in_own_process(partial(steps_of, packed, "paper", head, steps, "cuda", TWO))
    each = _median(timed.seconds)
    return {
        f"train_step_seconds_paper_{head}": Figure(each, "s"),
        f"train_hours_paper_{head}": Figure(each * presets(head)["paper"].steps / 3600, "h"),
        f"train_gpu_peak_mib_paper_{head}": Figure(timed.gpu_peak_mib, "MiB"),
    }


def view_figures(packed: Path, width: int) -> dict[str, Figure]:
    """Predict test views from three inputs alone with the shipped weights, on the GPU and on two cores, and compare them."""
    gpu, cpu = (in_own_process(partial(views_of, packed, device, TWO)) for device in ("cuda", "cpu"))
    rate = 1 / _median(gpu.seconds)
    alike = min(psnr(one, other) for one, other in zip(cpu.colours, gpu.colours, strict=True))
    return {
        f"views_per_second_{width}": at_least(GOAL_VIEWS, rate, "1/s") if width == 512 else Figure(rate, "1/s"),
        f"views_per_second_{width}_2_cores": Figure(1 / _median(cpu.seconds), "1/s"),
        f"views_alike_db_{width}": at_least(ALIKE_DB, alike, "dB"),
    }


def _median(seconds: np.ndarray) -> float:
    return float(np.median(seconds))
