"""Versions of a scene: `scenes/<scene>/<time>/` holds the report and `metrics.json` of one run."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from aug3d_core.errors import UsageError
from aug3d_core.scene_name import check_scene_name
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store, write_synced


def new_version(store: Store, scene: str) -> Path:
    """Create the folder of a new version, named by the time in UTC so that names sort."""
    name = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%S.%f")[:-3]
    folder = store.root / layout.SCENES / check_scene_name(scene) / name
    folder.mkdir(parents=True)
    return folder


def write_metrics(version: Path, metrics: dict[str, Any]) -> None:
    """Write a version's `metrics.json`; a version counts from this moment."""
    write_synced(version / layout.METRICS, json.dumps(metrics, indent=1).encode())


def version_paths(store: Store, version: Path, records: Iterable[Record]) -> dict[str, Any]:
    """Return where everything of a version lies: metrics, report, the MLflow store, each stage's files."""
    return {
        "metrics": str(version / layout.METRICS),
        "report": str(version / layout.REPORT),
        "mlflow": os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{store.root / layout.MLFLOW_DATABASE}",
        "objects": {record.stage: str(store.files_dir(record)) for record in records},
    }


def scenes(store: Store) -> list[str]:
    """Return the names of all scenes that have a version."""
    return sorted({path.parent.parent.name for path in (store.root / layout.SCENES).glob(f"*/*/{layout.METRICS}")})


def last_version(store: Store, scene: str) -> dict[str, Any]:
    """Return the `metrics.json` of a scene's newest version; raises UsageError if there is none."""
    folder = store.root / layout.SCENES / check_scene_name(scene)
    versions = sorted(folder.glob(f"*/{layout.METRICS}"))
    if not versions:
        known = ", ".join(scenes(store)) or "none yet"
        raise UsageError(
            f"there is no scene {scene!r} in {store.root}", f"scenes here: {known}; make one with aug3d run"
        )
    return json.loads(versions[-1].read_bytes())
