"""Versions of a collection's model: `collections/<name>/<time>/` holds the report and `metrics.json` of one training."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aug3d_core.collections.made import HOLD_OUT, MadeCollection
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.published import RULES, psnr_fell, published
from aug3d_core.store.record import Record
from aug3d_core.store.scenes import version_metrics, versions
from aug3d_core.store.store import Store


def collection_metrics(name: str, made: MadeCollection, notes: list[str], code: str, seconds: float) -> dict[str, Any]:
    """Return what `metrics.json` says of a version: each scene with its part and its scores, the training, the objects."""
    assert made.training
    members = {
        scene: {
            "role": member.role,
            "data": {data: {"key": record.key, **_size(record)} for data, record in member.data.items()},
            **({"trouble": member.trouble, "remedy": member.remedy} if member.trouble else {}),
        }
        for scene, member in made.members.items()
    }
    tests = {data: {"role": _role(made, data), **record.metrics} for data, record in made.evaluations.items()}
    troubled = [scene for scene, member in made.members.items() if member.trouble]
    degraded = bool(troubled or made.troubles) or any(record.state == "degraded" for record in made.records)
    return {
        "collection": name,
        "state": "degraded" if degraded else "ok",
        "git": code,
        "seconds": round(seconds, 1),
        "scenes": members,
        "tests": tests,
        "untested": made.troubles,
        "training": {
            "key": made.training.key,
            "cpu_seconds": made.training.cpu_seconds,
            "peak_mib": made.training.peak_mib,
            **made.training.metrics,
        },
        "notes": [*notes, *made.training.notes],
        "objects": [list(item) for item in made.objects],
    }


def held_back(metrics: Mapping[str, Any], before: Mapping[str, Any] | None, most_psnr_drop_db: float) -> str | None:
    """Return why a version must not replace the published one, or None if it may.

    Each test is compared with itself, where its photographs and rules are the same. A version that lost a scene of the
    published one to an error is not published.
    """
    if not metrics["tests"]:
        return "no scene of it has a test"
    for data, then in (before or {}).get("tests", {}).items():
        now = metrics["tests"].get(data)
        if now is None:
            lost = metrics["untested"].get(data) or metrics["scenes"].get(data, {}).get("trouble")
            if lost:
                return f"{data} could not be judged: {lost}"
            continue  # it was taken out of the collection
        if any(now.get(rule) != then.get(rule) for rule in RULES):
            continue
        if fell := psnr_fell(then["test_psnr_mean"], now["test_psnr_mean"], most_psnr_drop_db):
            return f"{data}: {fell}"
    return None


def metrics_in_use(store: Store, name: str) -> dict[str, Any]:
    """Return the `metrics.json` of a collection's published version, else of its newest; raises UsageError without one."""
    found = versions(store, name, layout.COLLECTIONS)
    if not found:
        raise UsageError(f"collection {name!r} has no model yet", f"train it: aug3d collections train {name}")
    return version_metrics(published(store, name, layout.COLLECTIONS) or found[-1])


def model_of(store: Store, name: str) -> Record:
    """Return the trained model of a collection's version in use; raises UsageError if it has none."""
    metrics = metrics_in_use(store, name)
    record = store.find("training", metrics["training"]["key"])
    if record is None:
        raise StoreError(f"the model of collection {name!r} is gone from {store.root}", "train the collection again")
    return record


def _size(record: Record) -> dict[str, Any]:
    return {
        name: record.metrics[name]
        for name in ("views", "groups_real", "groups_rendered", "groups_test")
        if name in record.metrics
    }


def _role(made: MadeCollection, data: str) -> str:
    return next((member.role for member in made.members.values() if data in member.data), HOLD_OUT)
