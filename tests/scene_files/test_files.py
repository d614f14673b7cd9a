"""Scenes are found by the names of their files; two of one name are refused; nothing is overwritten."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from socket import gethostname

import pytest

from aug3d_core.factory.material import Material
from aug3d_core.run.errors import Aug3dError, InputError, UsageError
from aug3d_core.scene_files import (
    SceneEntry,
    Schedule,
    read_each,
    read_scene,
    remove_scene,
    write_scene,
    write_schedule,
)
from aug3d_core.store.store import Store

TOWN = SceneEntry(photos=None)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "home")


@pytest.fixture
def folder(store: Store) -> Path:
    return store.root / "scenes"


def test_a_scene_is_written_once_read_and_removed(store: Store, folder: Path) -> None:
    file = write_scene(store, "hill", TOWN)
    assert file == folder / "hill.yaml" and read_each(store) == {"hill": TOWN}
    before = file.read_bytes()
    for name in ("hill", "Hill"):
        with pytest.raises(UsageError, match="'hill' already"):
            write_scene(store, name, TOWN)
    assert file.read_bytes() == before
    (folder / "hill" / "2026-11-21").mkdir(parents=True)
    assert remove_scene(store, "hill") == file and read_each(store) == {}
    assert (folder / "hill" / "2026-11-21").exists()


def test_of_many_who_add_one_scene_one_does(store: Store) -> None:
    def add(licence: str) -> bool:
        try:
            write_scene(store, "hill", SceneEntry(photos=None, licence=licence))
        except UsageError:
            return False
        return True

    names = [f"of {i}" for i in range(8)]
    with ThreadPoolExecutor(len(names)) as pool:
        added = [name for name, done in zip(names, pool.map(add, names), strict=True) if done]
    assert added == [read_scene(store, "hill").licence]


@pytest.mark.parametrize("name", ["../escape", "a/b", "", ".hidden"])
def test_a_name_that_could_leave_its_folder(name: str, store: Store) -> None:
    for act in (
        lambda: write_scene(store, name, TOWN),
        lambda: read_scene(store, name),
        lambda: remove_scene(store, name),
    ):
        with pytest.raises(UsageError, match="is not a scene name"):
            act()


def test_a_scene_that_is_not_there(store: Store) -> None:
    with pytest.raises(UsageError, match="known: none yet; see aug3d scenes add"):
        read_scene(store, "hill")
    write_scene(store, "brighton", TOWN)
    with pytest.raises(UsageError, match="did you mean brighton"):
        read_scene(store, "brigton")
    with pytest.raises(UsageError, match="known: brighton"):
        read_scene(store, "hill")


@pytest.mark.parametrize("second", ["hill.yml", "Hill.yaml", "HILL.yml"])
def test_two_files_of_one_name_are_refused_with_both_named(second: str, store: Store, folder: Path) -> None:
    write_scene(store, "hill", TOWN)
    (folder / second).write_text("photos: null")
    write_scene(store, "town", TOWN)
    with pytest.raises(InputError) as told:
        read_scene(store, "hill")
    assert str(folder / "hill.yaml") in told.value.problem and str(folder / second) in told.value.problem
    with pytest.raises(InputError, match="name one scene"):
        remove_scene(store, "hill")
    assert read_each(store)["town"] == TOWN
    assert sum(isinstance(entry, Aug3dError) for entry in read_each(store).values()) == 1


def test_one_bad_file_does_not_hide_the_others_and_all_are_told(store: Store, folder: Path) -> None:
    write_scene(store, "town", TOWN)
    (folder / "one.yaml").write_text("photos: null\npreset: huge")
    (folder / "two words.yaml").write_text("photos: null")
    (folder / "three.yml").mkdir()
    (folder / ".hidden.yaml").write_text("x")
    (folder / "notes.txt").write_text("x")
    found = read_each(store)
    assert found.keys() == {"town", "one", "two words", "three"} and found["town"] == TOWN
    said = {
        "one": "one.yaml:2: preset",
        "two words": "two words.yaml: 'two words' is not a scene name",
        "three": "three.yml cannot be read",
    }
    for scene, words in said.items():
        assert words in str(found[scene])


def test_a_schedule_is_changed_in_its_file_and_comments_stay(store: Store, folder: Path) -> None:
    file = folder / "hill.yml"
    file.write_bytes("# Ann's hill\nphotos: null # ours\r\ntags: [a]  # é".encode())
    assert write_schedule(store, "hill", Schedule(every="6h")).schedule == Schedule(every="6h")
    assert read_scene(store, "hill").schedule == Schedule(every="6h")
    assert file.read_bytes().decode().startswith("# Ann's hill\nphotos: null # ours\r\ntags: [a]  # é\nschedule:")
    assert write_schedule(store, "hill", None).schedule is None


@pytest.mark.parametrize("text", ["{photos: null}", "? schedule\n: null\n? photos\n: null\n", "photos: null\n...\n"])
def test_a_file_that_cannot_be_changed_so_stays_as_it_is(text: str, store: Store, folder: Path) -> None:
    (folder / "hill.yaml").write_text(text)
    with pytest.raises(UsageError, match="by hand"):
        write_schedule(store, "hill", Schedule(every="6h"))
    assert (folder / "hill.yaml").read_text() == text


def test_photographs_and_poses_that_vanished_are_told_with_file_and_line(store: Store, tmp_path: Path) -> None:
    photos, poses = tmp_path / "photos", tmp_path / "poses.json"
    photos.mkdir()
    (photos / "a.jpg").touch()
    poses.touch()
    file = write_scene(store, "hill", SceneEntry(photos=photos, poses=poses))
    entry = read_scene(store, "hill")
    assert entry.material() == Material(photos=photos, poses=poses)
    poses.unlink()
    with pytest.raises(InputError) as told:
        entry.material()
    assert told.value.problem == f"{file}:7: poses: {poses} does not exist (on {gethostname()})"
    (photos / "a.jpg").unlink()
    with pytest.raises(InputError) as told:
        entry.material()
    assert told.value.problem == f"{file}:4: photos: folder {photos} holds no photographs (on {gethostname()})"
    photos.rmdir()
    with pytest.raises(InputError) as told:
        entry.material()
    assert told.value.problem == f"{file}:4: photos: folder {photos} does not exist (on {gethostname()})"
    photos.touch()
    with pytest.raises(InputError, match="is a file, not a folder"):
        entry.material()
    with pytest.raises(InputError, match=r"^photos: folder"):
        SceneEntry(photos=photos).material()
    with pytest.raises(InputError, match="cannot be read: File name too long"):
        SceneEntry(photos=tmp_path / ("x" * 300)).material()


def test_the_configuration_is_the_presets_with_the_settings_over_it() -> None:
    entry = SceneEntry(photos=None, preset="small", settings={"training": {"steps": 5}})
    plain = SceneEntry(photos=None, preset="small").config()
    assert entry.config().training == plain.training.model_copy(update={"steps": 5})
    assert entry.config().model_copy(update={"training": plain.training}) == plain
    with pytest.raises(UsageError, match=r"training\.steps=-5"):
        SceneEntry(photos=None, settings={"training": {"steps": -5}}).config()
