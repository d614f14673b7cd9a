"""What `aug3d bench generalisation` says of scores, and from which weights it trains."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.bench.figure import Figure
from aug3d_core.bench.generalisation import _by_towns, _lasting, _worst
from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.made import make_data
from aug3d_core.factory.config import scene_config
from aug3d_core.scene_files import SceneEntry
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured
from tests.collections.stand_in import Stages
from tests.stand_in_stages import write_test


def test_the_worst_place_is_told_first() -> None:
    found = {
        f"{place}_{key}": Figure(value, "dB")
        for place, lead in (("coast", 0.5), ("dense", 3.0))
        for key, value in (("zero_shot_free_over_homography_db", lead), ("tuned_over_scratch_db", -lead))
    } | {"coast_tuned_time_share": Figure(0.2, "1"), "dense_tuned_time_share": Figure(0.3, "1")}
    worst = {key: figure.value for key, figure in _worst(found).items()}
    assert worst == {"zero_shot_over_homography_db": 0.5, "tuned_over_scratch_db": -3.0, "tuned_time_share": 0.3}
    assert _worst({"coast": Figure(None, "dB", None, None, "no poses")}) == {}


def test_short_trainings_make_all_their_steps() -> None:
    few = _lasting(scene_config("tiny").training, 20)
    assert (few.steps, few.warmup_steps, few.least_gain_db) == (20, 2, 0.0)


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
