"""A scene is found by its name: the town, one of the registry, or one that was run, as it was run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import write_scene
from aug3d_core.store.scenes import new_version, version_paths, write_metrics
from aug3d_core.store.store import Store
from aug3d_core.studies.common.trial import Measured, run_trial
from aug3d_core.studies.tradeoff.scene import open_studied
from tests.studies.tradeoff.stand_in import Stages


def ran(
    stages: Stages,
    store: Store,
    name: str,
    preset: str,
    *settings: str,
    photos: Path | None = None,
    until: str = "evaluation",
) -> None:
    trial = run_trial(store, until, Measured(preset), settings, stages.maker(store), photos)
    version = new_version(store, name)
    told: dict[str, Any] = {"scene": name, "preset": preset, "paths": version_paths(store, version, trial.records)}
    write_metrics(version, told | ({"nvs": {}} if until == "evaluation" else {}))


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    folder = tmp_path / "photos"
    folder.mkdir()
    Image.new("RGB", (8, 8)).save(folder / "one.jpg")
    return folder


def test_the_town_needs_no_run(tmp_path: Path) -> None:
    scene = open_studied(Store(tmp_path), "demo", None)
    assert scene.town and scene.own == Measured("tiny")
    assert open_studied(Store(tmp_path), "demo", "auto").own.preset == "tiny", (
        "auto is an arm, not what it is held against"
    )


def test_of_each_setting_the_last_counts_and_is_told(tmp_path: Path) -> None:
    scene = open_studied(Store(tmp_path), "demo", None).with_settings(["town.seed=8", "sfm.seed=1", "town.seed=9"])
    assert scene.own.overrides == ("town.seed=9", "sfm.seed=1")
    assert scene.by_default(["sfm.seed=2", "matching.seed=3"]).config().sfm.seed == 1
    with pytest.raises(UsageError, match="nonsense"):
        scene.with_settings(["nonsense"]).config()


def test_a_run_that_ended_early_does_not_stand_for_the_scene(stages: Stages, photos: Path, tmp_path: Path) -> None:
    store = Store(tmp_path)
    ran(stages, store, "field", "tiny", "training.head.planes=24", photos=photos)
    ran(stages, store, "field", "small", photos=photos, until="sfm")
    assert open_studied(store, "field", None).own == Measured("tiny", ("training.head.planes=24",))


def test_a_scene_that_was_run_is_studied_as_it_was_run(stages: Stages, photos: Path, tmp_path: Path) -> None:
    store = Store(tmp_path)
    ran(stages, store, "field", "small", "training.head.planes=24", photos=photos)
    scene = open_studied(store, "field", None)
    assert scene.photos == photos and scene.own == Measured("small", ("training.head.planes=24",))
    assert open_studied(store, "field", "tiny").own == Measured("tiny")
    decided = scene.decided()
    assert decided.preset == "auto" and decided.config().dataset.width_px == scene.config().dataset.width_px
    assert decided.config().training.head.planes == 24 and "training.head.planes" not in decided.config().auto


def test_a_town_that_was_run_keeps_its_world_whatever_the_preset(stages: Stages, tmp_path: Path) -> None:
    store = Store(tmp_path)
    ran(stages, store, "demo", "auto", "town.seed=8", "training.steps=9")
    scene = open_studied(store, "demo", None)
    assert scene.town and scene.own == Measured("tiny", ("town.seed=8",)) and scene.decided().config().town.seed == 8


def test_photographs_that_are_gone_are_named(stages: Stages, photos: Path, tmp_path: Path) -> None:
    ran(stages, Store(tmp_path), "field", "tiny", photos=photos)
    photos.rename(tmp_path / "elsewhere")
    with pytest.raises(UsageError, match=rf"no longer in {photos}"):
        open_studied(Store(tmp_path), "field", None)


def test_a_scene_of_the_registry_is_studied_as_its_file_says(photos: Path, tmp_path: Path) -> None:
    store = Store(tmp_path)
    write_scene(store, "yard", SceneEntry(photos=photos, preset="small", settings={"depth": {"max_px": 300}}))
    assert open_studied(store, "yard", None).own == Measured("small", ("depth.max_px=300",))
    (tmp_path / "poses.json").write_text("{}")
    write_scene(store, "posed", SceneEntry(photos=photos, poses=tmp_path / "poses.json"))
    with pytest.raises(UsageError, match=r"takes its poses from .*poses\.json"):
        open_studied(store, "posed", None)


def test_a_scene_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no scene 'nowhere'"):
        open_studied(Store(tmp_path), "nowhere", None)
