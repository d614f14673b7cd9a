"""The scores of a judged scene as figures: each way to start against the cheap answers that know as much."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from aug3d_core.bench.figure import Figure, at_least
from aug3d_core.judging.summary import lead
from aug3d_core.photos.discover import find_photos
from aug3d_core.run.errors import InputError

# Cheap answers by the name that their figures have: those from the inputs alone, and those of the mesh
FROM_INPUTS = {"homography": "ground_homography", "sweep": "plane_sweep"}
FROM_MESH = {"mesh": "mesh_render", "guided": "guided_blend"}


def photo_sets(root: Path | None) -> dict[str, Path]:
    """Return the folders below a folder that hold photographs, by the first word of their name.

    Where two share it, by the whole name. Raises InputError if there are none.
    """
    if root is None:
        return {}
    folders = sorted(
        one for one in (root.iterdir() if root.is_dir() else ()) if one.is_dir() and find_photos(one).names
    )
    if not folders:
        raise InputError(
            f"{root} holds no folder of photographs", "Name a folder with a folder for each set of photographs."
        )
    first = [folder.name.partition("_")[0] for folder in folders]
    return {
        word if first.count(word) == 1 else folder.name: folder for word, folder in zip(first, folders, strict=True)
    }


def scene_scores(views: pd.DataFrame, name: str, goals: Mapping[str, float]) -> dict[str, Figure]:
    """Return PSNR, SSIM, and leads with the lower ends of their intervals; `free`: from the inputs alone.

    views: the table of a judged test. goals: by what follows the scene's name. The best cheap answer is the one of the inputs
    with the higher mean.
    """
    free = free_column(views)
    found = {f"{name}_free_psnr": mean(views, free), f"{name}_free_ssim": mean(views, free.replace("psnr", "ssim"))}
    lows: dict[str, float | None] = {}
    answers = [("free", free, FROM_INPUTS)]
    if free != "psnr":
        found |= {f"{name}_scaffold_psnr": mean(views, "psnr"), f"{name}_scaffold_ssim": mean(views, "ssim")}
        answers += [("scaffold", "psnr", FROM_MESH)]
    for start, column, cheap in answers:
        for short, answer in cheap.items():
            of = f"{name}_{start}_over_{short}"
            found[f"{of}_db"], ends = lead(views, column, f"{answer}_psnr")
            lows[f"{of}_low"] = ends[0] if ends else None
    best = max(FROM_INPUTS, key=lambda short: mean(views, f"{FROM_INPUTS[short]}_psnr"))
    found[f"{name}_free_over_best_cheap_db"] = found[f"{name}_free_over_{best}_db"]
    figures = {
        key: _against(goals.get(key.removeprefix(f"{name}_")), value, _unit(key)) for key, value in found.items()
    }
    return figures | {key: at_least(0.0, low, "dB") for key, low in lows.items()}


def free_column(views: pd.DataFrame) -> str:
    """Return the column with the PSNR from the inputs alone."""
    return "inputs_alone_psnr" if "inputs_alone_psnr" in views else "psnr"


def mean(views: pd.DataFrame, column: str) -> float:
    """Return the mean of a column."""
    return float(np.asarray(views[column], float).mean())


def _unit(key: str) -> str:
    return "1" if key.endswith("ssim") else "dB"


def _against(goal: float | None, value: float, unit: str) -> Figure:
    return Figure(value, unit) if goal is None else at_least(goal, value, unit)
