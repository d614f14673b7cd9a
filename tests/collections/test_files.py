"""The files of collections: what is written is read, and every mistake is named with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.run.errors import InputError, UsageError
from aug3d_core.scene_files import Publishing, Schedule
from aug3d_core.store import layout
from aug3d_core.store.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path)


def test_what_is_written_is_read(store: Store) -> None:
    entry = CollectionEntry(
        train=("a", "b"), hold_out=("c",), towns=30, towns_seed=2, preset="small",
        settings={"training": {"steps": 500}}, description="All: of them", schedule=Schedule(cron="0 3 * * 1"),
        publish=Publishing(most_psnr_drop_db=0.2),
    )  # fmt: skip
    file = COLLECTIONS.add(store, "all", entry)
    assert COLLECTIONS.read(store, "all") == entry
    assert "aug3d collections show all" in file.read_text()
    assert entry.config().training.steps == 500


def test_there_is_none_at_first_and_none_twice(store: Store) -> None:
    assert COLLECTIONS.read_each(store) == {}
    COLLECTIONS.add(store, "all", CollectionEntry(towns=1))
    with pytest.raises(UsageError, match="there is a collection 'all' already"):
        COLLECTIONS.add(store, "All", CollectionEntry(towns=2))
    with pytest.raises(UsageError, match="did you mean all"):
        COLLECTIONS.read(store, "al")
    COLLECTIONS.remove(store, "all")
    assert COLLECTIONS.read_each(store) == {}


@pytest.mark.parametrize("name", ["../out", "", "a/b", "-x"])
def test_a_name_cannot_leave_the_folder(store: Store, name: str) -> None:
    with pytest.raises(UsageError, match="is not a scene name"):
        COLLECTIONS.add(store, name, CollectionEntry(towns=1))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("towns: 3\ntrian: [a]\n", r"all.yaml:2: trian: there is no such field, did you mean train"),
        ("towns: 3\ntrain: [a, a]\n", r"all.yaml:2: train: names a twice"),
        ("train: [a]\nhold_out: [a]\n", "scene a is to be trained on and held out"),
        ("hold_out: [a]\n", "there is nothing to train on"),
        ("towns: -1\n", r"all.yaml:1: towns = -1"),
        ("towns: 3\npreset: auto\n", r"all.yaml:2: preset = 'auto': is not a size"),
        ("towns: 3\nsettings:\n  sfm: {seed: 1}\n", r"sets sfm, which is each scene's own"),
        ("towns: 3\nsettings:\n  training: {steps: -1}\n", r"all.yaml:3: settings.training.steps = -1"),
        ("towns: 3\ntrain: ['../a']\n", "is not a scene name"),
        ("towns: [\n", r"all.yaml:\d"),
    ],
)
def test_a_mistake_is_named_with_its_line(store: Store, text: str, told: str) -> None:
    folder = store.root / layout.COLLECTIONS
    folder.mkdir()
    (folder / "all.yaml").write_text(text)
    (folder / "good.yaml").write_text("towns: 1\n")
    with pytest.raises(InputError, match=told):
        COLLECTIONS.read(store, "all")
    each = COLLECTIONS.read_each(store)
    assert isinstance(each["all"], InputError) and each["good"] == CollectionEntry(towns=1)
