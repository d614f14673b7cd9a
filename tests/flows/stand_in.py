"""Stand-in stages for the flow over a scene: what is made, in which order, from what; and a factory of six of them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from aug3d_core.factory.material import Material
from aug3d_core.factory.stages import STAGES
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.judging.summary import summary
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.stage import Stage
from tests.stand_in_stages import Made, StandIn, fold_of, write_split, write_test

# A task run takes Prefect a tenth of a second, so rules that any list of stages shows are tried on a short one.
_INPUTS = {
    "photos": ("folder",),
    "grouping": ("photos",),
    "depth": ("photos", "grouping"),
    "surface": ("depth",),
    "training": ("grouping", "surface"),
    "evaluation": ("grouping", "training"),
}
FEW = tuple(replace(STAGES[name], inputs=inputs, reads={}) for name, inputs in _INPUTS.items())


def make_of_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the factory have six stages."""
    monkeypatch.setattr(Material, "stages", lambda _: FEW)


def stand_in(monkeypatch: pytest.MonkeyPatch, mlflow: Path, folder: Path) -> Stages:
    """Let flows make a scene of one fold by six stages that do no work. mlflow: a fresh database; `folder` gets a copy."""
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{shutil.copy(mlflow, folder)}")
    stages = Stages(folds=1)
    monkeypatch.setattr("tasks.build_task.build", stages.build)
    make_of_few(monkeypatch)
    return stages


class Stages(StandIn):
    """A scene in so many folds: each fold is predicted 1 dB better than the one before."""

    def __init__(self, folds: int) -> None:
        super().__init__()
        self.folds, self.psnr_db = folds, 20.0
        self.photographs = "p"  # begins the digest of each fold's test photographs

    def figures(self, stage: Stage, made: Made, files: Path) -> dict[str, Any]:
        fold = fold_of(made)
        if stage.name == "photos":
            table = {"photo_id": range(2), "sha256": ["a", "b"], "width_px": 640, "height_px": 480}
            pd.DataFrame(table).to_parquet(files / PHOTO_TABLE)
            return {"photos": 2}
        if stage.name == "grouping":
            write_split(files, [fold], ["target"])
            return {"folds": self.folds}
        if stage.name == "training":  # the model is passed on to MLflow
            for name in (MODEL_WEIGHTS, MODEL_CONFIG):
                (files / name).write_text("{}")
        if stage.name == "evaluation":
            table = write_test(files, dict.fromkeys(range(2), self.psnr_db + fold))
            rules = {"test_photos": f"{self.photographs}{fold}", "conventions": "c"}
            return dict(summary(table)) | rules
        return {}
