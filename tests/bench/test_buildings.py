from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aug3d_core.bench.buildings import LANDS, SAM_LANDS, land_figures
from aug3d_core.domes.boxes import Buildings
from aug3d_core.domes.files import BUILDINGS
from aug3d_core.factory.config import scene_config
from aug3d_core.geometry.transforms import look_at
from aug3d_core.geometry.views import Views
from aug3d_core.sfm.files import COMPONENTS, VIEWS
from aug3d_core.store import layout
from aug3d_core.store.record import Record
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Trial
from aug3d_core.town.files import TOWN_TRUTH, TRUTH_FOOTPRINTS, TRUTH_POSES

FLAT = LANDS[0]


class FolderStore(Store):
    """A store whose records are folders."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def files_dir(self, record: Record) -> Path:
        return self.root / record.stage


def store_with(root: Path, boxes: np.ndarray) -> tuple[Any, Any]:
    """A flat town of two houses, of which these boxes were found."""
    folders = {name: root / name for name in ("town", "sfm", "sampling")}
    for folder in (*folders.values(), root / "town" / TOWN_TRUTH):
        folder.mkdir(exist_ok=True)
    places = np.array([[0.0, 0.0, 50.0], [30.0, 0.0, 52.0], [0.0, 30.0, 51.0], [20.0, 25.0, 55.0]])
    poses = np.stack([look_at(place, place * [1, 1, 0] + [0, 1, 0]) for place in places])
    views = Views(np.arange(4), poses, np.tile([500.0, 500, 320, 240], (4, 1)), np.tile([640, 480], (4, 1)))
    views.save(folders["sfm"] / VIEWS)
    views.save(folders["town"] / TRUTH_POSES)
    (folders["sfm"] / COMPONENTS).write_text(json.dumps({"photo_sha256": ["of one"] * 4}))
    houses = [[[0, 0], [10, 0], [10, 10], [0, 10]], [[20, 0], [30, 0], [30, 10], [20, 10]]]
    text = json.dumps({"footprints": [{"outline_m": house} for house in houses]})
    (folders["town"] / TRUTH_FOOTPRINTS).write_text(text)
    covered = np.ones((100, 100), bool)
    rgb = np.zeros((100, 100, 3), np.uint8)
    Buildings(~covered, boxes, covered, rgb, np.array([-10.0, -20.0]), 0.5).save(folders["sampling"] / BUILDINGS)
    records = {name: Record.model_construct(stage=name, seconds=1.5) for name in folders}
    return FolderStore(root), Trial(records)


def test_half_of_two_houses_found_is_two_thirds(tmp_path: Path) -> None:
    store, trial = store_with(tmp_path, np.array([[0.5, 0, 10, 10]]))
    figures = land_figures(store, trial, FLAT)
    assert figures["building_precision_flat"].value == 1 and figures["building_recall_flat"].value == 0.5
    assert figures["building_f1_flat"].value == pytest.approx(2 / 3) and figures["building_f1_flat"].holds is False
    assert figures["building_sampling_seconds_flat"].value == 1.5
    assert (tmp_path / layout.BENCH_PICTURES / "buildings_flat.png").stat().st_size > 1000


def test_a_trial_that_ended_early_says_why(tmp_path: Path) -> None:
    figure = land_figures(FolderStore(tmp_path), Trial({}, "no photographs"), FLAT)["building_f1_flat"]
    assert figure.value is None and figure.holds is False and figure.failure == "no photographs"


def test_no_ground_is_a_failure_too(tmp_path: Path) -> None:
    store, trial = store_with(tmp_path, np.zeros((0, 4)))
    (tmp_path / "sampling" / BUILDINGS).unlink()
    assert "no ground" in land_figures(store, trial, FLAT)["building_f1_flat"].failure


def test_what_has_no_goal_neither_holds_nor_fails(tmp_path: Path) -> None:
    store, trial = store_with(tmp_path, np.array([[0.5, 0, 10, 10]]))
    figure = land_figures(store, trial, SAM_LANDS[0])["building_f1_sam_flat"]
    assert figure.value == pytest.approx(2 / 3) and figure.goal is None and figure.holds is None
    assert land_figures(store, Trial({}, "lost"), SAM_LANDS[0])["building_f1_sam_flat"].holds is None


@pytest.mark.parametrize("land", (*LANDS, *SAM_LANDS), ids=lambda land: land.name)
def test_the_settings_exist(land) -> None:
    scene_config("tiny", land.overrides)
