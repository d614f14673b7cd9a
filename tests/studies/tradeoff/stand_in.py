"""Stand-in stages for the study of speed against accuracy: figures from a formula of the settings."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from math import log2
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from aug3d_core.factory.auto.decision import Settled
from aug3d_core.factory.config import SceneConfig, scene_config
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.stage import Decision, Stage
from aug3d_core.town.files import TOWN_PHOTOS
from tests.stand_in_stages import MADE, Made, StandIn, fold_of, write_split, write_test

STEPS = scene_config("tiny").training.steps
_COSTS = {"town": 100.0, "matching": 75.0, "sfm": 32.0, "depth": 137.0, "surface": 114.0}


class Stages(StandIn):
    """A scene whose accuracy and cost are formulas of the settings."""

    def __init__(self) -> None:
        super().__init__()
        self.folds = 1
        self.grown_from = 0  # number of photographs that existing poses were extended from
        self.luck_db = 0.0  # what the first seed gains for each halving of the steps
        self.test_of: Callable[[Made], Sequence[int]] = lambda made: (1, 2, 3, 4)

    def cpu_seconds(self, stage: Stage, made: Made) -> float:
        return 350 * made["training"]["steps"] / STEPS if stage.name == "training" else _COSTS.get(stage.name, 2.0)

    def figures(self, stage: Stage, made: Made, files: Path) -> dict[str, Any]:
        if stage.name == "town":
            (files / TOWN_PHOTOS).mkdir()
            (files / TOWN_PHOTOS / MADE).write_text(json.dumps(made))
        if stage.name == "photos":
            names = [f"photo {number}.jpg" for number in range(9)]
            pd.DataFrame({"photo_id": range(9), "name": names}).to_parquet(files / PHOTO_TABLE)
        if stage.name == "grouping":
            write_split(files, [fold_of(made)], ["target"])
            return {"folds": self.folds}
        if stage.name == "truth":
            return {"position_error_pct": 100.0 / made["matching"]["max_features"]}
        if stage.name == "sfm":
            grown = 0 if stage.afresh else self.grown_from
            return {"reprojection_px": 0.3, "focal_px": 500.0, "grown_from": grown}
        if stage.name == "mesh_truth":
            return {"fscore_half_pct": 0.9, "mesh_render_psnr": 25 - made["surface"]["texel_gsd"]}
        if stage.name == "evaluation":
            psnr = 20 + made["training"]["head"]["features"] / 16 + made["training"]["steps"] / STEPS
            psnr += 0.01 * made["training"]["seed"] - made["grouping"]["fold"]
            psnr += 0.0 if made["training"]["seed"] else self.luck_db * log2(STEPS / made["training"]["steps"])
            write_test(files, dict.fromkeys(self.test_of(made), psnr), others=20.0)
            return {
                "test_psnr_mean": psnr, "test_psnr_ci_low": psnr - 1, "test_psnr_ci_high": psnr + 1,
                "over_best_cheap_db": psnr - 20,
            }  # fmt: skip
        return {}


def stand_in(monkeypatch: pytest.MonkeyPatch) -> Stages:
    """Put a formula in the place of the factory."""
    stages = Stages()
    monkeypatch.setattr("aug3d_core.factory.walk.settle", settle)
    return stages


def settle(stage: Stage, config: SceneConfig, *_: Any) -> Settled:
    """Decide one thing, for the preset that decides."""
    told = Decision(field="photos.max_px", value=320, measured="much overlap", rule="half of it is enough")
    decided = (told,) if stage.name == "photos" and config.auto else ()
    return Settled(getattr(config, stage.name), decided)
