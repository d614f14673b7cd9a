"""The figures that stand for a whole test. Free of torch, so that a report can take them over several folds."""

from __future__ import annotations

import numpy as np
import pandas as pd
from jaxtyping import Float

from aug3d_core.judging.config import EvaluationConfig

FROM_MESH = ("mesh_render", "guided_blend")  # cheap answers made from all photographs but the targets
CHEAP = ("mean_colour", "nearest_copy", "ground_homography", "plane_sweep", "mesh_render", "guided_blend")


def summary(table: pd.DataFrame, config: EvaluationConfig) -> dict[str, float]:
    """Return the figures that stand for the whole test: means with interval, groups, cheap answers."""
    column = {name: np.asarray(values, float) for name, values in table.select_dtypes("number").items()}
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
        "test_flip_mean": float(column["flip"].mean()),
        **{f"{name}_psnr_mean": float(column[f"{name}_psnr"].mean()) for name in parts_of(table)},
        "group_best": float(groups.max()),
        "group_low": float(groups.min()),
        "group_average": float(groups.mean()),
        **cheap,
        **{
            f"cheap_{name}_{score}": float(column[f"{name}_{score}"].mean())
            for name in CHEAP
            for score in ("ssim", "flip")
        },
        "over_best_cheap_db": float(scores.mean() - max(cheap.values())),
        **_leads(table, config),
    }
    return {"test_views": len(table)} | {name: round(value, 4) for name, value in figures.items()}


def lead(table: pd.DataFrame, answer: str, other: str, config: EvaluationConfig) -> tuple[float, float, float]:
    """Return how far a column is above another [dB]: the mean, and its 95 % interval, paired and over groups."""
    difference = np.asarray(table[answer], float) - np.asarray(table[other], float)
    groups = np.asarray(table["group"])
    each = np.array([difference[groups == group].mean() for group in np.unique(groups)])
    low, high = bootstrap(each, config.resamples, np.random.default_rng(config.seed))
    return float(difference.mean()), low, high


def _leads(table: pd.DataFrame, config: EvaluationConfig) -> dict[str, float]:
    figures = {}
    for name in CHEAP:
        _, low, high = lead(table, "psnr", f"{name}_psnr", config)
        figures |= {f"over_{name}_ci_low": low, f"over_{name}_ci_high": high}
    return figures


def parts_of(table: pd.DataFrame) -> list[str]:
    """Return the names of the pictures that the head made on the way: scored, and neither its answer nor a cheap one."""
    scored = [name.removesuffix("_psnr") for name in table.columns if name.endswith("_psnr")]
    return [name for name in scored if name not in CHEAP]


def bootstrap(values: Float[np.ndarray, " g"], resamples: int, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of the mean over groups, drawn with replacement."""
    means = rng.choice(values, (resamples, len(values))).mean(axis=1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))
