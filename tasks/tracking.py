"""MLflow: told of every version from the records, on cache hits too; what it cannot be told now it is told later."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from filelock import Timeout
from mlflow.entities import LifecycleStage, Run, RunStatus
from mlflow.exceptions import MlflowException
from mlflow.tracking import MlflowClient
from mlflow.utils.mlflow_tags import MLFLOW_PARENT_RUN_ID
from prefect import task
from prefect.cache_policies import NO_CACHE
from sqlalchemy.exc import SQLAlchemyError

from aug3d_core.run.errors import StoreError
from aug3d_core.store import layout
from aug3d_core.store.scenes import bring_report, masked, mlflow_address, records_of, version_metrics
from aug3d_core.store.store import Store
from tasks.mlflow_client import mlflow_client
from tasks.mlflow_outbox import Entry, my_turn, put, waiting
from tasks.model_registry import name_published
from tasks.version_run import log_version

TROUBLE = (MlflowException, SQLAlchemyError, OSError)  # of the server, of the database, of the artifacts' folder
_LATER = "the next run, or aug3d compare, logs"
_PAGES = "workflowType=machine_learning"  # else MLflow shows the pages for language models


@dataclass
class Flushed:
    """What came of telling MLflow: the run of each version by its folder's name, and why the rest has to wait."""

    runs: dict[str, Run] = field(default_factory=dict)
    waiting: str = ""


@dataclass(frozen=True)
class Logged:
    """A version's run in MLflow and its page, if a server shows one; or why it is to be logged later."""

    run_id: str = ""
    url: str = ""
    waiting: str = ""


@task(cache_policy=NO_CACHE, task_run_name="log to MLflow")
def log_run(home: Path, version: Path) -> Logged:
    """Log a version that is written, and before it those that wait; trouble with MLflow is told, never raised."""
    return _tell(Store(home), Entry(scene=version.parent.name, version=version.name))


def publish_model(store: Store, scene: str, version: str) -> Logged:
    """Give the alias `published` to the model of a version (its folder's name), now or as soon as MLflow can be reached."""
    return _tell(store, Entry(scene=scene, version=version, publish=True))


def flush(store: Store) -> Flushed:
    """Tell MLflow what waits, oldest first and each once; trouble with MLflow is told, never raised."""
    flushed, address = Flushed(), mlflow_address(store)
    try:
        with my_turn(store):
            _flush(store, mlflow_client(store), flushed)
    except Timeout:
        flushed.waiting = f"another process is logging to MLflow; {_LATER} what it leaves"
    except TROUBLE as error:
        flushed.waiting = f"MLflow at {masked(address)} cannot be used: {said(error)}; {_LATER} what it was not told"
    return flushed


def experiment_id(client: MlflowClient, home: Path, scene: str) -> str:
    """Return the experiment of a scene, made if there is none and brought back if it was deleted."""
    found = client.get_experiment_by_name(scene)
    if found is None:
        return client.create_experiment(scene, artifact_location=_artifacts(client.tracking_uri, home, scene))
    if found.lifecycle_stage == LifecycleStage.DELETED:
        client.restore_experiment(found.experiment_id)
    return found.experiment_id


def _artifacts(address: str, home: Path, scene: str) -> str | None:
    """Return the store's folder for artifacts, where the runs are in its own database or `aug3d up` serves it.

    Any other server has a place of its own; behind an address of this machine may be one of another, or a container.
    """
    if urlsplit(address).scheme in ("http", "https"):
        try:
            ours = json.loads((home / layout.SERVICES / layout.SERVICES_RUNNING).read_bytes())["mlflow"]
        except (OSError, ValueError, KeyError):
            return None
        if address.rstrip("/") != ours:
            return None
    return (home / layout.MLFLOW_ARTIFACTS / scene).as_uri()


def _tell(store: Store, entry: Entry) -> Logged:
    put(store, entry)
    flushed = flush(store)
    if entry.version not in flushed.runs and not flushed.waiting:  # another process was first
        put(store, entry)
        flushed = flush(store)  # finds its run
    run = flushed.runs.get(entry.version)
    if run is None:
        return Logged(waiting=flushed.waiting)
    address = masked(mlflow_address(store)).rstrip("/")
    page = f"{address}/#/experiments/{run.info.experiment_id}/runs/{run.info.run_id}?{_PAGES}"
    return Logged(run.info.run_id, page if page.startswith("http") else "", flushed.waiting)


def _flush(store: Store, client: MlflowClient, flushed: Flushed) -> None:
    for file, entry in waiting(store):
        try:
            run = _send(store, client, entry)
        except StoreError as error:  # a file of it is damaged: it is made again by the next run
            flushed.waiting = f"version {entry.version} of scene {entry.scene} cannot be logged: {error.problem}"
            continue
        except TROUBLE as error:
            client.search_experiments(max_results=1)  # raises if the trouble is not of this version alone
            flushed.waiting = f"MLflow refuses version {entry.version} of scene {entry.scene}: {said(error)}"
            continue
        if run is not None:
            flushed.runs[entry.version] = run
        file.unlink()  # last: a kill before it leaves an entry whose run is then found


def _send(store: Store, client: MlflowClient, entry: Entry) -> Run | None:
    """Log an entry's version unless it is logged; returns its run, None if the version is gone."""
    version = store.root / layout.SCENES / entry.scene / entry.version
    try:
        metrics = version_metrics(version)
    except FileNotFoundError:
        return None
    experiment = experiment_id(client, store.root, entry.scene)
    run = _whole_run(client, experiment, entry.version)
    if run is None:
        bring_report(store, version)  # another machine may have made it
        run = log_version(client, store, experiment, version, metrics, records_of(store, metrics))
    if entry.publish:
        name_published(client, metrics)
    return run


def _whole_run(client: MlflowClient, experiment: str, version: str) -> Run | None:
    """Return a version's run; one that a kill left half is deleted with what is nested in it."""
    for run in client.search_runs([experiment], f"tags.version = '{version}'"):
        if run.info.status != RunStatus.to_string(RunStatus.RUNNING):
            return run
        nested = client.search_runs([experiment], f"tags.`{MLFLOW_PARENT_RUN_ID}` = '{run.info.run_id}'")
        for half in (*nested, run):
            client.delete_run(half.info.run_id)
    return None


def said(error: Exception) -> str:
    """Return the first line of what went wrong, without passwords; MLflow's errors go on for pages."""
    return masked((str(error) or type(error).__name__).splitlines()[0])
