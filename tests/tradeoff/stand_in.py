"""Stages that do nothing but say what they would be made of, and figures of a formula: for studies without engines."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from math import log2
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from aug3d_core.errors import StageFailed
from aug3d_core.make import Source, key_of
from aug3d_core.needs.decision import Decision, Settled
from aug3d_core.nerf.summary import CHEAP
from aug3d_core.scene_config import SceneConfig
from aug3d_core.stage import Stage, StageConfig
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_MADE = "made.json"
_EMPTY = {"recipe": "r", "inputs": {}, "versions": {}, "notes": (), "series": {}, "pictures": {}, "peak_mib": 1.0}
_TOLD = ("ssim", "coarse_psnr", *(f"{name}{kind}" for name in CHEAP for kind in ("_psnr", "_ssim")))
_COSTS = {"town": 100.0, "matching": 75.0, "sfm": 32.0, "depth": 137.0, "surface": 114.0}

Made = dict[str, dict[str, Any]]  # what an object was made with: stage -> settings


class Stages:
    """Stand in for `make`; counts what is computed, and fails where it is told to: "cause: why" ."""

    def __init__(self) -> None:
        self.computed: list[str] = []
        self.grew: list[bool] = []
        self.fails: Callable[[str, Made], str] = lambda stage, made: ""
        self.folds = 1
        self.grown_from = 0  # photographs that poses found made had grown from
        self.luck_db = 0.0  # what the first seed gains for each halving of the steps
        self.test_of: Callable[[Made], Sequence[int]] = lambda made: (1, 2, 3, 4)

    def make(
        self, store: Store, stage: Stage, config: StageConfig, sources: Mapping[str, Source], _progress: Any
    ) -> Record:
        key = key_of(stage, config, sources)
        if found := store.find(stage.name, key):
            return found
        made: Made = {stage.name: config.model_dump(mode="json")}
        for source in sources.values():
            made |= json.loads((source.path / _MADE).read_text()) if (source.path / _MADE).exists() else {}
        if problem := self.fails(stage.name, made):
            raise StageFailed(stage.name, problem.partition(":")[0], problem, "mend it", "", "")
        files = store.work_dir(stage.name, key) / layout.FILES
        files.mkdir(parents=True, exist_ok=True)
        (files / _MADE).write_text(json.dumps(made))
        if stage.name == "town":
            (files / layout.TOWN_PHOTOS).mkdir()
            (files / layout.TOWN_PHOTOS / _MADE).write_text(json.dumps(made))
        self.computed.append(stage.name)
        self.grew.append(stage.grows)
        cost = 350 * made["training"]["steps"] / 1200 if stage.name == "training" else _COSTS.get(stage.name, 2.0)
        fields = {
            "metrics": self._figures(stage, made, files),
            "config": config.model_dump(mode="json"),
            "state": "ok",
            "seconds": cost / 2,
            "cpu_seconds": cost,
        }
        (files.parent / layout.JOB).write_text(json.dumps(_job(stage, sources)))
        return store.commit(files.parent, stage.name, key, _EMPTY | fields)

    def _figures(self, stage: Stage, made: Made, files: Path) -> dict[str, Any]:
        if stage.name == "photos":
            names = [f"photo {number}.jpg" for number in range(9)]
            pd.DataFrame({"photo_id": range(9), "name": names}).to_parquet(files / layout.PHOTO_TABLE)
        if stage.name == "grouping":
            (files / layout.SPLIT_TABLE).write_text(json.dumps(made))
            return {"folds": self.folds}
        if stage.name == "truth":
            return {"position_error_pct": 100.0 / made["matching"]["max_features"]}
        if stage.name == "sfm":
            grown = 0 if stage.afresh else self.grown_from
            return {"reprojection_px": 0.3, "focal_px": 500.0, "grown_from": grown}
        if stage.name == "mesh_truth":
            return {"fscore_half_pct": 0.9, "mesh_render_psnr": 25 - made["surface"]["texel_gsd"]}
        if stage.name == "evaluation":
            psnr = 20 + made["training"]["hidden"] / 64 + made["training"]["steps"] / 1200
            psnr += 0.01 * made["training"]["seed"] - made["grouping"]["fold"]
            psnr += 0.0 if made["training"]["seed"] else self.luck_db * log2(1200 / made["training"]["steps"])
            test = list(self.test_of(made))
            told = {"photo_id": test, "group": test, "psnr": [psnr] * len(test)} | dict.fromkeys(_TOLD, 20.0)
            pd.DataFrame(told).to_parquet(files / layout.TEST_VIEWS)
            return {
                "test_psnr_mean": psnr, "test_psnr_ci_low": psnr - 1, "test_psnr_ci_high": psnr + 1,
                "over_best_cheap_db": psnr - 20, 
            }  # fmt: skip
        return {}


def stand_in(monkeypatch: pytest.MonkeyPatch) -> Stages:
    """Put a formula in the place of the factory."""
    stages = Stages()
    monkeypatch.setattr("aug3d_core.bench.trial.make", stages.make)
    monkeypatch.setattr("aug3d_core.bench.trial.settle", settle)
    return stages


def settle(stage: Stage, config: SceneConfig, *_: Any) -> Settled:
    """Decide one thing, for the preset that decides."""
    told = Decision(field="photos.max_px", value=320, measured="much overlap", rule="half of it is enough")
    decided = (told,) if stage.name == "photos" and config.auto else ()
    return Settled(getattr(config, stage.name), decided)


def _job(stage: Stage, sources: Mapping[str, Source]) -> dict[str, Any]:
    return {"stage": stage.name, "config": {}, "inputs": {name: str(source.path) for name, source in sources.items()}}
