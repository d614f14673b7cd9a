"""Compare reconstructed poses with the true ones, after the similarity that best maps their camera centres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views
from aug3d_core.stage import Inputs, Metric, Outcome, Progress
from aug3d_core.store import layout
from aug3d_core.testbed.config import TruthConfig

_FEWEST = 3  # centres that fix a similarity
_TABLE = "poses.parquet"


def run(inputs: Inputs, config: TruthConfig, out: Path, progress: Progress) -> Outcome:
    """Measure how many photographs have a pose, and how far poses are from the truth."""
    found, truth = Views.load(inputs["sfm"] / layout.VIEWS), Views.load(inputs["town"] / layout.TRUTH_POSES)
    metrics: dict[str, Metric] = {"registered_share": len(found) / len(truth)}
    if len(found) < _FEWEST:
        return Outcome(
            metrics=metrics, state="degraded", notes=(f"only {len(found)} photographs have a pose: nothing to compare",)
        )
    errors = pose_errors(found, truth)
    errors.to_parquet(out / _TABLE)
    for name in ("position_error_pct", "rotation_error_deg"):
        error = errors[name].to_numpy()
        metrics |= {name: float(np.median(error)), f"{name}_max": float(error.max())}
    return Outcome(metrics=metrics)


def pose_errors(found: Views, truth: Views) -> pd.DataFrame:
    """Return each found view's error: of its centre in % of the flight's extent, of its rotation in degrees.

    Views are paired by photo_id, which counts photographs in the order of capture in both.
    """
    true = truth.take(np.searchsorted(truth.photo_id, found.photo_id))
    true_centres, found_centres = centres(true.cam_from_world), centres(found.cam_from_world)
    align = fit_similarity(found_centres, true_centres)
    off_m = np.linalg.norm(align.apply(found_centres) - true_centres, axis=1)
    extent_m = np.linalg.norm(np.ptp(true_centres, axis=0))
    found_rotation = found.cam_from_world[:, :, :3] @ align.rotation.T
    return pd.DataFrame(
        {
            "photo_id": found.photo_id,
            "position_error_pct": 100 * off_m / extent_m,
            "rotation_error_deg": np.degrees(_angle_rad(found_rotation, true.cam_from_world[:, :, :3])),
        }
    )


def _angle_rad(a: Float[np.ndarray, "n 3 3"], b: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, " n"]:
    """Return the angle between rotations, from the chord, which is exact for small angles where arccos is not."""
    chord = np.linalg.norm(a - b, axis=(1, 2)) / np.sqrt(8.0)
    return 2 * np.arcsin(np.clip(chord, 0, 1))
