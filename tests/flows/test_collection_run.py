"""A collection is trained where something changed, and its newest version is published unless it is worse."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.run.errors import StoreError
from aug3d_core.scene_files import SceneEntry, write_scene
from aug3d_core.scene_files.entry import Publishing
from aug3d_core.store import layout
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.published import published
from aug3d_core.store.scenes import versions
from aug3d_core.store.store import Store
from tests.collections.stand_in import Stages

pytestmark = pytest.mark.slow

ENTRY = CollectionEntry(train=("north",), hold_out=("far",), towns=1)
MORE = ENTRY.model_copy(update={"towns": 2})


class Mlflow:
    """What MLflow was told: the version, and whether it is the published one. away: it cannot be reached."""

    def __init__(self) -> None:
        self.told: list[tuple[str, bool]] = []
        self.away = False

    def log(self, store: Store, version: Path, training: object, published: bool) -> str:
        assert (version / layout.REPORT).is_file()
        self.told += [] if self.away else [(version.name, published)]
        return "MLflow is away" if self.away else ""


@pytest.fixture
def mlflow(monkeypatch: pytest.MonkeyPatch) -> Mlflow:
    mlflow = Mlflow()
    monkeypatch.setattr("flows.collection_run.log_collection", mlflow.log)
    return mlflow


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    stages = Stages()
    monkeypatch.setattr("flows.collection_run.through_prefect", lambda store, of: stages.maker(store))
    return stages


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return machine(tmp_path / "home")


def machine(home: Path) -> Path:
    for seed, scene in enumerate(("north", "far")):
        write_scene(Store(home), scene, SceneEntry(photos=None, settings={"town": {"seed": seed}}))
    return home


def train(home: Path, entry: CollectionEntry = ENTRY) -> tuple[str, str]:
    from flows.collection_run import _train  # Prefect reads its settings when it is imported

    state = _train(Store(home), "all", entry)
    return state.name or "", state.message or ""


def names(home: Path) -> list[str]:
    return [version.name for version in versions(Store(home), "all", layout.COLLECTIONS)]


def test_where_nothing_changed_no_version_is_made_published_or_not(home: Path, stages: Stages, mlflow: Mlflow) -> None:
    assert train(home)[0] == "Published" and train(home)[0] == "Unchanged"
    stages.psnr_db = 20.0
    first = train(home, MORE)
    assert first[0] == "NotPublished" and "PSNR fell by 2.00 dB" in first[1]
    good, worse = names(home)
    stages.computed.clear()
    assert train(home, MORE) == first and (names(home), stages.computed) == ([good, worse], [])
    assert mlflow.told == [(good, True), (worse, False)], "each once"

    allowed = MORE.model_copy(update={"publish": Publishing(most_psnr_drop_db=3.0)})
    assert train(home, allowed)[0] == "Published" and names(home) == [good, worse]
    now = published(Store(home), "all", layout.COLLECTIONS)
    assert now and now.name == worse and mlflow.told[2:] == [(worse, True)]
    assert train(home, allowed)[0] == "Unchanged" and len(mlflow.told) == 3


def test_what_mlflow_was_not_told_the_next_training_tells(home: Path, stages: Stages, mlflow: Mlflow) -> None:
    mlflow.away = True
    assert all("MLflow is away: the next training logs it" in train(home)[1] for _ in range(2))
    stages.psnr_db = 20.0
    assert "MLflow is away" in train(home, MORE)[1]
    mlflow.away = False
    assert train(home, MORE)[0] == "NotPublished" and mlflow.told == [(names(home)[1], False)]


def test_a_version_that_other_machines_were_not_told_of_is_told_before_it_is_published(
    home: Path, stages: Stages, mlflow: Mlflow, shared: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away(*_: object) -> None:
        raise StoreError("the shared store is away", "wait")

    with monkeypatch.context() as patched, pytest.raises(StoreError):
        patched.setattr("flows.collection_run.share_version", away)
        train(home)
    assert train(home)[0] == "Published"
    (name,) = names(home)
    assert Bucket(shared).has(f"collections/all/{name}/{layout.METRICS}")

    other = machine(home.with_name("other"))
    assert train(other)[0] == "Unchanged" and names(other) == [name]
    Bucket(shared).delete([f"collections/all/{layout.PUBLISHED}"])
    (other / layout.COLLECTIONS / "all" / layout.PUBLISHED).unlink()
    assert train(other)[0] == "Published" and names(other) == [name]
    assert mlflow.told == [(name, True)] * 2, "each machine has an MLflow of its own, which gets the report too"
