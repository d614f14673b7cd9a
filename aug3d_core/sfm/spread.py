"""How far apart several reconstructions of the same photographs are. Plain numpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aug3d_core.geometry.similarity import fit_similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.geometry.views import Views


def spread_pct(runs: Sequence[Views]) -> float:
    """Return the median over photographs and runs of a camera centre's distance to that of the first run.

    In percent of the first run's extent (diagonal of the box about its centres), after the similarity that best maps each
    run to the first. Photographs that some run lacks do not count. There must be two runs with three photographs in common.
    """
    shared = sorted(set.intersection(*(set(run.photo_id.tolist()) for run in runs)))
    first, *others = (_centres_of(run, shared) for run in runs)
    off = [np.linalg.norm(fit_similarity(other, first).apply(other) - first, axis=1) for other in others]
    return float(100 * np.median(np.concatenate(off)) / np.linalg.norm(np.ptp(first, axis=0)))


def _centres_of(run: Views, photo_ids: Sequence[int]) -> np.ndarray:
    return centres(run.cam_from_world)[np.searchsorted(run.photo_id, photo_ids)]
