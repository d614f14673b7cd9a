"""A version of a scene as MLflow sees it: a run with what tells versions apart, and a run nested in it for each step."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mlflow.entities import Dataset, DatasetInput, InputTag, Metric, Param, Run
from mlflow.tracking import MlflowClient
from mlflow.utils.mlflow_tags import MLFLOW_DATASET_CONTEXT, MLFLOW_PARENT_RUN_ID, MLFLOW_RUN_NOTE, MLFLOW_SOURCE_NAME

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.factory.plan import stage_of
from aug3d_core.judging.names import called, interval_words
from aug3d_core.metrics.flat import flat_params, headline, needs_params, numbers, settings_of, step_values
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from tasks.model_registry import register

_METRICS, _PARAMS = 1000, 100  # MLflow refuses more in one call
_DIGEST = 12  # letters of a data set's digest that the UI has room for; its profile holds all
_SHOWN = ("sfm", "similarity", "grouping", "surface", "sampling", "evaluation")  # whose pictures tell what a version is
_JUDGED = ("dataset", "training", "evaluation")

Series = Mapping[str, tuple[tuple[int, float], ...]]


def log_version(
    client: MlflowClient,
    store: Store,
    experiment: str,
    version: Path,
    metrics: dict[str, Any],
    records: Mapping[str, Record],
) -> Run:
    """Log a version: settings, headline figures, report, pictures, data set and model; and each of its steps.

    `records` holds what was made, by step. Without a report, which may be gone, the run's description says so. The run is
    ended last: one that still counts as running is not whole.
    """
    end_ms = int((version / layout.METRICS).stat().st_mtime * 1000)
    start_ms = end_ms - int(metrics["seconds"] * 1000)
    run = client.create_run(experiment, start_ms, _tags(version, metrics), version.name)
    run_id = run.info.run_id
    figures = headline(metrics)
    curves = {name: curve for step, record in records.items() for name, curve in _series(step, record).items()}
    points = _points(figures, {name: curve for name, curve in curves.items() if name in figures}, end_ms)
    _log_batches(client, run_id, settings_of(records) | needs_params(metrics), points)
    if "dataset" in records:
        client.log_inputs(run_id, [_data_set(store, metrics["scene"], records["dataset"])])
    for file in (version / layout.REPORT, version / layout.METRICS):
        if file.exists():
            client.log_artifact(run_id, str(file))
    for step in (step for step in _SHOWN if step in records):
        _log_pictures(client, run_id, store, records[step], step)
    begin_ms = start_ms + 1  # MLflow lists runs by when they began: the version's before those of its steps
    for step in metrics["stages"]:
        begin_ms = _log_step(client, store, run, step, metrics, records.get(step), begin_ms)
    register(client, run, store, records, metrics)
    client.set_terminated(run_id, "FAILED" if metrics["state"] == "refused" else "FINISHED", end_ms)
    return run


def _log_step(
    client: MlflowClient,
    store: Store,
    parent: Run,
    step: str,
    metrics: dict[str, Any],
    record: Record | None,
    start_ms: int,
) -> int:
    """Log a step under names of its stage, so that folds stand side by side; returns when it ended.

    The pictures of a step that was cached are with the run that computed it.
    """
    figures = metrics["stages"][step]
    stage = stage_of(step).name
    end_ms = start_ms + (1 if figures["cached"] else int(figures["seconds"] * 1000))
    tags = {name: str(metrics[name]) for name in ("scene", "preset", "git")}
    tags |= {"stage": stage, "state": figures["state"], "cached": str(figures["cached"]).lower()}
    tags |= {"digest": figures["digest"], MLFLOW_PARENT_RUN_ID: parent.info.run_id, MLFLOW_SOURCE_NAME: "aug3d"}
    if said := [*figures["notes"], *figures.get("why", ())]:
        tags[MLFLOW_RUN_NOTE] = "\n".join(f"* {line}" for line in said)
    run_id = client.create_run(parent.info.experiment_id, start_ms, tags, step).info.run_id
    values = numbers({f"{stage}.{name}": value for name, value in step_values(figures).items()})
    series, params = (_series(stage, record), flat_params({stage: record.config})) if record else ({}, {})
    _log_batches(client, run_id, params, _points(values, series, end_ms))
    if record is not None and not figures["cached"]:
        _log_pictures(client, run_id, store, record)
    client.set_terminated(run_id, end_time=end_ms)
    return end_ms


def _series(name: str, record: Record) -> Series:
    return {f"{name}.{curve}": points for curve, points in record.series.items()}


def _points(figures: Mapping[str, float], series: Series, at_ms: int) -> Iterator[Metric]:
    """Yield every curve, and every figure that is not the end of one."""
    for name in {**figures, **series}:
        for step, value in series.get(name) or ((0, figures[name]),):
            yield Metric(name, value, at_ms, step)


def _log_batches(client: MlflowClient, run_id: str, params: Mapping[str, Any], metrics: Iterable[Metric]) -> None:
    """Log in as few calls as MLflow allows: each is a transaction."""
    told, set_ = list(metrics), [Param(name, str(value)) for name, value in params.items()]
    for call in range(max(-(-len(told) // _METRICS), -(-len(set_) // _PARAMS))):
        client.log_batch(
            run_id,
            metrics=told[call * _METRICS : (call + 1) * _METRICS],
            params=set_[call * _PARAMS : (call + 1) * _PARAMS],
        )


def _log_pictures(client: MlflowClient, run_id: str, store: Store, record: Record, folder: str | None = None) -> None:
    for path in record.pictures.values():
        client.log_artifact(run_id, str(store.file(record, path)), artifact_path=folder)


def _data_set(store: Store, scene: str, record: Record) -> DatasetInput:
    source = json.dumps({"uri": str(store.place(record) / SCENE_ZARR)})
    profile = json.dumps({"digest": record.digest, **numbers(record.metrics)})
    data = Dataset(scene, record.digest[:_DIGEST], "local", source, profile=profile)
    return DatasetInput(data, [InputTag(MLFLOW_DATASET_CONTEXT, "training")])


def _tags(version: Path, metrics: Mapping[str, Any]) -> dict[str, str]:
    tags = {name: str(metrics[name]) for name in ("scene", "preset", "git", "state")}
    tags |= {"version": version.name, "folder": str(version), MLFLOW_SOURCE_NAME: "aug3d"}
    tags |= {f"digest.{step}": metrics["stages"][step]["digest"] for step in _JUDGED if step in metrics["stages"]}
    tags |= {f"flow_run.{name}": str(value) for name, value in metrics.get("flow_run", {}).items()}
    if nvs := metrics.get("nvs"):
        tags |= {name: str(nvs[name]) for name in ("test_photos", "conventions") if nvs.get(name)}
    return tags | {MLFLOW_RUN_NOTE: _description(version, metrics)}


def _description(version: Path, metrics: Mapping[str, Any]) -> str:
    """Say in a few lines what came of the run."""
    lines = [f"**{metrics['scene']}**, preset {metrics['preset']}: {metrics['state']}"]
    if nvs := metrics.get("nvs"):
        lines.append(
            f"PSNR **{nvs['test_psnr_mean']:.2f} dB**{interval_words(nvs['test_psnr_ci'])}, SSIM {nvs['test_ssim_mean']:.3f},"
            f" on {nvs['test_views']} held-out photographs"
        )
        cheap = (f"{called(name)} {value:.2f}" for name, value in nvs["cheap"].items() if value is not None)
        lines.append(f"Cheap answers, dB: {', '.join(cheap)}")
    if failure := metrics.get("failure"):
        lines.append(f"Failed: {failure['problem']}\n\n{failure['remedy']}")
    if not (version / layout.REPORT).exists():
        lines.append(f"Without its report: {version / layout.REPORT} is gone")
    computed = [step for step, figures in metrics["stages"].items() if not figures["cached"]]
    lines.append(f"Computed: {', '.join(computed) or 'nothing, all was cached'}")
    lines += [f"{step}: {note}" for step, figures in metrics["stages"].items() for note in figures["notes"]]
    return "\n\n".join(lines)
