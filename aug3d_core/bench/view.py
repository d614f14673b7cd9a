"""How fast `aug3d view` predicts: from the command's model to its first view, and along a path through the scene."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aug3d_core.bench.figure import Figure, at_least, at_most, in_own_process
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, Say, directly, run_trial
from aug3d_core.view.poses import Pose, through

if TYPE_CHECKING:
    from aug3d_core.view.predictor import Predictor

_KEYS, _FRAMES = 6, 60
_GOAL_VIEWS, _GOAL_FIRST_S = 10.0, 3.0


def figures(store: Store, scene: Measured, say: Say) -> dict[str, Figure]:
    """Train on the town, and predict views of it as the page does while its camera moves."""
    trial = run_trial(store, "training", scene, (), directly(store, say))
    if trial.failure:
        return {"view": Figure(None, "", None, None, trial.failure)}
    folders = [store.files_dir(trial.records[step]) for step in ("dataset", "training")]
    inputs = scene.config().evaluation.input_views
    first_s, whole_s, half_s = in_own_process(partial(_timed, *folders, inputs))
    return {
        "view_first_seconds": at_most(_GOAL_FIRST_S, first_s, "s"),
        "view_seconds_median": Figure(whole_s, "s"),
        "views_per_second": at_least(_GOAL_VIEWS, 1 / whole_s, "1/s"),
        "views_per_second_half_size": Figure(1 / half_s, "1/s"),
    }


def _timed(dataset: Path, training: Path, inputs: int) -> tuple[float, float, float]:
    """Return seconds from nothing to a first view, and the median of a view along a path, whole and at half its size."""
    begun = time.perf_counter()
    from aug3d_core.view.predictor import Predictor  # with torch: it is part of what a person waits for

    predictor = Predictor.load(dataset, training, inputs)
    path = _path(predictor)
    predictor.predict(path[0], quick=True)
    first_s = time.perf_counter() - begun
    whole_s, half_s = (
        float(np.median([predictor.predict(pose, quick=True, half=half).seconds for pose in path]))
        for half in (False, True)
    )
    return first_s, whole_s, half_s


def _path(predictor: Predictor) -> list[Pose]:
    """Return a flight through photographs that are spread over the scene."""
    scene = predictor.scene
    rows = np.flatnonzero(scene.photo_id >= 0)
    keys = scene.world_from_cam[rows[np.linspace(0, len(rows) - 1, _KEYS).astype(int)]]
    return [Pose(pose, predictor.fov_rad) for pose in through(keys, _FRAMES, scene.scale)]
