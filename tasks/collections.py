"""A collection's model in MLflow: one run for each version, with the figures of each scene; one registered model."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aug3d_core.heads.files import MODEL_CONFIG, MODEL_WEIGHTS
from aug3d_core.metrics.flat import flat_params
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import masked, mlflow_address, version_metrics
from aug3d_core.store.store import Store
from aug3d_core.studies.common.publication import LoggedRun
from tasks.mlflow_client import mlflow_client
from tasks.model_registry import PUBLISHED
from tasks.studies import begin_run
from tasks.tracking import TROUBLE, experiment_id, said

_SCORES = ("test_psnr_mean", "inputs_alone_psnr_mean", "test_ssim_mean", "test_flip_mean", "over_best_cheap_db")
_FOLDER = "model"


def log_collection(store: Store, version: Path, training: Record, published: bool) -> str:
    """Log a version with its report and model; returns why MLflow could not be used, "" if it could."""
    address, metrics = mlflow_address(store), version_metrics(version)
    place = f"collection-{metrics['collection']}"
    try:
        client = mlflow_client(store)
        experiment = experiment_id(client, store.root, place)
        tags = {"collection": metrics["collection"], "git": metrics["git"], "state": metrics["state"]}
        params = flat_params({"training": training.config})
        run_id = begin_run(client, experiment, LoggedRun(version.name, tags, params, _figures(metrics)))
        for file in (layout.REPORT, layout.METRICS):
            client.log_artifact(run_id, str(version / file))
        for file in (MODEL_WEIGHTS, MODEL_CONFIG):
            client.log_artifact(run_id, str(store.file(training, file)), artifact_path=_FOLDER)
        model = f"aug3d-{place}"
        if not client.search_registered_models(f"name = '{model}'"):
            client.create_registered_model(model, description=f"Models of the collection {metrics['collection']}")
        source = f"{client.get_run(run_id).info.artifact_uri}/{_FOLDER}"
        registered = client.create_model_version(model, source, run_id, tags={**tags, "key.training": training.key})
        if published:
            client.set_registered_model_alias(model, PUBLISHED, registered.version)
        client.set_terminated(run_id, status="FINISHED")
    except TROUBLE as error:
        return f"the version was not logged to MLflow at {masked(address)}: {said(error)}"
    return ""


def _figures(metrics: Mapping[str, Any]) -> dict[str, float]:
    training = {f"training.{name}": metrics["training"].get(name) for name in ("train_psnr", "steps", "cpu_seconds")}
    scenes = {f"{data}.{name}": told.get(name) for data, told in metrics["tests"].items() for name in _SCORES}
    return {name: float(value) for name, value in (training | scenes).items() if isinstance(value, int | float)}
