"""Versions of a scene in a store, for tests of MLflow: a model that was trained and tested, with a curve and a picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from aug3d_core.factory.plan import Step, stage_of
from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.judging.summary import CHEAP
from aug3d_core.metrics.scene_metrics import scene_metrics
from aug3d_core.photos.files import PHOTO_TABLE
from aug3d_core.run.errors import Aug3dError
from aug3d_core.run.files import FILES
from aug3d_core.run.stage import Metric
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store

PICTURES = {"training": {"A panel": "panel.png"}, "evaluation": {"Test views": "panel.png"}}
SERIES = {"training": {"train_psnr": ((1, 10.0), (2, 20.0)), "train_loss": ((1, 0.2), (2, 0.1))}}


def made(
    store: Store,
    stage: str,
    key: str,
    config: Mapping[str, Any],
    tables: Mapping[str, pd.DataFrame] | None = None,
    **metrics: Metric,
) -> Record:
    """Put an object into the store whose bytes, but for tables, are its key; what is there already is kept."""
    if found := store.find(stage, key):
        return found
    files = store.work_dir(stage, key) / FILES
    files.mkdir(parents=True)
    for name in (MODEL_WEIGHTS, MODEL_CONFIG, "panel.png"):
        (files / name).write_text(key)
    for name, table in (tables or {}).items():
        table.to_parquet(files / name)
    fields = {
        "recipe": "r", "config": dict(config), "inputs": {}, "versions": {}, "metrics": metrics, "state": "ok", "notes": (),
        "series": SERIES.get(stage, {}), "pictures": PICTURES.get(stage, {}), "seconds": 1.5, "peak_mib": 9.0,
    }  # fmt: skip
    return store.commit(files.parent, stage, key, fields)


def version(
    home: Path,
    model: str = "a",
    psnr: float = 21.5,
    photos: str = "p",
    rules: str = "c",
    scene: str = "town",
    cached: tuple[str, ...] = (),
    failure: Aug3dError | None = None,
    each: Mapping[str, float] | None = None,
) -> Path:
    """Write a version whose model has a name for its bytes, and a score on some photographs by some rules.

    each: the score of each photograph [dB] by its digest, all of them tested; None where tables are not written.
    """
    store = Store(home)
    figures = {f"test_psnr_{name}": psnr for name in ("mean", "ci_low", "ci_high")} | {"test_ssim_mean": 0.5}
    figures |= {f"group_{name}": psnr for name in ("best", "low", "average")} | {f"cheap_{name}": 9.0 for name in CHEAP}
    figures |= {f"over_{name}_ci_{end}": psnr - 9 for name in CHEAP for end in ("low", "high")}
    figures |= {"test_views": 2, "test_photos": photos, "conventions": rules}
    records, views = dict[str, Record](), {}
    if each is not None:
        table = pd.DataFrame({"photo_id": range(len(each)), "sha256": list(each)})
        records["photos"] = made(store, "photos", "of " + "".join(each), {}, {PHOTO_TABLE: table})
        tested = {"photo_id": range(len(each)), "group": range(len(each)), "psnr": list(each.values())}
        views = {TEST_VIEWS: pd.DataFrame(tested)}
    records |= {
        "dataset": made(store, "dataset", "d", {"image_px": 64}, views=4),
        "training": made(store, "training", model, {"steps": 2, "hidden": 64}, train_psnr=20.0, stopped_by="steps"),
        "evaluation": made(store, "evaluation", f"{model}{psnr}{photos}{rules}{each}", {}, views, **figures),
    }
    steps = [(Step(stage_of(step)), record, store.files_dir(record)) for step, record in records.items()]
    metrics = scene_metrics(scene, "tiny", "abc", 3.0, steps, cached, failure)
    folder = new_version(store, scene)
    metrics["paths"] = version_paths(store, folder, records)
    (folder / layout.REPORT).write_text("<html>")
    write_metrics(folder, metrics)
    return folder
