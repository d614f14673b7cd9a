"""The figures of one factory run in the shape of `metrics.json`."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from aug3d_core.factory.plan import Step, fold_count
from aug3d_core.judging.names import ends_of
from aug3d_core.judging.summary import CHEAP
from aug3d_core.metrics.pooled import pooled
from aug3d_core.run.errors import Aug3dError
from aug3d_core.store.record import Record

_GROUPS = ("best", "low", "average")

Made = Sequence[tuple[Step, Record, Path]]  # the step, its record, the folder with its files


def scene_metrics(
    scene: str,
    preset: str,
    git: str,
    seconds: float,
    made: Made,
    cached: Collection[str] = (),
    failure: Aug3dError | None = None,
) -> dict[str, Any]:
    """Return the figures of a run; `cached` names the steps that did not have to be computed.

    The state is refused when a stage failed, degraded when one was, ok otherwise. A scene that is made in folds has figures
    of its views' synthesis once all are tested, and they are over all of them.
    """
    records = {step.name: record for step, record, _ in made}
    states = {record.state for record in records.values()}
    state = "refused" if failure else "degraded" if "degraded" in states else "ok"
    result: dict[str, Any] = {
        "scene": scene,
        "state": state,
        "preset": preset,
        "git": git,
        "seconds": round(seconds, 1),
        "peak_mib": max((record.peak_mib for record in records.values()), default=0.0),
        "stages": {name: _stage_figures(record, name in cached) for name, record in records.items()},
        "objects": {name: {"stage": record.stage, "key": record.key} for name, record in records.items()},
    }
    if failure:
        result["failure"] = {"problem": failure.problem, "remedy": failure.remedy}
    tests = [(record, folder) for step, record, folder in made if step.stage.name == "evaluation"]
    if tests and len(tests) == fold_count(records):
        result["nvs"] = _view_synthesis(pooled(tests))
        result["nvs"]["fold_psnr_means"] = [record.metrics["test_psnr_mean"] for record, _ in tests]
    return result


def _stage_figures(record: Record, cached: bool) -> dict[str, Any]:
    return {
        "seconds": record.seconds,
        "cpu_seconds": record.cpu_seconds,
        "peak_mib": record.peak_mib,
        "cached": cached,
        "state": record.state,
        "notes": list(record.notes),
        "size_mib": round(record.size_bytes / 2**20, 2),
        "digest": record.digest,
        "metrics": record.metrics,
    }


def _view_synthesis(metrics: Mapping[str, Any]) -> dict[str, Any]:
    plain = {
        name: value
        for name, value in metrics.items()
        if name.startswith("test_") and not name.startswith("test_psnr_ci")
    }
    return {
        "head": metrics.get("head"),
        **plain,
        "test_psnr_ci": ends_of(metrics, "test_psnr"),
        "conventions": metrics.get("conventions"),  # results are compared only where these are the same
        "groups": {name: metrics[f"group_{name}"] for name in _GROUPS},
        "cheap": {name: metrics[f"cheap_{name}"] for name in CHEAP},
        "over_ci": {name: ends_of(metrics, f"over_{name}") for name in CHEAP},
    }
