"""The figures that stand for a whole test. Free of torch, so that a report can take them over several folds."""

from __future__ import annotations

import numpy as np
import pandas as pd
from jaxtyping import Float

FROM_MESH = ("mesh_render", "guided_blend")  # cheap answers made from all photographs but the targets
CHEAP = ("mean_colour", "nearest_copy", "ground_homography", "plane_sweep", "mesh_render", "guided_blend")
_RUNS, _LONGEST_RUN = 8, 8  # a whole strip of a flight is seldom alike; fewer runs would leave the interval to chance


def summary(table: pd.DataFrame) -> dict[str, float | None]:
    """Return the figures that stand for the whole test: means with interval, groups, cheap answers.

    table: a row for each test view, in the order of the flight. None for the ends of the intervals where there is one view.
    """
    column = {name: np.asarray(values, float) for name, values in table.select_dtypes("number").items()}
    scores = column["psnr"]
    groups = np.array([scores[column["group"] == group].mean() for group in np.unique(column["group"])])
    low, high = interval(scores) or (None, None)
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
    """Return how far a column is above another [dB]: the mean, and its `interval`, paired over test views."""
    difference = np.asarray(table[answer], float) - np.asarray(table[other], float)
    return float(difference.mean()), interval(difference)


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


def runs_of_neighbours(values: Float[np.ndarray, "*s v"]) -> Float[np.ndarray, "*s r"]:
    """Return the means of values over runs of neighbours: of up to 8, so long that 8 runs are left.

    Photographs that were taken one after another show the same ground, and a model that fails at one fails at the next.
    Taken for independent they make an interval too narrow; means of runs are nearly so (batch means: Law 2015, Simulation
    modeling and analysis, section 9.5.3).

    values: along the last axis in the order of the flight.
    """
    count = values.shape[-1]
    length = min(max(count // _RUNS, 1), _LONGEST_RUN)
    return np.stack([run.mean(axis=-1) for run in np.array_split(values, count // length, axis=-1)], axis=-1)


def interval(values: Float[np.ndarray, " v"]) -> tuple[float, float] | None:
    """Return the 95 % interval of the mean by Student's t over `runs_of_neighbours`; None for one value.

    Resampling so few values gives intervals that are too narrow: by half for four of them, by a fifth for ten.
    """
    from scipy.special import stdtrit  # which whoever only names figures does without

    if len(values) < 2:
        return None
    runs = runs_of_neighbours(values)
    half = float(stdtrit(len(runs) - 1, 0.975)) * float(np.std(runs, ddof=1)) / len(runs) ** 0.5
    return float(np.mean(values)) - half, float(np.mean(values)) + half
