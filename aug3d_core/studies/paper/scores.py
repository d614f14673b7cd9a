"""The scores of each test photograph, and a check that every cell was given the same test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from jaxtyping import Float

from aug3d_core.judging.summary import CHEAP
from aug3d_core.studies.paper.cell import PaperResult

ANSWERS = [f"{name}_{score}" for name in CHEAP for score in ("psnr", "ssim")]
COLUMNS = ["arm", "seed", "fold", "input_views", "photo_id", "psnr", "ssim", *ANSWERS]
_SAME_DB = 1e-6


def score_table(results: Sequence[PaperResult]) -> pd.DataFrame:
    """Return a row per test photograph of every cell that has a score."""
    tables = [
        result.views.assign(
            arm=result.arm.name,
            seed=result.seed,
            fold=result.cell.fold,
            input_views=result.records["evaluation"].config["input_views"],
        ).loc[:, COLUMNS]
        for result in results
        if not result.failure
    ]
    table = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=COLUMNS)
    _check_same_test(table)
    return table


def _check_same_test(table: pd.DataFrame) -> None:
    """Check that every cell predicted the same photographs from the same inputs: then the cheap answers score the same."""
    for same_test, cells in table.groupby(["fold", "input_views"]):
        tests = [
            cell.sort_values("photo_id").loc[:, ["photo_id", *ANSWERS]].to_numpy(float)
            for _, cell in cells.groupby(["arm", "seed"])
        ]
        for test in tests:
            same = test.shape == tests[0].shape and np.allclose(test, tests[0], rtol=0, atol=_SAME_DB, equal_nan=True)
            assert same, f"cells of one fold and number of input views {same_test} were given different tests"


def whole(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the seeds of each arm that have every score: a seed that lacks a fold was given another test."""
    photos = len(table[["fold", "photo_id"]].drop_duplicates())
    return table.loc[table.groupby(["arm", "seed"])["psnr"].transform("count") == photos]


def psnr_by_seed(table: pd.DataFrame, arm: str) -> pd.DataFrame:
    """Return the PSNR [dB] of an arm: a row per seed that has every score, a column per test photograph."""
    rows = whole(table)
    return rows[rows["arm"] == arm].pivot(index="seed", columns=["fold", "photo_id"], values="psnr")


def paired(table: pd.DataFrame, first: str, second: str) -> Float[np.ndarray, "s p"]:
    """Return how far the first arm is above the second [dB], by seed and photograph; of shape (0, 0) if they share no seed."""
    above, below = psnr_by_seed(table, first), psnr_by_seed(table, second)
    seeds = above.index.intersection(below.index)
    if not len(seeds):
        return np.zeros((0, 0))
    return (above.loc[seeds] - below.loc[seeds]).to_numpy(float)
