"""The factory as a Prefect flow: photographs in; a data set, a model and its PSNR out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from prefect import flow
from prefect.runtime import deployment, flow_run

from aug3d_core.factory.auto.rows import needs_of
from aug3d_core.factory.config import SceneConfig
from aug3d_core.factory.estimate.room import needed_bytes, size_words
from aug3d_core.factory.material import Material
from aug3d_core.factory.walk import Visit, walk
from aug3d_core.metrics.comparison import Comparison, compare, side
from aug3d_core.metrics.pooled import psnr_by_photo
from aug3d_core.metrics.scene_metrics import scene_metrics
from aug3d_core.report.reads import read_of
from aug3d_core.report.scene_report import write_report
from aug3d_core.run.errors import Aug3dError, DiskFull, StageFailed
from aug3d_core.run.full_disk import disk_full
from aug3d_core.run.progress import failures_logged
from aug3d_core.store import layout
from aug3d_core.store.changes import why_made
from aug3d_core.store.code_version import code_version
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import (
    new_version,
    published_metrics,
    records_before,
    records_of,
    share_version,
    step_objects,
    version_paths,
    write_metrics,
)
from aug3d_core.store.store import Store
from aug3d_core.store.traffic import Traffic
from flows.plan import checked_plan
from tasks import artifacts, progress
from tasks.build_task import through_prefect
from tasks.run_locks import run_lock
from tasks.tracking import log_run


@flow(name="factory", flow_run_name="{scene} {preset}")
def factory(
    scene: str, photos: str | None, preset: str, config: SceneConfig, home: str, poses: str | None = None
) -> dict[str, Any]:
    """Make a scene, reusing what did not change; returns the content of its `metrics.json`.

    Without photographs the scene is the built-in town. Given poses are not computed.
    """
    store = Store(Path(home))
    material = Material(photos=Path(photos) if photos else None, poses=Path(poses) if poses else None)
    since = store.traffic()
    with run_lock(store.root), store.using():
        before = records_before(store, scene)
        plan = checked_plan(store, scene, material, config, before)
        return make_version(store, scene, material, preset, config, before, plan, since)


def make_version(
    store: Store,
    scene: str,
    material: Material,
    preset: str,
    config: SceneConfig,
    before: Mapping[str, Record],
    plan: Sequence[Visit],
    since: Traffic,
) -> dict[str, Any]:
    """Make a version of a scene, within a flow; returns the content of its `metrics.json`.

    A small scene is made in folds, from the split on, and tested on all of them. before: the objects of an earlier version
    by step, to reuse their work, and to say why a step is built again. plan: what a look at the store found just before.
    since: what had been asked of the shared store when the run began. The typed error of a failed stage is raised after
    everything done before it has been recorded.
    """
    made: list[Visit] = []
    started = time.monotonic()
    make = through_prefect(store)
    if store.shared is not None and deployment.id:
        from flows.shares import with_help  # with Prefect's workers, which other runs do without

        make = with_help(store, make)
    known = {visit.step.name: visit for visit in plan}
    try:
        for visit in walk(store, material.stages(), config, material, make, plan=known, before=before):
            made.append(visit)
            progress.finished(visit)
            with failures_logged():
                artifacts.publish(store, visit)
    except Aug3dError as error:
        if isinstance(error, DiskFull) or (isinstance(error, StageFailed) and error.cause == "disk"):
            done = {visit.step.name for visit in made}
            left = [visit.step for visit in plan if visit.record is None and visit.step.name not in done]
            needed = needed_bytes(store, material, config, before, left)
            error.remedy += f"; what is left of this run may need {size_words(needed)}" if needed else ""
        try:
            _conclude(store, scene, preset, made, before, time.monotonic() - started, since, error)
        except Exception as second:
            if not disk_full(second):  # what filled the disk for the stage leaves no room for a report of it
                raise
        raise
    return _conclude(store, scene, preset, made, before, time.monotonic() - started, since, None)


def beside_published(store: Store, metrics: Mapping[str, Any], records: Mapping[str, Record]) -> Comparison | None:
    """Compare a version with the published one of its scene, the first of the two; None if none is published."""
    then = published_metrics(store, metrics["scene"])
    if then is None:
        return None
    name = Path(then["paths"]["metrics"]).parent.name
    before = records_of(store, then)
    return compare(
        [
            side(name, then, before, psnr_by_photo(store, before)),
            side("this version", metrics, records, psnr_by_photo(store, records)),
        ]
    )


def _conclude(
    store: Store,
    scene: str,
    preset: str,
    made: list[Visit],
    before: Mapping[str, Record],
    seconds: float,
    since: Traffic,
    error: Aug3dError | None,
) -> dict[str, Any]:
    """Write the report and metrics.json and log to MLflow: the same for a good run and a failed one."""
    cached = {m.step.name for m in made if m.cached}
    files = [(m.step, m.record, _files(store, m.record)) for m in made]
    metrics = scene_metrics(scene, preset, code_version(), seconds, files, cached, error)
    for m in made:
        why = why_made(store, m.step.stage, m.record, before.get(m.step.name))
        told = metrics["stages"][m.step.name]
        told["why"] = [*why, *_damage(m)]
        told["notes"] = [*told["notes"], *_damage(m)]
    version = new_version(store, scene)
    records = {m.step.name: m.record for m in made}
    metrics["needs"] = needs_of(files, {m.step.name: m.decisions for m in made})
    metrics["paths"] = version_paths(store, version, records)
    metrics["flow_run"] = _flow_run()
    if store.shared is not None:
        metrics["shared_store"] = store.traffic().since(since).told()  # but for the version itself, which is put last
    write_report(files, metrics, version / layout.REPORT, beside_published(store, metrics, records))
    write_metrics(version, metrics)
    tell(store, version, metrics)
    return metrics


def tell(store: Store, version: Path, metrics: dict[str, Any]) -> None:
    """Give a version that is written to other machines and to MLflow; a run that is killed before leaves it to the next."""
    share_version(store, version, step_objects(metrics).values())
    metrics["mlflow"] = asdict(log_run(store.root, version))
    artifacts.publish_links(metrics)
    (version / layout.TOLD).touch()


def _files(store: Store, record: Record) -> Path:
    """Return the folder of an object with the files that the report reads, if it reads any."""
    reads = read_of(record)
    return store.files_dir(record, reads) if reads else store.place(record)


def _damage(visit: Visit) -> list[str]:
    return [f"damaged in the store: {visit.built.damage}"] if visit.built and visit.built.damage else []


def _flow_run() -> dict[str, str]:
    """Return the flow run's id, and its page where that can still be opened: a deployment's server outlives its runs."""
    return {"id": str(flow_run.id)} | ({"url": str(flow_run.ui_url)} if deployment.id else {})
