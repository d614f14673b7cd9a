"""What studies need of Prefect and MLflow: a task for each step that is missing, and a run for each study and cell."""

from __future__ import annotations

import time
from pathlib import Path

from mlflow.entities import Metric, Param
from mlflow.tracking import MlflowClient
from mlflow.utils.mlflow_tags import MLFLOW_PARENT_RUN_ID

from aug3d_core.factory.build import Built
from aug3d_core.factory.walk import Make, Visit
from aug3d_core.store import layout
from aug3d_core.store.scenes import masked, mlflow_address
from aug3d_core.store.store import Store
from aug3d_core.studies.common.publication import LoggedRun, Publication
from tasks.build_task import through_prefect
from tasks.mlflow_client import mlflow_client
from tasks.tracking import TROUBLE, experiment_id, said

_BATCH = 900  # MLflow takes at most 1,000 metrics at a time, and 100 parameters or tags
_FILES = (layout.STUDY_PAGE, layout.STUDY_CHART, layout.STUDY_FINDINGS, layout.STUDY_SCORES)


def missing_through_prefect(store: Store) -> Make:
    """Return a maker for studies: it runs the task for steps that are missing, and finds the others in the store itself.

    A study visits thousands of steps that earlier cells have made. Looking one up took 0.4 ms, a task run that finds it 9.5 ms.
    """
    make = through_prefect(store)

    def make_missing(visit: Visit) -> Built | None:
        assert visit.work
        record = store.find(visit.step.stage.name, visit.work.key)
        return Built(record, cached=True) if record else make(visit)

    return make_missing


def log_study(store: Store, study: Publication, folder: Path) -> str:
    """Log a study with its files, and its cells as nested runs; returns why MLflow could not be used, "" if it could."""
    address = mlflow_address(store)
    try:
        client = mlflow_client(store)
        experiment = experiment_id(client, store.root, study.place)
        run_id = begin_run(
            client, experiment, LoggedRun(f"study {folder.name}", study.tags, study.params, study.metrics)
        )
        for name in _FILES:
            client.log_artifact(run_id, str(folder / name))
        parent = {**study.tags, MLFLOW_PARENT_RUN_ID: run_id}
        for cell in study.cells:
            nested = begin_run(client, experiment, cell, parent)
            client.set_terminated(nested, status="FAILED" if cell.failed else "FINISHED")
        client.set_terminated(run_id, status="FINISHED")
    except TROUBLE as error:
        return (
            f"the study was not logged to MLflow at {masked(address)}: {said(error)}; fix this and run the study again: "
            "nothing is computed twice"
        )
    return ""


def begin_run(client: MlflowClient, experiment: str, run: LoggedRun, tags: dict[str, str] | None = None) -> str:
    """Create a run with its settings and figures, still running; return its id."""
    all_tags = {**(tags or {}), **run.tags}
    run_id = client.create_run(experiment, run_name=run.name, tags=all_tags).info.run_id
    client.log_batch(run_id, params=[Param(name, str(value)) for name, value in run.params.items()])
    now_ms = int(time.time() * 1000)
    numbers = [
        Metric(name, float(value), now_ms, 0) for name, value in run.metrics.items() if isinstance(value, int | float)
    ]
    for first in range(0, len(numbers), _BATCH):
        client.log_batch(run_id, numbers[first : first + _BATCH])
    return run_id
