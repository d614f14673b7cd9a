"""What `aug3d bench generalisation` says of scores, and from which weights it trains."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from aug3d_core.bench.generalisation import _by_towns, _scores, _started
from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.made import make_data
from aug3d_core.factory.config import scene_config
from aug3d_core.judging.summary import CHEAP
from aug3d_core.scene_files import SceneEntry
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured
from tests.collections.stand_in import Stages
from tests.stand_in_stages import write_test


def test_a_model_from_the_inputs_alone_is_held_against_their_answers() -> None:
    cheap = {f"{name}_psnr": 20.0 for name in CHEAP}
    rows = [{"group": n, "psnr": 26.0, "inputs_alone_psnr": 22.5, "inputs_alone_ssim": 0.7, **cheap} for n in range(4)]
    found = _scores(pd.DataFrame(rows), "coast", {"ground_homography": 3.0, "plane_sweep": 2.0})
    assert found["coast_inputs_alone_psnr"].value == 22.5 and found["coast_scaffold_psnr"].value == 26.0
    assert found["coast_over_ground_homography"].holds is False and found["coast_over_plane_sweep"].holds is True
    assert found["coast_over_plane_sweep_low"].holds is True


def test_short_trainings_make_all_their_steps() -> None:
    few = _started(scene_config("tiny").training, "random", 20)
    assert (few.steps, few.warmup_steps, few.least_gain_db, few.head.model_dump()["start"]) == (20, 2, 0.0, "random")


def test_more_towns_are_trained_on_from_the_same_start(tmp_path: Path) -> None:
    class Better(Stages):
        def figures(self, stage, made, files):
            if stage.name == "evaluation":
                towns = len(self.given["training"])
                write_test(files, {1: 20.0 + towns / 10, 2: 21.0 + towns / 10}, others=19.0)
            return super().figures(stage, made, files)

    store, stages = Store(tmp_path), Better()
    make = stages.maker(store)
    made = make_data(store, CollectionEntry(train=("coast",)), {"coast": SceneEntry(photos=None)}, lambda of: make)
    found = _by_towns(store, Measured("tiny"), {"coast": [*made.members["coast"].data.values()]}, make)
    assert stages.computed.count("exact_town") == 30 and stages.computed.count("training") == 4
    assert found["coast_1_towns_scaffold"].value == pytest.approx(20.6)
    assert found["coast_30_towns_over_one"].value == pytest.approx(2.9) and found["coast_30_towns_over_one"].holds
