"""The figures of one factory run in the shape of `metrics.json`, and flat for MLflow."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from aug3d_core.errors import Aug3dError
from aug3d_core.store.record import Record

_GROUPS = ("best", "low", "average")
_CHEAP = ("mean_colour", "nearest_copy", "ground_homography", "mesh_render")


def scene_metrics(
    scene: str,
    preset: str,
    git: str,
    seconds: float,
    records: Sequence[tuple[Record, bool]],
    failure: Aug3dError | None = None,
) -> dict[str, Any]:
    """Return the figures of a run; `records` pairs each finished stage with whether it was cached.

    The state is refused when a stage failed, degraded when one was, ok otherwise.
    """
    states = {record.state for record, _ in records}
    state = "refused" if failure else "degraded" if "degraded" in states else "ok"
    result: dict[str, Any] = {
        "scene": scene,
        "state": state,
        "preset": preset,
        "git": git,
        "seconds": round(seconds, 1),
        "peak_mib": max((record.peak_mib for record, _ in records), default=0.0),
        "stages": {record.stage: _stage_figures(record, cached) for record, cached in records},
    }
    if failure:
        result["failure"] = {"problem": failure.problem, "remedy": failure.remedy}
    evaluation = next((record for record, _ in records if record.stage == "evaluation"), None)
    if evaluation is not None:
        result["nvs"] = _view_synthesis(evaluation.metrics)
    return result


def _stage_figures(record: Record, cached: bool) -> dict[str, Any]:
    return {
        "seconds": record.seconds,
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
        **plain,
        "test_psnr_ci": [metrics["test_psnr_ci_low"], metrics["test_psnr_ci_high"]],
        "groups": {name: metrics[f"group_{name}"] for name in _GROUPS},
        "cheap": {name: metrics[f"cheap_{name}"] for name in _CHEAP},
    }


def flat_metrics(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Return every number of a run as `stage.name`, with seconds and memory per stage: the columns of a comparison."""
    flat = {"seconds": metrics["seconds"], "peak_mib": metrics["peak_mib"]}
    for stage, figures in metrics["stages"].items():
        flat |= {f"{stage}.seconds": figures["seconds"], f"{stage}.peak_mib": figures["peak_mib"]}
        flat |= {f"{stage}.{name}": value for name, value in figures["metrics"].items()}
    return {name: float(value) for name, value in flat.items() if isinstance(value, int | float)}


def flat_params(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene's configuration as `stage.field`."""
    return {f"{stage}.{name}": value for stage, fields in config.items() for name, value in fields.items()}


def curves(records: Iterable[Record]) -> Iterator[tuple[str, int, float]]:
    """Yield (`stage.name`, step, value) of every curve, training's PSNR for one."""
    for record in records:
        for name, curve in record.series.items():
            for step, value in curve:
                yield f"{record.stage}.{name}", step, value
