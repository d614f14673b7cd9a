"""The factory as a Prefect flow: photographs in; a data set, a model and its PSNR out."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from prefect import flow

from aug3d_core.charts.report import write_report
from aug3d_core.charts.scene_metrics import scene_metrics
from aug3d_core.errors import Aug3dError, StoreError
from aug3d_core.make import Material, gather
from aug3d_core.scene_config import SceneConfig
from aug3d_core.store import layout
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from aug3d_core.version import code_version
from tasks import artifacts
from tasks.objects import Made, run_stage
from tasks.tracking import log_run


@flow(name="factory", flow_run_name="{scene} {preset}")
def factory(
    scene: str, photos: str | None, preset: str, config: SceneConfig, home: str, poses: str | None = None
) -> dict[str, Any]:
    """Regenerate a scene as far as something changed; returns what its `metrics.json` holds.

    Without photographs the scene is the built-in town; poses that are given are not computed. The typed error of a failed
    stage is raised after everything done before it has been recorded.
    """
    store = Store(Path(home))
    material = Material(photos=Path(photos) if photos else None, poses=Path(poses) if poses else None)
    made: dict[str, Made] = {}
    started = time.monotonic()
    try:
        for stage in material.stages():
            sources = gather(store, stage, {name: m.record for name, m in made.items()}, material)
            made[stage.name] = run_stage(store, stage, getattr(config, stage.name), sources)
    except Aug3dError as error:
        with suppress(StoreError):  # MLflow's trouble must not hide the stage's
            _conclude(store, scene, preset, config, list(made.values()), time.monotonic() - started, error)
        raise
    return _conclude(store, scene, preset, config, list(made.values()), time.monotonic() - started, None)


def _conclude(
    store: Store,
    scene: str,
    preset: str,
    config: SceneConfig,
    made: list[Made],
    seconds: float,
    error: Aug3dError | None,
) -> dict[str, Any]:
    """Write the report and metrics.json and log to MLflow: the same for a good run and a failed one."""
    records = [m.record for m in made]
    metrics = scene_metrics(scene, preset, code_version(), seconds, [(m.record, m.cached) for m in made], error)
    version = new_version(store, scene)
    metrics["paths"] = version_paths(store, version, records)
    write_report([(m.stage, m.record, store.files_dir(m.record)) for m in made], metrics, version / layout.REPORT)
    write_metrics(version, metrics)
    log_run(store.root, config.model_dump(), records, metrics, version / layout.REPORT)
    artifacts.publish_links(metrics)
    return metrics
