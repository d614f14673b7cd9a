"""The similarity stage: tracks -> number of shared points for every pair of views."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import sparse

from aug3d_core.geometry.shared_points import components, shared_points, visibility
from aug3d_core.geometry.views import Points, Tracks, Views
from aug3d_core.groups.config import SimilarityConfig
from aug3d_core.groups.files import SHARED_POINTS, SIMILARITY_PICTURE
from aug3d_core.groups.picture import draw_similarity
from aug3d_core.run.stage import Inputs, Outcome, Progress
from aug3d_core.sfm.files import POINTS, TRACKS, VIEWS

CONNECTED_POINTS = 20  # shared by two views that count as connected: fewer may be chance


def run(inputs: Inputs, config: SimilarityConfig, out: Path, progress: Progress) -> Outcome:
    """Write the similarity matrix."""
    views = Views.load(inputs["sfm"] / VIEWS)
    points = Points.load(inputs["sfm"] / POINTS)
    tracks = Tracks.load(inputs["sfm"] / TRACKS)
    shared = shared_points(visibility(tracks, len(views), len(points.xyz)))
    sparse.save_npz(out / SHARED_POINTS, shared)
    draw_similarity(shared, out / SIMILARITY_PICTURE)
    progress(1, 1, "views compared")
    sizes = np.bincount(components(shared, CONNECTED_POINTS))
    pairs = sparse.triu(shared, k=1).data
    metrics = {
        "views": len(views),
        "pairs": len(pairs),
        "pairs_share": len(pairs) / max(1, len(views) * (len(views) - 1) / 2),
        "connected_share": sizes.max() / len(views),
        "shared_points_mean": float(pairs.mean()) if len(pairs) else 0.0,
        "shared_points_max": int(pairs.max()) if len(pairs) else 0,
        "points_per_view_median": float(np.median(shared.diagonal())),
    }
    notes = []
    if len(sizes) > 1:
        apart = len(views) - sizes.max()
        notes.append(f"{apart} views share fewer than {CONNECTED_POINTS} points with any view of the main part")
    pictures = {"Shared points of every pair": SIMILARITY_PICTURE}
    return Outcome(metrics=metrics, notes=tuple(notes), pictures=pictures)
