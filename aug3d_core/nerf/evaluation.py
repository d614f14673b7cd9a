"""Scores of the model and of the cheap answers on held-out photographs, on 8-bit images."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from jaxtyping import Float, UInt8
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from aug3d_core.dataset.scene import Scene
from aug3d_core.errors import InputError
from aug3d_core.nerf.baselines import cheap_answers
from aug3d_core.nerf.config import EvaluationConfig
from aug3d_core.nerf.model import PixelNeRF
from aug3d_core.nerf.prediction import Prediction, predict

CHEAP = ("mean_colour", "nearest_copy", "ground_homography", "mesh_render")
BEST_DB = 100.0  # PSNR of an exact answer, which has no PSNR


def evaluate(
    model: PixelNeRF,
    scene: Scene,
    config: EvaluationConfig,
    seen: Callable[[int, Prediction, dict[str, np.ndarray]], None] = lambda group, prediction, answers: None,
) -> pd.DataFrame:
    """Predict the target of every test group; one row each with the scores of every answer."""
    test = scene.groups["test"]
    if not len(test):
        raise InputError(
            "the data set has no test group", "give the scene more photographs, so that some can be held out"
        )
    if config.input_views >= test.shape[1]:
        raise InputError(
            f"input_views = {config.input_views}, but a test group has {test.shape[1] - 1} support views",
            f"set input_views to at most {test.shape[1] - 1}",
        )
    rows = []
    for group, members in enumerate(test):
        target, inputs = int(members[0]), members[1 : 1 + config.input_views]
        prediction = predict(model, scene, target, inputs, config.rays_per_batch)
        answers = cheap_answers(scene, target, inputs)
        rows.append(
            {"group": group, "photo_id": int(scene.photo_id[target])} | _scores(scene, target, prediction, answers)
        )
        seen(group, prediction, answers)
    return pd.DataFrame(rows)


def _scores(scene: Scene, target: int, prediction: Prediction, answers: dict[str, np.ndarray]) -> dict[str, float]:
    truth = scene.images[target]
    scores = {"psnr": psnr(truth, prediction.fine), "ssim": ssim(truth, prediction.fine)}
    scores["coarse_psnr"] = psnr(truth, prediction.coarse)
    for name in CHEAP:
        scores |= {f"{name}_psnr": psnr(truth, answers[name]), f"{name}_ssim": ssim(truth, answers[name])}
    return scores


def summary(table: pd.DataFrame, config: EvaluationConfig) -> dict[str, float]:
    """Return the figures that stand for the whole test: means with interval, groups, cheap answers."""
    column = {name: np.asarray(table[name], float) for name in table.columns}
    scores = column["psnr"]
    groups = np.array([scores[column["group"] == group].mean() for group in np.unique(column["group"])])
    low, high = bootstrap(groups, config.resamples, np.random.default_rng(config.seed))
    cheap = {f"cheap_{name}": float(column[f"{name}_psnr"].mean()) for name in CHEAP}
    figures = {
        "test_psnr_mean": float(scores.mean()),
        "test_psnr_ci_low": low,
        "test_psnr_ci_high": high,
        "test_psnr_median": float(np.median(scores)),
        "test_psnr_p5": float(np.quantile(scores, 0.05)),
        "test_psnr_best": float(scores.max()),
        "test_psnr_worst": float(scores.min()),
        "test_ssim_mean": float(column["ssim"].mean()),
        "coarse_psnr_mean": float(column["coarse_psnr"].mean()),
        "group_best": float(groups.max()),
        "group_low": float(groups.min()),
        "group_average": float(groups.mean()),
        **cheap,
        **{f"cheap_{name}_ssim": float(column[f"{name}_ssim"].mean()) for name in CHEAP},
        "over_best_cheap_db": float(scores.mean() - max(cheap.values())),
    }
    return {"test_views": len(table)} | {name: round(value, 4) for name, value in figures.items()}


def bootstrap(values: Float[np.ndarray, " g"], resamples: int, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of the mean over groups, drawn with replacement."""
    means = rng.choice(values, (resamples, len(values))).mean(axis=1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))


def psnr(truth: UInt8[np.ndarray, "h w 3"], answer: UInt8[np.ndarray, "h w 3"]) -> float:
    """Return the PSNR in dB, at most BEST_DB."""
    if np.array_equal(truth, answer):
        return BEST_DB
    return float(peak_signal_noise_ratio(truth, answer, data_range=255))


def ssim(truth: UInt8[np.ndarray, "h w 3"], answer: UInt8[np.ndarray, "h w 3"]) -> float:
    """Return the mean structural similarity over channels, windows of 7 px."""
    return float(np.asarray(structural_similarity(truth, answer, data_range=255, channel_axis=-1)))
