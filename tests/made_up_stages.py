"""Stages that do nothing but leave a record, for tests of what is made, in which order, from what."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.errors import StageFailed
from aug3d_core.make import Source, key_of
from aug3d_core.nerf.config import EvaluationConfig
from aug3d_core.nerf.summary import CHEAP, summary
from aug3d_core.stage import Stage, StageConfig
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store


class Stages:
    """Stand in for the work: each object is a line that says what it was made of."""

    def __init__(self, folds: int) -> None:
        self.folds, self.psnr_db = folds, 20.0
        self.photographs = "p"  # begins the digest of each fold's test photographs
        self.computed: list[str] = []
        self.fails: tuple[str, int] | None = None  # stage, fold

    def make(
        self, store: Store, stage: Stage, config: StageConfig, sources: Mapping[str, Source], _progress: Any
    ) -> Record:
        key = key_of(stage, config, sources)
        if found := store.find(stage.name, key):
            return found
        files = store.work_dir(stage.name, key) / layout.FILES
        files.mkdir(parents=True, exist_ok=True)
        told = {name: (source.path / "made.txt").read_text() for name, source in sources.items() if name != "folder"}
        fold = getattr(config, "fold", None)
        made = (
            f"{stage.name} of fold {fold}" if fold is not None else next((t for t in told.values() if "fold" in t), "")
        )
        assert len({t for t in told.values() if "fold" in t}) <= 1, "a step reads one fold alone"
        fold = int(made.split()[-1]) if made else 0
        if self.fails == (stage.name, fold):
            raise StageFailed(stage.name, "refused", f"no {stage.name} in fold {fold}", "fly again", "", "")
        (files / "made.txt").write_text(f"fold {fold}" if made else "no part of a split")
        if stage.name == "grouping":
            (files / layout.SPLIT_TABLE).write_text(made)
        if stage.name == "training":  # the model is handed on to MLflow
            for name in (layout.MODEL_WEIGHTS, layout.MODEL_CONFIG):
                (files / name).write_text(config.model_dump_json())
        self.computed.append(stage.name)
        fields = {"metrics": self.metrics(stage.name, fold, files), "config": config.model_dump(mode="json")}
        empty = {"recipe": "r", "inputs": {}, "versions": {}, "notes": (), "series": {}, "pictures": {}}
        return store.commit(
            files.parent, stage.name, key, empty | fields | {"state": "ok", "seconds": 1, "peak_mib": 1}
        )

    def metrics(self, stage: str, fold: int, files: Path) -> dict[str, Any]:
        if stage == "grouping":
            return {"folds": self.folds}
        if stage == "photos":
            pd.DataFrame({"width_px": [640], "height_px": [480]}).to_parquet(files / layout.PHOTO_TABLE)
            return {"photos": 1}
        if stage != "evaluation":
            return {}
        scores = {"psnr": self.psnr_db + fold, "ssim": 0.5, "coarse_psnr": 16.0}
        scores |= {f"{name}_{score}": 15.0 for name in CHEAP for score in ("psnr", "ssim")}
        table = pd.DataFrame([{"group": group, "photo_id": group} | scores for group in range(2)])
        table.to_parquet(files / layout.TEST_VIEWS)
        rules = {"test_photos": f"{self.photographs}{fold}", "conventions": "c"}
        return dict(summary(table, EvaluationConfig())) | rules
