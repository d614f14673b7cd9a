"""Run the matching and sfm stages, each in a process of its own as the factory runs it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.photos.config import PhotosConfig
from aug3d_core.photos.stage import run as take_in


def take_photos(folder: Path, out: Path) -> Path:
    out.mkdir(parents=True)
    take_in({"folder": folder}, PhotosConfig(), out, lambda done, total, what: None)
    return out


def run_stage(
    stage: str, folder: Path, inputs: dict[str, Path], cpus: set[int] | None = None, **config: Any
) -> dict[str, Any]:
    """Run a stage of the package; return its outcome, or its error."""
    folder.mkdir(parents=True)
    job = {"stage": stage, "config": config, "inputs": {name: str(path) for name, path in inputs.items()}}
    (folder / "job.json").write_text(json.dumps(job))
    subprocess.run(
        [sys.executable, "-m", "aug3d_core.sfm", str(folder / "job.json")],
        check=False,
        preexec_fn=None if cpus is None else lambda: os.sched_setaffinity(0, cpus),
        timeout=300,
    )
    result = folder / "outcome.json" if (folder / "outcome.json").exists() else folder / "error.json"
    return json.loads(result.read_text())


def run_sfm(
    photos: Path,
    folder: Path,
    cpus: set[int] | None = None,
    sfm: Mapping[str, Any] | None = None,
    earlier: Path | None = None,
    **matching: int,
) -> dict[str, Any]:
    """Match in `<folder>_matching` and run the sfm stage; return the outcome or the first error of the two."""
    matches = folder.with_name(f"{folder.name}_matching")
    matched = run_stage("matching", matches, {"photos": photos}, cpus, **matching)
    if "problem" in matched:
        return matched
    inputs = {"photos": photos, "matching": matches / "files"} | ({"earlier": earlier} if earlier else {})
    return run_stage("sfm", folder, inputs, cpus, **(sfm or {}))


def loaded(folder: Path) -> tuple[Views, Points, Tracks]:
    files = folder / "files"
    return Views.load(files / "views.npz"), Points.load(files / "points.npz"), Tracks.load(files / "tracks.npz")
