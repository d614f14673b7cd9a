"""A study that is named with what it was asked for is the same on any machine; workers of a Dask cluster make its cells."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import pytest

import aug3d_core.studies.stability.catalogue  # noqa: F401  (a study brings Open3D with it: tests/processes.py must see it)
from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.collections.made import MadeCollection
from aug3d_core.factory.scheduler import DASK, worker_count
from aug3d_core.run.errors import Aug3dError, UsageError
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import read_each, write_scene
from aug3d_core.store.store import Store
from aug3d_core.studies import named
from aug3d_core.studies.common.trial import directly
from aug3d_core.studies.named import Asked, Prepared
from aug3d_core.studies.stability.cell import StabilityResult
from aug3d_core.studies.tradeoff.scene import open_studied
from tests.photos.photo_files import write_photo

CHEAP = Asked(name="stability", given={"only": ["gps noise: the world"], "seeds": 1, "quick": True})


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (Asked(name="stability", given={"only": ["rain"], "seeds": 1, "quick": True}), "rain"),
        (Asked(name="paper", given={"study": "grouping", "scene": "none", "seeds": 1, "quick": True}), "none"),
        (Asked(name="generalisation", given={"collection": "none", "head": [], "seeds": 1}), "none"),
    ],
)
def test_wrong_words_are_told_before_anything_is_made(asked: Asked, told: str, tmp_path: Path) -> None:
    with pytest.raises(Aug3dError, match=told):
        asked.prepared(Store(tmp_path))


def test_what_is_told_to_another_machine_is_the_same_study(tmp_path: Path) -> None:
    there = Asked.model_validate_json(CHEAP.model_dump_json())
    assert there == CHEAP
    assert there.prepared(Store(tmp_path)).cells == CHEAP.prepared(Store(tmp_path)).cells == 2


def ordered(asked: Asked, store: Store, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return what a study tells the workers of a cluster."""
    orders = []

    def asking(module: str, order: str, address: str, after_s: float) -> AbstractContextManager[None]:
        orders.append(order)
        return nullcontext()

    monkeypatch.setattr(named, "asking", asking)
    monkeypatch.setattr(named, "scheduler_from", lambda _: "tcp://127.0.0.1:8786")
    with asked.over_cluster(store):
        return orders[0]


@pytest.fixture
def here(tmp_path: Path) -> Store:
    """Return a home with a scene in a folder beside it, and a collection."""
    here = Store(tmp_path / "here")
    write_photo(here.root / "photos" / "a.jpg", seed=0)
    (here.root / "scenes" / "hill.yaml").write_text("photos: ../photos\npreset: small\n")
    COLLECTIONS.add(here, "all", CollectionEntry(train=("hill",), towns=2))
    return here


TRADEOFF = Asked(
    name="tradeoff",
    given={"scene": "hill", "seeds": 1, "target_db": None, "search": False, "only": [], "quick": True},
)


@pytest.mark.parametrize("home", ["there", "here"])
def test_a_cluster_s_worker_studies_a_registered_scene_as_it_is_where_it_was_asked_for(
    home: str, here: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker has a home of its own, or one machine serves both."""
    studied = []
    monkeypatch.setattr(named, "study_scene", lambda store, opened, *_: studied.append(opened))
    named._make_cells(Store(tmp_path / home), ordered(TRADEOFF, here, monkeypatch))
    assert studied == [open_studied(here, "hill", None)]
    assert studied[0].photos == here.root / "photos" and studied[0].own.preset == "small"
    here_still = (here.root / "scenes" / "hill.yaml").read_text()
    assert here_still.startswith("photos: ../photos")


def test_a_cluster_s_worker_knows_the_collection_and_its_scenes(
    here: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = []

    def make_data(store: Store, entry: CollectionEntry, scenes: Mapping[str, SceneEntry], *_: object) -> MadeCollection:
        known.append((entry, scenes))
        return MadeCollection()

    monkeypatch.setattr(named, "make_data", make_data)
    monkeypatch.setattr(named, "make_cells", lambda *_: [])
    monkeypatch.setattr(named, "generalisation_findings", lambda *_: None)
    asked = Asked(name="generalisation", given={"collection": "all", "head": [], "seeds": 1})
    named._make_cells(Store(tmp_path / "there"), ordered(asked, here, monkeypatch))
    assert known == [(COLLECTIONS.read(here, "all"), read_each(here))]


def test_a_study_that_reads_no_scene_file_is_made_in_a_home_with_files_of_its_own(
    here: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there, carried = Store(tmp_path / "there"), []
    file = write_scene(there, "own", SceneEntry(photos=None))
    prepared = Prepared[None](2, lambda *_: carried.append("all"))
    monkeypatch.setitem(named._STUDIES, "stability", lambda *_, **given: prepared)
    named._make_cells(there, ordered(CHEAP, here, monkeypatch))
    assert carried == ["all"] and file.exists()
    with pytest.raises(UsageError, match="was written here"):
        named._make_cells(there, ordered(TRADEOFF, here, monkeypatch))


@pytest.mark.slow
def test_workers_of_a_cluster_make_its_cells(
    tmp_path: Path, dask: tuple[str, dict[str, subprocess.Popen]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DASK, dask[0])
    while worker_count(dask[0]) < 2:
        time.sleep(0.2)
    store, done = Store(tmp_path / "here"), list[StabilityResult]()
    prepared, deadline = CHEAP.prepared(store), time.monotonic() + 240
    with CHEAP.over_cluster(store):
        while len([*tmp_path.glob("one/objects/*/*")]) + len([*tmp_path.glob("two/objects/*/*")]) < 2:
            logs = "\n".join((tmp_path / f"{name}.log").read_text()[-2000:] for name in dask[1])
            assert time.monotonic() < deadline, logs
            time.sleep(0.2)
        found = prepared.carry_out(
            directly(store, lambda *_: None), lambda result, *_: done.append(result), "this machine"
        )
    # Which is done first is chance: what another is at comes later
    assert {result.cell.name: result.state for result in done} == {one.cell.name: one.state for one in found.results}
    assert len(done) == 2
    assert not found.silent and not found.crashes
