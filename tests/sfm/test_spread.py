"""The spread of reconstructions is what is left after the similarity between them."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres, look_at
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.spread import spread_pct


def views(photo_id: np.ndarray, at: np.ndarray) -> Views:
    poses = np.stack([look_at(each, each * [1, 1, 0] + [0.1, 0, 0]) for each in at])
    return Views(photo_id, poses, np.tile([500.0, 500, 320, 240], (len(at), 1)), np.tile([640, 480], (len(at), 1)))


def flight(count: int = 40) -> np.ndarray:
    return np.random.default_rng(0).uniform([-80, -50, 45], [80, 50, 55], size=(count, 3))


def test_a_similarity_is_no_spread() -> None:
    run = views(np.arange(40), flight())
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved = Similarity(3.0, turn, np.array([5.0, 6, 7])).move_cameras(run.cam_from_world)
    assert spread_pct([run, Views(run.photo_id, moved, run.intrinsics, run.size)]) == pytest.approx(0, abs=1e-9)


def test_noise_is_spread_and_photographs_that_one_run_lacks_do_not_count() -> None:
    at = flight()
    noise = np.random.default_rng(1).normal(size=at.shape) * 0.5
    runs = [views(np.arange(40), at), views(np.arange(5, 40), (at + noise)[5:])]
    extent = np.linalg.norm(np.ptp(centres(runs[0].cam_from_world)[5:], axis=0))
    assert spread_pct(runs) == pytest.approx(100 * 0.5 * 1.54 / extent, rel=0.25)  # 1.54: median length of a 3-d normal
