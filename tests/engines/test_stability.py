"""A few cells of the study of stability, for real: what broke when they were published breaks, and is noticed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.reader import read
from aug3d_core.dataset.scene import SPLITS
from aug3d_core.dataset.writer import write
from aug3d_core.store.store import Store
from aug3d_core.studies.common.cell import Cell
from aug3d_core.studies.common.trial import directly
from aug3d_core.studies.stability.catalogue import PERTURBATIONS
from aug3d_core.studies.stability.cell import Dosed, make_cell
from aug3d_core.studies.stability.damages import packed
from tests.toy_scene import toy_scene


@pytest.mark.parametrize(
    ("name", "method", "dose", "broken", "state"),
    [
        ("gps noise: the world", "as it is", 1.5, False, "ok"),
        ("gps noise: the world", "as it is", 50, True, "degraded"),
        ("slope", "chosen", 30, False, "ok"),
        ("abrupt turns", "sequence", 2.5, True, "degraded"),
        ("abrupt turns", "shared", 2.5, False, "ok"),
    ],
)
def test_cells_end_as_they_are_known_to(
    name: str, method: str, dose: float, broken: bool, state: str, tmp_path: Path
) -> None:
    perturbation = next(p for p in PERTURBATIONS if p.name == name)
    store = Store(tmp_path)
    result = make_cell(store, Cell(Dosed(perturbation, dose, method), 0), directly(store, lambda *_: None))
    assert (result.broken, result.state, result.silent) == (broken, state, False), result.notes
    assert result.records["computed"].pictures


def test_only_training_gets_darker(tmp_path: Path) -> None:
    scene = toy_scene(0, 12, 8)
    write(scene, tmp_path / SCENE_ZARR, 8)
    packed.darker_training(tmp_path, 4.0, np.random.default_rng(0))
    found, trained = read(tmp_path / SCENE_ZARR), scene.splits == SPLITS.index("train")
    assert trained.any() and not trained.all()
    np.testing.assert_array_equal(found.images[~trained], scene.images[~trained])
    np.testing.assert_allclose(found.images[trained], scene.images[trained] / 4, atol=0.5)
    np.testing.assert_array_equal(found.near_far, scene.near_far)
