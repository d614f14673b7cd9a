"""MLflow: a study is a run, and each of its cells a run nested in it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mlflow.entities import Metric, Param
from mlflow.tracking import MlflowClient
from mlflow.utils.mlflow_tags import MLFLOW_PARENT_RUN_ID

from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import masked, mlflow_address
from aug3d_core.store.store import Store
from aug3d_core.study.cell import Result as CellResult
from aug3d_core.study.findings import Findings
from aug3d_core.tradeoff.arm import Result
from aug3d_core.tradeoff.findings import against_best, crashes, search_against_grid
from aug3d_core.tradeoff.study import Studied
from tasks.reach import unreachable
from tasks.tracking import TROUBLE, experiment_id, said

_BATCH = 900  # MLflow takes at most 1,000 metrics at a time, and 100 parameters or tags


@dataclass(frozen=True)
class Nested:
    """A run to be: `params` are told as text, of `metrics` what is a number."""

    name: str
    tags: Mapping[str, str] = field(default_factory=dict)
    params: Mapping[str, object] = field(default_factory=dict)
    metrics: Mapping[str, object] = field(default_factory=dict)
    failed: bool = False


def log_nested(store: Store, experiment: str, study: Nested, files: Sequence[Path], children: Sequence[Nested]) -> str:
    """Log a study with its files, and its cells as children; returns why MLflow could not be told, "" if it was."""
    address = mlflow_address(store)
    try:
        if why := unreachable(address):
            raise ConnectionError(why)
        client = MlflowClient(address)
        in_experiment = experiment_id(client, store.root, experiment)
        run_id = _begin(client, in_experiment, study)
        for file in files:
            client.log_artifact(run_id, str(file))
        for child in children:
            tags = {**study.tags, **child.tags, MLFLOW_PARENT_RUN_ID: run_id}
            nested = Nested(child.name, tags, child.params, child.metrics, child.failed)
            _end(client, _begin(client, in_experiment, nested), nested)
        _end(client, run_id, study)
    except TROUBLE as error:
        return (
            f"MLflow at {masked(address)} was not told of this study: {said(error)}; mend it and run the study again: "
            "nothing is computed twice"
        )
    return ""


def log_study(store: Store, found: Findings, folder: Path) -> str:
    """Log one of the paper's tables; returns why MLflow could not be told, "" if it was."""
    study = Nested(
        f"study {folder.name}",
        {"scene": found.scene, "preset": found.preset, "study": found.study.name},
        {"seeds": found.seeds, **{name.replace(" ", "_"): value for name, value in found.effort.items()}},
        {"runs": len(found.results), "failed_runs": found.failed, "test_photos": found.test_photos},
    )
    names = (layout.STUDY_PAGE, layout.STUDY_CHART, layout.STUDY_FINDINGS, layout.STUDY_SCORES)
    return log_nested(store, found.scene, study, [folder / name for name in names], [*map(_cell, found.results)])


def log_tradeoff(store: Store, found: Studied, folder: Path) -> str:
    """Log a study of time against accuracy; returns why MLflow could not be told, "" if it was."""
    own = found.scene.own
    study = Nested(
        f"study {folder.name}",
        {"scene": found.scene.name, "preset": own.preset, "study": "tradeoff"},
        {"seeds": found.seeds, "quick": found.quick, "settings": " ".join(own.overrides)},
        {"runs": len(found.results), "crashes": crashes(found), **against_best(found), **search_against_grid(found)},
    )
    names = (layout.STUDY_PAGE, layout.STUDY_CHART, layout.STUDY_FINDINGS, layout.STUDY_SCORES)
    return log_nested(store, found.scene.name, study, [folder / name for name in names], [*map(_tried, found.results)])


def digests(records: Mapping[str, Record]) -> dict[str, str]:
    """Return the tags that say what a run is made of."""
    return {f"digest.{stage}": record.digest for stage, record in records.items()}


def figures(records: Mapping[str, Record]) -> dict[str, object]:
    """Return what the stages of a run measured, by stage and name."""
    return {
        f"{stage}.{name}": value
        for stage, record in records.items()
        for name, value in {**record.metrics, "seconds": record.seconds, "cpu_seconds": record.cpu_seconds}.items()
    }


def _cell(result: CellResult) -> Nested:
    cell = result.cell
    return Nested(
        cell.name,
        {"failure": result.failure, **digests(result.records)},
        {"arm": cell.arm.key, "seed": cell.seed, "fold": cell.fold, **cell.arm.labels},
        figures(result.records),
        bool(result.failure),
    )


def _tried(result: Result) -> Nested:
    records = result.trial.records
    costs = {"cpu_seconds": result.cpu_seconds, "seconds": result.seconds, "peak_mib": result.peak_mib}
    return Nested(
        result.name,
        {"failure": result.trial.failure, "mark": result.arm.mark, **digests(records)},
        {"panel": result.arm.panel, "label": result.arm.label, "seed": result.seed},
        {"accuracy": result.accuracy, "size_bytes": result.size_bytes, **costs, **figures(records)},
        bool(result.trial.failure),
    )


def _begin(client: MlflowClient, experiment: str, run: Nested) -> str:
    run_id = client.create_run(experiment, run_name=run.name, tags=dict(run.tags)).info.run_id
    client.log_batch(run_id, params=[Param(name, str(value)) for name, value in run.params.items()])
    now_ms = int(time.time() * 1000)
    numbers = [
        Metric(name, float(value), now_ms, 0) for name, value in run.metrics.items() if isinstance(value, int | float)
    ]
    for first in range(0, len(numbers), _BATCH):
        client.log_batch(run_id, numbers[first : first + _BATCH])
    return run_id


def _end(client: MlflowClient, run_id: str, run: Nested) -> None:
    client.set_terminated(run_id, status="FAILED" if run.failed else "FINISHED")
