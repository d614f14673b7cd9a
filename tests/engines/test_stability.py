"""A few cells of the study of stability, for real: what broke when they were published breaks, and is noticed."""

from __future__ import annotations

from dataclasses import replace
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


@pytest.mark.parametrize("name", ["brighter_inputs", "shifted_inputs"])
def test_only_what_the_test_predicts_from_lies(name: str, tmp_path: Path) -> None:
    scene = toy_scene(0, 12, 8)
    write(scene, tmp_path / SCENE_ZARR, 8)
    getattr(packed, name)(tmp_path, 1.5, np.random.default_rng(0))
    found, given = read(tmp_path / SCENE_ZARR), scene.splits == SPLITS.index("support")
    field = {"brighter_inputs": "images", "shifted_inputs": "world_from_cam"}[name]
    np.testing.assert_array_equal(getattr(found, field)[~given], getattr(scene, field)[~given])
    off = found.world_from_cam[given, :3, 3] - scene.world_from_cam[given, :3, 3]
    apart = 1.5 * scene.scale if name == "shifted_inputs" else 0
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), apart, rtol=1e-5)
    brighter = np.minimum(np.rint(scene.images[given] * 1.5), 255) if not apart else scene.images[given]
    np.testing.assert_array_equal(found.images[given], brighter)


@pytest.mark.parametrize("dose", [0.0, 0.3, 1.0])
def test_a_torn_scaffold_lacks_its_share_and_a_raised_one_is_nearer(dose: float, tmp_path: Path) -> None:
    scene = toy_scene(0, 12, 8)
    scene = replace(scene, scaffold=np.full_like(scene.scaffold, scene.scale))
    names = ("torn_scaffold", "raised_scaffold", "raised_slab")
    for name in names:
        (tmp_path / name).mkdir()
        write(scene, tmp_path / name / SCENE_ZARR, 8)
        getattr(packed, name)(tmp_path / name, dose, np.random.default_rng(0))
    torn, raised, slab = (read(tmp_path / name / SCENE_ZARR) for name in names)
    np.testing.assert_allclose((torn.scaffold == 0).mean(axis=(1, 2)), dose, atol=0.01)
    thickness = scene.slab.high - scene.slab.low
    np.testing.assert_allclose(raised.scaffold, scene.scale - dose * thickness, rtol=2e-3)
    assert slab.slab.low == pytest.approx(scene.slab.low + dose * thickness) and slab.slab.a == scene.slab.a


def test_only_training_gets_darker(tmp_path: Path) -> None:
    scene = toy_scene(0, 12, 8)
    write(scene, tmp_path / SCENE_ZARR, 8)
    packed.darker_training(tmp_path, 4.0, np.random.default_rng(0))
    found, trained = read(tmp_path / SCENE_ZARR), scene.splits == SPLITS.index("train")
    assert trained.any() and not trained.all()
    np.testing.assert_array_equal(found.images[~trained], scene.images[~trained])
    np.testing.assert_allclose(found.images[trained], scene.images[trained] / 4, atol=0.5)
    np.testing.assert_array_equal(found.near_far, scene.near_far)
