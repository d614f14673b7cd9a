"""The figures that stand for a whole test. Free of torch, so that a report can take them over several folds."""

from __future__ import annotations

import numpy as np
import pandas as pd
from jaxtyping import Float

FROM_MESH = ("mesh_render", "guided_blend")  # cheap answers made from all photographs but the targets
CHEAP = ("mean_colour", "nearest_copy", "ground_homography", "plane_sweep", "mesh_render", "guided_blend")


def summary(table: pd.DataFrame) -> dict[str, float | None]:
    """Return the figures that stand for the whole test: means with interval, groups, cheap answers.

    None for the ends of the intervals where there is one group only.
    """
    column = {name: np.asarray(values, float) for name, values in table.select_dtypes("number").items()}
    scores = column["psnr"]
    groups = np.array([scores[column["group"] == group].mean() for group in np.unique(column["group"])])
    low, high = interval(groups) or (None, None)
    cheap = {f"cheap_{name}": float(column[f"{name}_psnr"].mean()) for name in CHEAP}
    figures: dict[str, float | None] = {
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
        **_leads(table),
    }
    rounded = {name: value if value is None else round(value, 4) for name, value in figures.items()}
    return {"test_views": len(table)} | rounded


def lead(table: pd.DataFrame, answer: str, other: str) -> tuple[float, tuple[float, float] | None]:
    """Return how far a column is above another [dB]: the mean, and its `interval`, paired and over groups."""
    difference = np.asarray(table[answer], float) - np.asarray(table[other], float)
    groups = np.asarray(table["group"])
    each = np.array([difference[groups == group].mean() for group in np.unique(groups)])
    return float(difference.mean()), interval(each)


def _leads(table: pd.DataFrame) -> dict[str, float | None]:
    figures = {}
    for name in CHEAP:
        low, high = lead(table, "psnr", f"{name}_psnr")[1] or (None, None)
        figures |= {f"over_{name}_ci_low": low, f"over_{name}_ci_high": high}
    return figures


def parts_of(table: pd.DataFrame) -> list[str]:
    """Return the names of the pictures that the head made on the way: scored, and neither its answer nor a cheap one."""
    scored = [name.removesuffix("_psnr") for name in table.columns if name.endswith("_psnr")]
    return [name for name in scored if name not in CHEAP]


def interval(values: Float[np.ndarray, " g"]) -> tuple[float, float] | None:
    """Return the 95 % interval of the mean by Student's t; None for one value, which says nothing of others.

    Resampling so few values gives intervals that are too narrow: by half for four of them, by a fifth for ten.
    """
    from scipy.special import stdtrit  # which whoever only names figures does without

    count = len(values)
    if count < 2:
        return None
    half = float(stdtrit(count - 1, 0.975)) * float(np.std(values, ddof=1)) / count**0.5
    return float(np.mean(values)) - half, float(np.mean(values)) + half
