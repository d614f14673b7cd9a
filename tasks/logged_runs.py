"""Runs that MLflow holds, looked up by the beginning of their id."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store.scenes import masked, mlflow_address
from aug3d_core.store.store import Store
from tasks.mlflow_client import mlflow_client
from tasks.tracking import TROUBLE, said


@dataclass(frozen=True)
class LoggedRun:
    """What MLflow holds of a run."""

    name: str
    tags: Mapping[str, str]
    params: Mapping[str, str]
    metrics: Mapping[str, float]


def logged_run(store: Store, beginning: str) -> LoggedRun:
    """Return the run whose id begins so; raises UsageError if there is none or several, StoreError if MLflow is no use."""
    address = mlflow_address(store)
    try:
        client = mlflow_client(store)
        experiments = [experiment.experiment_id for experiment in client.search_experiments()]
        found = client.search_runs(experiments, f"attributes.run_id LIKE '{beginning}%'", max_results=2)
    except TROUBLE as error:
        raise StoreError(
            f"MLflow at {masked(address)} cannot be used: {said(error)}",
            "name versions as SCENE@TIME: they need no MLflow",
        ) from error
    if len(found) != 1:
        raise UsageError(
            f"{beginning!r} is no scene, and {'several runs' if found else 'no run'} in MLflow begin with it",
            f"give more of the id, as MLflow at {masked(address)} shows it, or SCENE@TIME",
        )
    run = found[0]
    return LoggedRun(run.info.run_name or run.info.run_id, run.data.tags, run.data.params, run.data.metrics)
