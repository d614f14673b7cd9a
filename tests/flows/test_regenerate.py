"""A scene of the registry is made again as far as something changed, and published unless it is worse."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import scene_file, write_scene
from aug3d_core.store import layout
from aug3d_core.store.published import published
from aug3d_core.store.store import Store
from tests.flows.stand_in import FEW, Stages, make_of_few

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("prefect")]


@pytest.fixture(autouse=True)
def mlflow_is_ready(fresh_mlflow: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each test a database that is made already: MLflow takes seconds for it."""
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{shutil.copy(fresh_mlflow, tmp_path)}")


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    stand_in = Stages(folds=1)
    monkeypatch.setattr("tasks.build_task.build", stand_in.build)
    make_of_few(monkeypatch)
    return stand_in


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "home"))
    return Store(tmp_path / "home")


def add_scene(store: Store, scene: str) -> SceneEntry:
    folder = store.root.parent / scene
    folder.mkdir()
    (folder / "a.jpg").write_text(scene)
    entry = SceneEntry(photos=folder)
    write_scene(store, scene, entry)
    return entry


def end_of(scene: str, entry: SceneEntry, **changed: object):
    from flows.regenerate import regenerate

    settings = entry.config()
    training = settings.training.model_copy(update=changed)
    return regenerate(scene, settings.model_copy(update={"training": training}), return_state=True)


def versions(store: Store, scene: str) -> int:
    return len(list((store.root / layout.SCENES / scene).glob(f"*/{layout.METRICS}")))


def test_only_what_changed_is_made_and_only_what_is_no_worse_is_published(stages: Stages, store: Store) -> None:
    entry = add_scene(store, "little")
    first = end_of("little", entry)
    assert (first.name, first.is_completed()) == ("Published", True)
    assert set(stages.computed) == {stage.name for stage in FEW}
    good = published(store, "little")
    stages.computed.clear()

    unchanged = end_of("little", entry)
    assert (unchanged.name, unchanged.is_completed(), stages.computed) == ("Unchanged", True, [])
    assert versions(store, "little") == 1, "not even a version is made"

    stages.psnr_db = 19.0
    worse = end_of("little", entry, steps=7)
    assert (worse.name, worse.is_failed()) == ("NotPublished", True), worse.message
    assert "PSNR fell by 1.00 dB, from 20.00 to 19.00 dB; at most 0.5 dB may be lost" in (worse.message or "")
    assert stages.computed == ["training", "evaluation"]
    assert published(store, "little") == good and versions(store, "little") == 2

    stages.computed.clear()
    assert end_of("little", entry, steps=7).name == "NotPublished" and stages.computed == []
    assert versions(store, "little") == 2, "it is judged again, not made again"

    stages.psnr_db = 19.6
    tried = end_of("little", entry, steps=8)
    assert tried.name == "Tried" and "reaches 19.60 dB" in (tried.message or "")
    assert published(store, "little") == good, "a trial in the form changes nothing for others"

    scene_file(store, "little").write_text(f"photos: {entry.photos}\nsettings: {{training: {{steps: 8}}}}\n")
    stages.computed.clear()
    now_meant = end_of("little", entry, steps=8)
    assert now_meant.name == "Published" and stages.computed == []
    now = published(store, "little")
    assert now is not None and now != good
    told = json.loads((now / layout.METRICS).read_bytes())["stages"]
    assert told["training"]["why"][0].startswith("steps ") and told["photos"]["why"] == []
    assert good is not None and good.name in (now / layout.REPORT).read_text(), "the report compares with it"


def runs_of(scene: str) -> list[Any]:
    from prefect.client.orchestration import get_client

    with get_client(sync_client=True) as client:
        return [run for run in client.read_flow_runs(limit=200) if run.parameters.get("scene") == scene]


def test_a_scene_that_fails_does_not_stop_the_others(stages: Stages, store: Store) -> None:
    from flows.regenerate import batch

    torn, gone, good = (add_scene(store, scene) for scene in ("a_torn", "b_gone", "c_good"))
    scene_file(store, "a_torn").write_text("photos: [")
    assert gone.photos and torn.photos and good.photos
    (gone.photos / "a.jpg").unlink()
    gone.photos.rmdir()
    end = batch(return_state=True)
    assert end.is_failed() and "2 of 3 scenes were not published: a_torn, b_gone" in (end.message or "")
    assert published(store, "c_good") and not published(store, "b_gone")
    again = batch(["c_good"], return_state=True)
    assert again.is_completed() and "1 scenes are up to date" in (again.message or "")
    made = runs_of("c_good")
    assert made and all(run.tags == ["aug3d"] for run in made), "the worker knows parts of a run as ours"
    assert "'nowhere' is not registered" in (batch(["nowhere"], return_state=True).message or "")
