"""A finished scene in a store, and stages that do nothing but say what they would be made of: for studies without engines."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.errors import StageFailed
from aug3d_core.make import Source, key_of
from aug3d_core.nerf.summary import CHEAP
from aug3d_core.scene_config import scene_config
from aug3d_core.stage import Stage, StageConfig
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store

PHOTOS, TRAIN = 41, 30
_MADE = "made.json"
_EMPTY = {"recipe": "r", "inputs": {}, "versions": {}, "notes": (), "series": {}, "pictures": {}, "peak_mib": 1.0}
_LOOSE = {"state": "ok", "seconds": 2.0, "cpu_seconds": 1.0}

Made = dict[str, dict[str, Any]]  # what an object was made with: stage -> settings


def psnr_of(made: Made, photo: int) -> float:
    """Score better for shared points and small groups; a hard photograph is hard for everyone."""
    k = made["grouping"]["k"]
    by_k = 0.0 if k == "auto" else -0.2 * int(k)
    rendered = 2.0 * (made["training"]["rendered_share"] == 0.5)
    noise = 0.01 * (made["training"]["seed"] * 7 + photo * 3) % 5
    return 20.0 + (made["grouping"]["method"] == "shared") + by_k + rendered + photo / 10 + 0.1 * noise


class Stages:
    """Stand in for `make`; counts what is computed, and fails where it is told to."""

    def __init__(self, score: Callable[[Made, int], float] = psnr_of) -> None:
        self.score = score
        self.computed: list[str] = []
        self.fails: Callable[[str, Made], str] = lambda stage, made: ""
        self.targets = [30, 33, 36, 39]

    def make(
        self, store: Store, stage: Stage, config: StageConfig, sources: Mapping[str, Source], _progress: Any
    ) -> Record:
        key = key_of(stage, config, sources)
        if found := store.find(stage.name, key):
            return found
        made: Made = {stage.name: config.model_dump(mode="json")}
        for source in sources.values():
            made |= json.loads((source.path / _MADE).read_text())
        if problem := self.fails(stage.name, made):
            raise StageFailed(stage.name, problem.partition(":")[0], problem, "mend it", "", "")
        files = store.work_dir(stage.name, key) / layout.FILES
        files.mkdir(parents=True, exist_ok=True)
        (files / _MADE).write_text(json.dumps(made))
        self.computed.append(stage.name)
        fields = {"metrics": self._write(stage.name, made, files), "config": config.model_dump(mode="json")}
        return store.commit(files.parent, stage.name, key, _EMPTY | _LOOSE | fields)

    def _write(self, stage: str, made: Made, files: Path) -> dict[str, Any]:
        if stage == "grouping":
            return write_grouping(files, made["grouping"])
        if stage == "dataset":
            domes = made["sampling"]["domes"] if "sampling" in made else 0
            return {"groups_rendered": domes, "rendered": domes * 8}
        if stage == "evaluation":
            rows = [
                {"group": group, "photo_id": photo, "psnr": self.score(made, photo), "ssim": 0.5}
                | {f"{name}_{score}": 15.0 + photo for name in CHEAP for score in ("psnr", "ssim")}
                for group, photo in enumerate(self.targets)
            ]
            pd.DataFrame(rows).to_parquet(files / layout.TEST_VIEWS)
        return {}


def write_grouping(files: Path, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Write a split that hangs on the test share alone, as the real one does; return the stage's figures."""
    first_test = PHOTOS - round(PHOTOS * float(settings["test_share"]))
    roles = ["train" if photo < first_test else "target" for photo in range(PHOTOS)]
    pd.DataFrame({"photo_id": range(PHOTOS), "role": roles}).to_parquet(files / layout.SPLIT_TABLE)
    k = 8 if settings["k"] == "auto" else min(int(settings["k"]), TRAIN)
    reason = "as set" if k == settings["k"] else f"there are only {TRAIN} training views"
    return {"k": k, "k_reason": reason, "groups": 5, "train_views": TRAIN, "folds": settings["folds"] or 1}


def finished_scene(home: Path, name: str = "little", folds: int | None = None) -> Store:
    """Return a store that holds a finished scene."""
    store, config = Store(home), scene_config("tiny")
    records: dict[str, Record] = {}
    for fold in range(folds or 1):
        for stage in ("sfm", "similarity", "grouping", "surface"):
            if fold and stage in ("sfm", "similarity"):
                continue
            step = f"{stage}_fold{fold}" if fold else stage
            settings = getattr(config, stage).model_dump(mode="json")
            settings |= {"folds": folds, "fold": fold} if stage == "grouping" else {}
            files = store.work_dir(stage, step) / layout.FILES
            files.mkdir(parents=True)
            (files / _MADE).write_text(json.dumps({stage: settings}))
            metrics = write_grouping(files, settings) if stage == "grouping" else {}
            fields = {"metrics": metrics, "config": settings}
            records[step] = store.commit(files.parent, stage, step, _EMPTY | _LOOSE | fields)
    version = new_version(store, name)
    told = {"scene": name, "preset": "tiny", "state": "ok", "paths": version_paths(store, version, records)}
    write_metrics(version, told)
    return store
