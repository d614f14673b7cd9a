"""What `aug3d bench view` times is the predictor on a path through the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.bench.view import _FRAMES, _path, _timed
from aug3d_core.store.scenes import last_version, object_of
from aug3d_core.store.store import Store
from aug3d_core.view.predictor import Predictor
from tests.view.finished_scene import finished_scene


def test_a_first_view_and_a_path_are_timed(tmp_path: Path) -> None:
    finished_scene(tmp_path)
    store = Store(tmp_path)
    version = last_version(store, "toy")
    dataset, training = (store.files_dir(object_of(store, version, step)) for step in ("dataset", "training"))
    first_s, whole_s, half_s = _timed(dataset, training, 3)
    assert first_s > whole_s > 0 and half_s > 0
    predictor = Predictor.load(dataset, training, 3)
    path = _path(predictor)
    at = np.stack([pose.world_from_cam[:3, 3] for pose in path])
    assert len(path) == _FRAMES and np.linalg.norm(np.diff(at, axis=0), axis=1).min() > 0
    assert np.ptp(at[:, 0]) > 0.5 * np.ptp(predictor.scene.world_from_cam[:, 0, 3])
