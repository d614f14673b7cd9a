"""The figures and settings of a run by `stage.name`, for MLflow and for comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from aug3d_core.factory.stages import STAGES
from aug3d_core.run import nested
from aug3d_core.run.stage import Metric
from aug3d_core.store.record import Record

SUMS = ("seconds", "work_seconds", "peak_mib")


def flat_metrics(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Return every number of a run as `stage.name`, with seconds and memory per stage."""
    return numbers(flat_values(metrics))


def headline(metrics: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers by which runs are told apart: the views' synthesis, each stage's accuracy and seconds.

    Of a scene in folds, the stages are those of the first.
    """
    flat = flat_metrics(metrics)
    stages = [name for name in metrics["stages"] if name in STAGES]
    chosen = [f"{name}.{figure}" for name in stages for figure in (STAGES[name].accuracy, "seconds")]
    return {name: value for name, value in flat.items() if name in chosen or name in SUMS or name.startswith("nvs.")}


def flat_values(metrics: Mapping[str, Any]) -> dict[str, Metric]:
    """Return every figure of a run, words too, as `stage.name`: the rows of a comparison.

    `nvs.name` is over all folds, `evaluation.name` of the first. `work_seconds` counts steps that were cached as well.
    """
    stages = metrics["stages"]
    work = round(sum(figures["seconds"] for figures in stages.values()), 1)
    flat = {f"nvs.{name}": value for name, value in _flat_synthesis(metrics.get("nvs")).items()}
    flat |= dict(zip(SUMS, (metrics["seconds"], work, metrics["peak_mib"]), strict=True))
    for step, figures in stages.items():
        flat |= {f"{step}.{name}": value for name, value in step_values(figures).items()}
    return flat


def step_values(figures: Mapping[str, Any]) -> dict[str, Metric]:
    """Return a step's figures with its seconds and memory."""
    return {"seconds": figures["seconds"], "peak_mib": figures["peak_mib"], **figures["metrics"]}


def numbers(values: Mapping[str, Any]) -> dict[str, float]:
    """Return those of the values that are numbers."""
    return {name: float(value) for name, value in values.items() if isinstance(value, int | float)}


def _flat_synthesis(nvs: Mapping[str, Any] | None) -> dict[str, Metric]:
    if nvs is None:
        return {}
    flat = {"test_psnr_mean": nvs["test_psnr_mean"]}  # first: MLflow's pages begin with the first metric
    flat |= {name: value for name, value in nvs.items() if not isinstance(value, list | dict)}
    flat["test_psnr_ci_low"], flat["test_psnr_ci_high"] = nvs["test_psnr_ci"] or (None, None)
    flat |= {f"group_{name}": value for name, value in nvs["groups"].items()}
    flat |= {f"cheap_{name}": value for name, value in nvs["cheap"].items()}
    best = max((value for value in nvs["cheap"].values() if value is not None), default=None)
    return flat if best is None else flat | {"over_best_cheap_db": round(nvs["test_psnr_mean"] - best, 4)}


def flat_params(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings of stages as `stage.field`, those of a head as `training.head.field`."""
    return nested.flat(config)


def needs_params(metrics: Mapping[str, Any]) -> dict[str, str]:
    """Return why each setting that was decided is as it is, as `needs.stage.field`; of a scene in folds, those of the first."""
    rows = [row for row in metrics.get("needs", ()) if not row["fold"] and row["by"] == "auto"]
    return {f"needs.{row['field']}": f"{row['value']}: {row['measured']}; {row['rule']}" for row in rows}


def settings_of(records: Mapping[str, Record]) -> dict[str, Metric]:
    """Return the settings that made what is recorded, as `stage.field`; of a scene in folds, those of the first."""
    return flat_params({step: record.config for step, record in records.items() if step in STAGES})
