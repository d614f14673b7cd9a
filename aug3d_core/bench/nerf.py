"""Benchmark the network: its speed against its plain version, and its quality on the town."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from aug3d_core.bench.figure import Figure, at_least, at_most, told
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.heads.pixelnerf.config import PRESETS, PixelNerfConfig
from aug3d_core.heads.pixelnerf.speed_job import FAST, PLAIN, SpeedJob, SpeedTold
from aug3d_core.run.helper_process import run_worker
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, Trial, directly, run_trial

SIDE_PX, RAYS, REPEATS = 64, 512, 3
SIZES = {
    "h64": {"hidden": 64, "coarse_samples": 32, "fine_samples": 8, "depth_samples": 8},
    "h256": {"hidden": 256, "coarse_samples": 64, "fine_samples": 16, "depth_samples": 16},
}
GOALS = {"h64": (3.0, 6.0), "h256": (1.4, 2.0)}  # training, rendering
EQUAL = 1e-4  # of colours in [0, 1]: 1/40 of an 8-bit step; summing in another order changes less
# The size of views that its goals were set at
AT_96_PX = (
    "training.head=pixelnerf",
    *(f"{stage}.{side}_px={px}" for stage in ("sampling", "dataset") for side, px in (("width", 96), ("height", 72))),
)
SIMPLE = ("mean_colour", "nearest_copy", "ground_homography", "plane_sweep")  # the cheap answers that need no mesh


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Measure the network on the town's data set."""
    at_96_px = Measured(scene.preset, (*AT_96_PX, *scene.overrides))
    trial = run_trial(store, "evaluation", at_96_px, (), directly(store, say))
    if trial.failure:
        return {"town_psnr": Figure(None, "dB", None, None, trial.failure)}
    packed = store.files_dir(trial.records["dataset"]) / SCENE_ZARR
    found: dict[str, Figure] = {}
    for size in SIZES:
        found |= speed_figures(packed, size, say)
    apart = max(found[f"output_max_abs_diff_{size}"].value or 0.0 for size in SIZES)
    found["output_max_abs_diff"] = at_most(EQUAL, apart, "1")
    return found | town_figures(trial)


def speed_figures(packed: Path, size: str, say: Say) -> dict[str, Figure]:
    """Compare with the plain network: one group of 3 views, the paper's network of this size, encoder frozen and trained."""
    train_goal, render_goal = GOALS[size]
    frozen = paper(SIZES[size])
    one = _measure(packed, frozen, f"network of {size}", say)
    trained = _measure(packed, frozen.model_copy(update={"encoder_frozen": False}), f"{size}, encoder trained", say)
    peaks = {way: _measure(packed, frozen, f"memory, {way}", say, way).peak_mib for way in (FAST, PLAIN)}
    rays, pixels = one.train_rays, one.render_rays
    return {
        f"train_speedup_{size}": at_least(train_goal, _ratio(one.train_seconds), "ratio"),
        f"train_speedup_{size}_encoder_trained": Figure(_ratio(trained.train_seconds), "ratio"),
        f"render_speedup_{size}": at_least(render_goal, _ratio(one.render_seconds), "ratio"),
        f"train_rays_per_cpu_second_{size}": Figure(rays / _median(one.train_seconds[FAST]), "1/s"),
        f"render_rays_per_cpu_second_{size}": Figure(pixels / _median(one.render_seconds[FAST]), "1/s"),
        f"train_peak_mib_{size}": Figure(peaks[FAST], "MiB"),
        f"train_peak_mib_{size}_plain": Figure(peaks[PLAIN], "MiB"),
        f"output_max_abs_diff_{size}": Figure(max(one.output_difference, trained.output_difference), "1"),
        f"gradient_max_rel_diff_{size}": Figure(max(one.gradient_difference, trained.gradient_difference), "1"),
    }


def town_figures(trial: Trial) -> dict[str, Figure]:
    """Compare the model with the cheap answers, and return its training time."""
    psnr, mesh = told(trial, "evaluation", "test_psnr_mean"), told(trial, "evaluation", "cheap_mesh_render")
    simple = [told(trial, "evaluation", f"cheap_{name}") for name in SIMPLE]
    over = psnr - max(answer for answer in simple if answer is not None) if psnr is not None else None
    return {
        "town_psnr": Figure(psnr, "dB"),
        "town_psnr_over_best_cheap": at_least(0.5, over, "dB"),
        "town_psnr_over_mesh_render": Figure(psnr - mesh if psnr is not None and mesh is not None else None, "dB"),
        "town_training_seconds": at_most(600.0, trial.seconds(["training"]), "s"),
        "loader_wait_share": at_most(0.05, told(trial, "training", "loader_wait_share"), "share"),
    }


def paper(changes: Mapping[str, int]) -> PixelNerfConfig:
    """Return the paper's network at another size."""
    return PRESETS["paper"]["head"].model_copy(update={**changes, "encoder_weights": "random", "rays_per_group": RAYS})


def _measure(packed: Path, config: PixelNerfConfig, what: str, say: Say, memory_of: str | None = None) -> SpeedTold:
    say("speed", 0, 1, what)
    repeats = 1 if memory_of else REPEATS
    job = SpeedJob(scene=packed, config=config, side_px=SIDE_PX, repeats=repeats, memory_of=memory_of)
    module, remedy = "aug3d_core.heads.pixelnerf.speed", "measure on a smaller town"
    answers: list[str] = []
    run_worker(module, job, answers.append, "the process that measures the network", remedy)
    return SpeedTold.model_validate_json(answers[-1])


def _ratio(seconds: Mapping[str, list[float]]) -> float:
    return _median(seconds[PLAIN]) / _median(seconds[FAST])


def _median(seconds: list[float]) -> float:
    return float(np.median(seconds))
