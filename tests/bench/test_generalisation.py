"""What `aug3d bench generalisation` says of scores, and from which weights it trains."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from aug3d_core.bench import generalisation
from aug3d_core.bench.figure import Figure
from aug3d_core.bench.generalisation import FLIGHT_MINUTES, _by_towns, _flight, _lasting, _shipped, _worst
from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.made import make_data
from aug3d_core.dataset.files import SCENE_ZARR
from aug3d_core.dataset.writer import write
from aug3d_core.factory.config import scene_config
from aug3d_core.judging.files import TEST_VIEWS
from aug3d_core.scene_files import SceneEntry
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured
from tests.collections.stand_in import Stages
from tests.stand_in_stages import Made, write_test
from tests.toy_scene import toy_scene


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


@pytest.mark.parametrize("stage", ["training", "evaluation"])
def test_towns_of_which_a_step_fails_are_told_beside_the_others(stage: str, tmp_path: Path) -> None:
    class Scored(Stages):
        def figures(self, stage, made, files):
            if stage.name == "evaluation":
                write_test(files, {1: 20.0, 2: 21.0}, others=19.0)
            return super().figures(stage, made, files)

    store, stages = Store(tmp_path), Scored()
    stages.fails = lambda at, made: "memory: killed" if at == stage and len(stages.given["training"]) == 30 else ""
    make = stages.maker(store)
    made = make_data(store, CollectionEntry(train=("coast",)), {"coast": SceneEntry(photos=None)}, lambda of: make)
    found = _by_towns(store, Measured("tiny"), {"coast": [*made.members["coast"].data.values()]}, make)
    assert found["coast_10_towns_scaffold"].value == 20.5
    assert "memory: killed" in found["coast_30_towns_free"].failure
    assert (found["coast_30_towns_over_one"].value, found["coast_30_towns_over_one"].holds) == (None, False)


class Whole(Stages):
    """Towns with views, trainings that take their steps, and tests of which the best steps are the shipped model's."""

    most = 0  # scenes of a training

    def figures(self, stage, made, files):
        found = super().figures(stage, made, files)
        if stage.name == "exact_town":
            write(toy_scene(0, 32, 24), files / SCENE_ZARR, shard_views=64)
        if stage.name == "training":
            self.most = max(self.most, len(self.given["training"]))
            return found | {"loader_wait_share": 0.01}
        if stage.name == "preview":
            return found | {"over_homography_db": 2.5}
        if stage.name == "evaluation":
            psnr = 24.0 if made.get("training", {}).get("head", {}).get("start") != "random" else 23.0
            views = write_test(files, {1: psnr + 2, 2: psnr + 3}, others=20.0)
            views.assign(inputs_alone_psnr=[psnr, psnr + 1], inputs_alone_ssim=0.7).to_parquet(files / TEST_VIEWS)
        return found

    def cpu_seconds(self, stage, made):
        return made["training"]["steps"] / 2 if stage.name == "training" else 2.0


def test_every_figure_of_the_contract_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = Whole()
    monkeypatch.setattr(generalisation, "directly", lambda store, say: stages.maker(store))
    monkeypatch.setattr(
        generalisation, "scene_config", lambda preset: scene_config("tiny")
    )  # auto looks at photographs
    photos = tmp_path / "coast"
    photos.mkdir()
    for number in range(generalisation.FLIGHT_PHOTOS + 1):
        Image.new("RGB", (32, 24), (number, 0, 0)).save(photos / f"{number:02d}.jpg")
    store = Store(tmp_path / "store")
    found = generalisation.figures(store, Measured("tiny"), lambda *said: None, {"coast": photos}, towns=False)
    assert not [f"{key}: {figure.failure}" for key, figure in found.items() if figure.failure]
    assert found["coast_zero_shot_free_psnr"].value == 24.5
    assert found["zero_shot_over_homography_db"].value == found["coast_zero_shot_free_over_homography_db"].value == 4.5
    assert (found["coast_tuned_minutes"].value, found["coast_scratch_minutes"].value) == (2.0, 10.0)
    assert found["tuned_over_scratch_db"].value == 1.0 and found["coast_tuned_over_scratch_low"].value is not None
    assert found["tuned_time_share"].value == 0.2
    assert found["coast_flight_minutes"].holds and found["coast_flight_over_homography"].value == 2.5
    assert found["loader_peak_mib"].holds and found["loader_wait_share"].holds
    assert stages.most == generalisation.SCENES
    assert not (store.root / "flight").exists() and not (store.root / "reading").exists()


@pytest.mark.parametrize(("steps", "fails"), [(None, "zero_shot"), (240, "tuned"), (1200, "scratch")])
def test_an_evaluation_that_fails_is_told_beside_the_other_figures(
    steps: int | None, fails: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(stage: str, made: Made) -> str:
        judged = made.get("training", {}).get("steps")  # the shipped model is no object
        return "memory: killed" if stage == "evaluation" and judged == steps else ""

    stages = Whole()
    stages.fails = fail
    monkeypatch.setattr(generalisation, "reading", lambda *_: {})
    monkeypatch.setattr(generalisation, "directly", lambda store, say: stages.maker(store))
    monkeypatch.setattr(generalisation, "scene_config", lambda preset: scene_config("tiny"))
    photos = tmp_path / "coast"
    photos.mkdir()
    Image.new("RGB", (32, 24)).save(photos / "a.jpg")
    found = generalisation.figures(
        Store(tmp_path / "store"), Measured("tiny"), lambda *said: None, {"coast": photos}, towns=False
    )
    [(name, figure)] = [(name, figure) for name, figure in found.items() if figure.failure]
    assert name == f"coast_{fails}" and figure.value is None and "memory: killed" in figure.failure
    assert found["coast_flight_minutes"].holds
    assert ("coast_zero_shot_free_psnr" in found) == (fails != "zero_shot")


def test_a_flight_whose_preview_fails_reaches_no_goal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stages = Whole()
    stages.fails = lambda stage, made: "memory: killed" if stage == "preview" else ""
    monkeypatch.setattr(generalisation, "directly", lambda store, say: stages.maker(store))
    monkeypatch.setattr(generalisation, "scene_config", lambda preset: scene_config("tiny"))
    photos = tmp_path / "coast"
    photos.mkdir()
    Image.new("RGB", (32, 24)).save(photos / "a.jpg")
    store = Store(tmp_path / "store")
    found = _flight(store, photos, "coast", _shipped(), stages.maker(store))
    [(name, figure)] = found.items()
    assert name == "coast_flight_minutes" and "memory: killed" in figure.failure
    assert (figure.value, figure.goal, figure.holds) == (None, FLIGHT_MINUTES, False)
