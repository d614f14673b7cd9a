"""Compare reconstructed poses with the true ones, after the similarity that best maps their camera centres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.geometry.ply import Mesh
from aug3d_core.geometry.views import Views
from aug3d_core.run.stage import Inputs, Metric, Outcome, Progress
from aug3d_core.sfm.files import VIEWS
from aug3d_core.town.config import TruthConfig
from aug3d_core.town.files import TRUTH_MESH
from aug3d_core.town.truth.pose_errors import FEWEST, area_under_recall, footprint_ious, pair_errors_deg, pose_errors
from aug3d_core.town.truth.true_views import true_views

_TABLE = "poses.parquet"
_AUC_DEG = {"half_deg": 0.5, "one_deg": 1.0, "five_deg": 5.0}
_SEED = 0


def run(inputs: Inputs, config: TruthConfig, out: Path, progress: Progress) -> Outcome:
    """Measure how many of the photographs that were not left out have a pose, and how far poses are from the truth."""
    found, truth = Views.load(inputs["sfm"] / VIEWS), true_views(inputs["town"], inputs["sfm"])
    metrics: dict[str, Metric] = {"registered_share": len(found) / len(truth)}
    if len(found) < FEWEST:
        return Outcome(
            metrics=metrics, state="degraded", notes=(f"only {len(found)} photographs have a pose: nothing to compare",)
        )
    errors = pose_errors(found, truth)
    for name in ("position_error_pct", "rotation_error_deg"):
        error = errors[name].to_numpy()
        metrics |= {name: float(np.median(error)), f"{name}_max": float(error.max())}
    of_pairs = pair_errors_deg(found, truth)
    metrics |= {f"pose_auc_{name}": area_under_recall(of_pairs, up_to) for name, up_to in _AUC_DEG.items()}
    town = Mesh.load(inputs["town"] / TRUTH_MESH)
    ious = footprint_ious(found, truth, town, np.random.default_rng(_SEED))
    errors["footprint_iou"] = ious
    metrics |= {"footprint_iou": float(np.median(ious)), "footprint_iou_min": float(np.min(ious))}
    errors.to_parquet(out / _TABLE)
    return Outcome(metrics=metrics)
