"""MLflow: one run per factory run, from the records, on cache hits too."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from mlflow.entities import Metric, Param
from mlflow.exceptions import MlflowException
from mlflow.tracking import MlflowClient
from prefect import task
from prefect.cache_policies import NO_CACHE
from sqlalchemy.exc import SQLAlchemyError

from aug3d_core.charts.scene_metrics import curves, flat_metrics, flat_params
from aug3d_core.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_METRICS, _PARAMS = 1000, 100  # MLflow refuses more in one call


@task(cache_policy=NO_CACHE, task_run_name="log to MLflow")
def log_run(home: Path, config: dict[str, Any], records: list[Record], metrics: dict[str, Any], report: Path) -> str:
    """Log one factory run: settings, figures, curves, tags, pictures and the report; returns the MLflow run id.

    Raises StoreError if MLflow's store cannot be used; report and metrics.json are on disk by then.
    """
    try:
        return _log(MlflowClient(metrics["paths"]["mlflow"]), home, config, records, metrics, report)
    except (MlflowException, SQLAlchemyError) as error:
        raise StoreError(
            f"the MLflow store {metrics['paths']['mlflow']} cannot be used: {str(error).splitlines()[0]}",
            f"the results are safe in {report.parent}; mend or move that store and run again, nothing is computed twice",
        ) from error


def _log(
    client: MlflowClient,
    home: Path,
    config: dict[str, Any],
    records: list[Record],
    metrics: dict[str, Any],
    report: Path,
) -> str:
    now_ms = int(time.time() * 1000)
    run = client.create_run(
        _experiment_id(client, home, metrics["scene"]),
        run_name=f"{metrics['preset']} {report.parent.name}",
        tags=_tags(records, metrics),
    )
    params = [Param(name, str(value)) for name, value in flat_params(config).items()]
    for start in range(0, len(params), _PARAMS):
        client.log_batch(run.info.run_id, params=params[start : start + _PARAMS])
    values = [Metric(name, value, now_ms, 0) for name, value in flat_metrics(metrics).items()]
    values += [Metric(name, value, now_ms, step) for name, step, value in curves(records)]
    for start in range(0, len(values), _METRICS):
        client.log_batch(run.info.run_id, metrics=values[start : start + _METRICS])
    store = Store(home)
    for record in records:
        for path in record.pictures.values():
            client.log_artifact(run.info.run_id, str(store.files_dir(record) / path), artifact_path=record.stage)
    client.log_artifact(run.info.run_id, str(report))
    client.set_terminated(run.info.run_id, status="FAILED" if metrics["state"] == "refused" else "FINISHED")
    return run.info.run_id


def _experiment_id(client: MlflowClient, home: Path, scene: str) -> str:
    found = client.get_experiment_by_name(scene)
    if found:
        return found.experiment_id
    return client.create_experiment(scene, artifact_location=(home / layout.MLFLOW_ARTIFACTS / scene).as_uri())


def _tags(records: list[Record], metrics: dict[str, Any]) -> dict[str, str]:
    tags = {name: str(metrics[name]) for name in ("scene", "preset", "git", "state")}
    return tags | {f"digest.{record.stage}": record.digest for record in records}
