"""What a prediction says of itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aug3d_core.dataset.scene import SPLITS
from aug3d_core.novel.config import PredictionConfig
from aug3d_core.novel.stage import _like_notes
from aug3d_core.novel.views import novel_view
from tests.toy_scene import toy_scene

LIKE = PredictionConfig(like=8)


@pytest.mark.parametrize(
    ("split", "with_mesh", "said"),
    [
        ("train", True, "trained with photo 8"),
        ("gap", True, "the mesh that the model starts from was made with photo 8"),
        ("support", True, "the mesh"),
        ("support", False, ""),
        ("target", True, ""),
    ],
)
def test_a_photograph_that_anything_was_made_with_is_no_test(split: str, with_mesh: bool, said: str) -> None:
    scene = toy_scene(0, 24, 16)
    splits = scene.splits.copy()
    splits[8] = SPLITS.index(split)
    scene = replace(scene, splits=splits, scaffold=np.full_like(scene.scaffold, 40.0 if with_mesh else 0.0))
    notes = _like_notes(novel_view(scene, LIKE), LIKE)
    assert (said in notes[0] and "no test of it" in notes[0]) if said else notes == ()
