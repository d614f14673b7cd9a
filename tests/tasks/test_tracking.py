"""MLflow gets every run; a broken MLflow loses nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mlflow.tracking import MlflowClient

from aug3d_core.charts.scene_metrics import scene_metrics
from aug3d_core.errors import InputError, StoreError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

RECORD = Record(
    stage="training",
    key="k",
    digest="d",
    recipe="r",
    config={},
    inputs={},
    versions={},
    files={},
    metrics={"train_psnr": 20.0, "name": "x"},
    state="ok",
    notes=(),
    series={"train_psnr": ((1, 10.0), (2, 20.0))},
    pictures={"A panel": "panel.png"},
    seconds=1.5,
    peak_mib=9.0,
)


def log(home: Path, metrics: dict[str, Any], **config: dict[str, Any]) -> str:
    from tasks.tracking import log_run

    store = Store(home)
    (store.files_dir(RECORD)).mkdir(parents=True, exist_ok=True)
    (store.files_dir(RECORD) / "panel.png").write_bytes(b"png")
    report = home / layout.REPORT
    report.write_text("<html>")
    metrics["paths"] = {"mlflow": f"sqlite:///{home / layout.MLFLOW_DATABASE}"}
    return log_run.fn(home, config, [RECORD], metrics, report)


def test_figures_curves_settings_tags_and_pictures_arrive(tmp_path: Path) -> None:
    metrics = scene_metrics("town", "tiny", "abc", 3.0, [(RECORD, True)])
    run_id = log(tmp_path, metrics, training={"steps": 2, "hidden": 64})
    client = MlflowClient(metrics["paths"]["mlflow"])
    run = client.get_run(run_id)
    assert run.data.params == {"training.steps": "2", "training.hidden": "64"}
    assert run.data.metrics["seconds"] == 3.0 and run.data.metrics["training.seconds"] == 1.5
    assert run.data.tags["state"] == "ok" and run.data.tags["digest.training"] == "d"
    history = client.get_metric_history(run_id, "training.train_psnr")
    assert (2, 20.0) in {(point.step, point.value) for point in history}
    assert {artifact.path for artifact in client.list_artifacts(run_id)} == {"training", "report.html"}


def test_a_failed_run_is_marked_as_failed(tmp_path: Path) -> None:
    metrics = scene_metrics("town", "tiny", "abc", 3.0, [(RECORD, False)], InputError("no photos", "add some"))
    run = MlflowClient(f"sqlite:///{tmp_path / layout.MLFLOW_DATABASE}").get_run(log(tmp_path, metrics))
    assert run.info.status == "FAILED" and run.data.tags["state"] == "refused"


def test_a_store_that_is_no_database_is_named(tmp_path: Path) -> None:
    (tmp_path / layout.MLFLOW_DATABASE).write_text("this is not a database, but it is longer than a header")
    with pytest.raises(StoreError, match=r"mlflow\.db cannot be used.*\n.*nothing is computed twice"):
        log(tmp_path, scene_metrics("town", "tiny", "abc", 3.0, [(RECORD, False)]))
