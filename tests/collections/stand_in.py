"""Stages that do no work, for collections: a data set has a test, a model knows what it was trained on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.judging.summary import CHEAP
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.stage import Stage
from aug3d_core.town.files import TOWN_PHOTOS
from tests.stand_in_stages import MADE, Made, StandIn, write_split


class Stages(StandIn):
    """folds: of every scene. tested: groups in the test of each data set. psnr_db: of every evaluation."""

    def __init__(self) -> None:
        super().__init__()
        self.folds, self.tested, self.psnr_db = 1, 4, 22.0
        self.one_fold = False  # a model of the first fold is judged on the others

    def figures(self, stage: Stage, made: Made, files: Path) -> dict[str, Any]:
        if stage.name == "town":
            (files / TOWN_PHOTOS).mkdir()
            (files / TOWN_PHOTOS / MADE).write_text(json.dumps(made))
            (files / TOWN_PHOTOS / "a.jpg").write_text(json.dumps(made))
        if stage.name == "photos":
            digests = [f"{made['photos']}{made.get('town')}{number}" for number in range(9)]
            table = {"photo_id": range(9), "name": digests, "sha256": digests, "lat_deg": 54.0, "lon_deg": 18.0}
            pd.DataFrame(table).to_parquet(files / PHOTO_TABLE)
        if stage.name == "grouping":
            write_split(files, [made["grouping"]["fold"]], ["target"])
            return {"folds": self.folds}
        if stage.name == "dataset":
            return {"views": 40, "groups_real": 30, "groups_rendered": 0, "groups_test": self.tested}
        if stage.name == "exact_town":
            return {"views": 32, "groups_rendered": 32}
        if stage.name == "training":
            return {"head": "sweep", "scenes": 1, "steps": 10, "parameters": 99}
        if stage.name == "evaluation":
            cheap = {f"cheap_{name}": 20.0 for name in CHEAP}
            ends = {f"over_{name}_ci_{end}": 1.0 for name in CHEAP for end in ("low", "high")}
            scores = {"test_psnr_mean": self.psnr_db, "test_ssim_mean": 0.7, "test_flip_mean": 0.2, "test_views": 4}
            return {
                **cheap, **ends, **scores, "test_psnr_ci_low": 20.0, "test_psnr_ci_high": 24.0,
                "test_photos": "p", "conventions": "c",
            }  # fmt: skip
        return {}
