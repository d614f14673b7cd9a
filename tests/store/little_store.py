"""Objects, versions and studies of a few bytes, named as the tests like."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from aug3d_core.run.files import FILES
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store

_FIELDS = {
    "recipe": "r1", "config": {}, "inputs": {}, "versions": {}, "metrics": {}, "state": "ok", "notes": (), "series": {},
    "pictures": {}, "seconds": 1.0, "peak_mib": 2.0,
}  # fmt: skip


def add_object(store: Store, stage: str, key: str, size_bytes: int = 1000, **fields: Any) -> Record:
    """Commit an object of two files, one of them of the given size."""
    work = store.work_dir(stage, key)
    (work / FILES / "sub").mkdir(parents=True)
    (work / FILES / "sub" / "big").write_bytes(bytes(size_bytes))
    (work / FILES / "small").write_text(key)
    return store.commit(work, stage, key, {**_FIELDS, **fields})


def add_version(store: Store, scene: str, name: str, objects: Iterable[tuple[str, str]], failed: bool = False) -> Path:
    """Write a version that names these objects; a step is called as its stage, and from the second on with a fold."""
    folder = store.root / layout.SCENES / scene / name
    folder.mkdir(parents=True)
    (folder / layout.REPORT).write_text("a report")
    steps = {f"{stage}_fold{i}": (stage, key) for i, (stage, key) in enumerate(objects)}
    told: dict[str, Any] = {"scene": scene, "state": "refused" if failed else "ok", "preset": "tiny"}
    told["objects"] = {step: {"stage": s, "key": key} for step, (s, key) in steps.items()}
    told |= {"failure": {"problem": "p", "remedy": "r"}} if failed else {}
    (folder / layout.METRICS).write_text(json.dumps(told))
    return folder


def add_study(store: Store, scene: str, name: str, objects: Iterable[tuple[str, str]]) -> Path:
    """Write a study that names these objects."""
    folder = store.root / layout.STUDIES / scene / name
    folder.mkdir(parents=True)
    (folder / layout.STUDY_FINDINGS).write_text(json.dumps({"cells": 3, "objects": list(objects)}))
    return folder


def add_collection_version(store: Store, name: str, version: str, objects: Iterable[tuple[str, str]]) -> Path:
    """Write a version of a collection that names these objects."""
    folder = store.root / layout.COLLECTIONS / name / version
    folder.mkdir(parents=True)
    (folder / layout.METRICS).write_text(json.dumps({"collection": name, "objects": list(objects)}))
    return folder


def make_old(folder: Path, hours: float = 48.0) -> None:
    """Let a folder and all in it look as if they had not been touched for so long."""
    then = time.time() - 3600 * hours
    for path in (*folder.rglob("*"), folder):
        os.utime(path, (then, then))
