"""A finished scene in a store, and stand-in stages for the study of the paper's tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from aug3d_core.factory.config import scene_config
from aug3d_core.run.files import FILES
from aug3d_core.run.stage import Stage
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from tests.stand_in_stages import EMPTY, MADE, Made, StandIn, write_split, write_test

PHOTOS, TRAIN = 41, 30


def psnr_of(made: Made, photo: int) -> float:
    """Score better for shared points and small groups; a hard photograph is hard for everyone."""
    k = made["grouping"]["k"]
    by_k = 0.0 if k == "auto" else -0.2 * int(k)
    rendered = 2.0 * (made["training"]["rendered_share"] == 0.5)
    noise = 0.01 * (made["training"]["seed"] * 7 + photo * 3) % 5
    return 20.0 + (made["grouping"]["method"] == "shared") + by_k + rendered + photo / 10 + 0.1 * noise


class Stages(StandIn):
    """A scene whose held-out photographs are scored by a formula of the settings."""

    def __init__(self, score: Callable[[Made, int], float] = psnr_of) -> None:
        super().__init__()
        self.score = score
        self.targets = [30, 33, 36, 39]

    def figures(self, stage: Stage, made: Made, files: Path) -> dict[str, Any]:
        if stage.name == "grouping":
            return write_grouping(files, made["grouping"])
        if stage.name == "dataset":
            domes = made["sampling"]["domes"] if "sampling" in made else 0
            return {"groups_rendered": domes, "rendered": domes * 8}
        if stage.name == "evaluation":
            write_test(files, {photo: self.score(made, photo) for photo in self.targets})
        return {}


def write_grouping(files: Path, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Write a split that depends on the test share only, as the real one does; return the stage's metrics."""
    first_test = PHOTOS - round(PHOTOS * float(settings["test_share"]))
    write_split(files, range(PHOTOS), ["train" if photo < first_test else "target" for photo in range(PHOTOS)])
    k = 8 if settings["k"] == "auto" else min(int(settings["k"]), TRAIN)
    reason = "as set" if k == settings["k"] else f"there are only {TRAIN} training views"
    return {"k": k, "k_reason": reason, "groups": 5, "train_views": TRAIN, "folds": settings["folds"] or 1}


def finished_scene(home: Path, name: str = "little", folds: int | None = None) -> Store:
    """Return a store that holds a finished scene."""
    store, config = Store(home), scene_config("tiny")
    records: dict[str, Record] = {}
    for fold in range(folds or 1):
        for stage in ("sfm", "similarity", "grouping", "depth", "surface"):
            if fold and stage in ("sfm", "similarity"):
                continue
            step = f"{stage}_fold{fold}" if fold else stage
            settings = getattr(config, stage).model_dump(mode="json")
            settings |= {"folds": folds, "fold": fold} if stage == "grouping" else {}
            files = store.work_dir(stage, step) / FILES
            files.mkdir(parents=True)
            (files / MADE).write_text(json.dumps({stage: settings}))
            metrics = write_grouping(files, settings) if stage == "grouping" else {}
            fields = {"metrics": metrics, "config": settings, "state": "ok", "seconds": 2.0, "cpu_seconds": 1.0}
            records[step] = store.commit(files.parent, stage, step, EMPTY | fields)
    version = new_version(store, name)
    written = {"scene": name, "preset": "tiny", "state": "ok", "paths": version_paths(store, version, records)}
    write_metrics(version, written)
    return store
