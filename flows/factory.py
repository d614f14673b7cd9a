"""The factory as a Prefect flow: photographs in; a data set, a model and its PSNR out."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.runtime import deployment, flow_run

from aug3d_core.charts.comparison import Comparison, compare, side
from aug3d_core.charts.report import write_report
from aug3d_core.charts.scene_metrics import scene_metrics
from aug3d_core.errors import Aug3dError
from aug3d_core.folds import seen_from, steps
from aug3d_core.make import Material, gather
from aug3d_core.needs.decision import Decision
from aug3d_core.needs.rows import needs_of
from aug3d_core.needs.settle import settle
from aug3d_core.scene_config import SceneConfig
from aug3d_core.store import layout
from aug3d_core.store.changes import why_made
from aug3d_core.store.published import published
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import (
    new_version,
    records_before,
    records_of,
    version_metrics,
    version_paths,
    write_metrics,
)
from aug3d_core.store.store import Store
from aug3d_core.version import code_version
from tasks import artifacts
from tasks.alive import alive
from tasks.objects import Made, run_step
from tasks.tracking import log_run


@flow(name="factory", flow_run_name="{scene} {preset}")
def factory(
    scene: str, photos: str | None, preset: str, config: SceneConfig, home: str, poses: str | None = None
) -> dict[str, Any]:
    """Make a scene as far as something changed; returns what its `metrics.json` holds.

    Without photographs the scene is the built-in town; poses that are given are not computed.
    """
    store = Store(Path(home))
    material = Material(photos=Path(photos) if photos else None, poses=Path(poses) if poses else None)
    with alive(store.root), store.using():
        return make_version(store, scene, material, preset, config, records_before(store, scene))


def make_version(
    store: Store, scene: str, material: Material, preset: str, config: SceneConfig, before: Mapping[str, Record]
) -> dict[str, Any]:
    """Make a version of a scene, within a flow; returns what its `metrics.json` holds.

    A small scene is made in folds, from the split on, and tested on all of them. `before` holds what an earlier version is
    made of, by step, and tells why a step is made again. The typed error of a failed stage is raised after everything done
    before it has been recorded.
    """
    made: list[Made] = []
    records: dict[str, Record] = {}
    decisions: dict[str, tuple[Decision, ...]] = {}
    started = time.monotonic()
    try:
        stages = material.stages()
        for step in steps(stages, records):
            seen = seen_from(step, stages, records)
            settled = settle(step.stage, config, seen, store, material)
            decisions[step.name] = settled.decisions
            made.append(run_step(store, step, step.in_fold(settled.config), gather(store, step.stage, seen, material)))
            records[step.name] = made[-1].record
    except Aug3dError as error:
        _conclude(store, scene, preset, made, decisions, before, time.monotonic() - started, error)
        raise
    return _conclude(store, scene, preset, made, decisions, before, time.monotonic() - started, None)


def beside_published(store: Store, metrics: Mapping[str, Any], records: Mapping[str, Record]) -> Comparison | None:
    """Compare a version with the published one of its scene, the first of the two; None if none is published."""
    last = published(store, metrics["scene"])
    if last is None:
        return None
    then = version_metrics(last)
    return compare([side(last.name, then, records_of(store, then)), side("this version", metrics, records)])


def _conclude(
    store: Store,
    scene: str,
    preset: str,
    made: list[Made],
    decisions: Mapping[str, tuple[Decision, ...]],
    before: Mapping[str, Record],
    seconds: float,
    error: Aug3dError | None,
) -> dict[str, Any]:
    """Write the report and metrics.json and log to MLflow: the same for a good run and a failed one."""
    cached = {m.step.name for m in made if m.cached}
    files = [(m.step, m.record, store.files_dir(m.record)) for m in made]
    metrics = scene_metrics(scene, preset, code_version(), seconds, files, cached, error)
    for m in made:
        why = why_made(store, m.step.stage, m.record, before.get(m.step.name))
        metrics["stages"][m.step.name]["why"] = list(why)
    version = new_version(store, scene)
    records = {m.step.name: m.record for m in made}
    metrics["needs"] = needs_of(files, decisions)
    metrics["paths"] = version_paths(store, version, records)
    metrics["flow_run"] = _flow_run()
    write_report(files, metrics, version / layout.REPORT, beside_published(store, metrics, records))
    write_metrics(version, metrics)
    metrics["mlflow"] = asdict(log_run(store.root, version))
    artifacts.publish_links(metrics)
    return metrics


def _flow_run() -> dict[str, str]:
    """Return the flow run's id, and its page where that can still be opened: a deployment's server outlives its runs."""
    return {"id": str(flow_run.id)} | ({"url": str(flow_run.ui_url)} if deployment.id else {})
