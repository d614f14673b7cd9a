"""`aug3d scenes`: what people type, what they are told, and what stands in the file afterwards."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from aug3d_core.scene_files import SceneEntry, Schedule, read_scene
from aug3d_core.store.published import publish
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.store import Store
from flows.cli import app


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "home"))
    return Store(tmp_path / "home")


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    (tmp_path / "photos" / "east").mkdir(parents=True)
    for name in ("a.jpg", "b.JPG", "east/c.tif", "notes.txt"):
        (tmp_path / "photos" / name).touch()
    return tmp_path / "photos"


def scenes(*words: str | Path, answer: str = "") -> Result:
    return CliRunner().invoke(app, ["scenes", *map(str, words)], input=answer)


def told(*words: str | Path) -> Any:
    done = scenes(*words, "--json")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def made(store: Store, scene: str, state: str, psnr_db: float | None) -> Path:
    nvs = {} if psnr_db is None else {"nvs": {"test_psnr_mean": psnr_db}}
    version = new_version(store, scene)
    write_metrics(version, {"scene": scene, "state": state, "preset": "tiny", "seconds": 61.4, **nvs})
    return version


def test_a_scene_is_added_with_everything_and_what_is_next(store: Store, photos: Path) -> None:
    done = scenes(
        "add", "hill", "--photos", photos, "--set", "training.steps=500", "--set", "grouping.k=auto", "--licence", "CC-BY",
        "--description", "East: the hill", "--tag", "city", "--cron", "0 3 * * 1", "--timezone", "Europe/Warsaw",
    )  # fmt: skip
    assert done.exit_code == 0 and "scenes show hill" in done.output and " up " in done.output
    assert read_scene(store, "hill") == SceneEntry(
        photos=photos,
        settings={"training": {"steps": 500}, "grouping": {"k": "auto"}},
        licence="CC-BY",
        description="East: the hill",
        tags=("city",),
        schedule=Schedule(cron="0 3 * * 1", timezone="Europe/Warsaw"),
    )


def test_photographs_are_stored_with_their_whole_path(
    store: Store, photos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(photos.parent)
    assert told("add", "hill", "--photos", "photos")["photos"] == str(photos)
    assert f"photos: {photos}\n" in (store.root / "scenes" / "hill.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "give either --photos DIR or --town"),
        (("--town", "--photos", "."), "give either --photos DIR or --town"),
        (("--photos", "missing"), "--photos missing does not exist"),
        (("--photos", "photos/a.jpg"), "is a file, not a folder"),
        (("--photos", "empty"), "--photos empty holds no photographs"),
        (("--town", "--poses", "photos"), "name the folder of these, too"),
        (("--town", "--preset", "huge"), "no preset 'huge'"),
        (("--town", "--set", "training.step=5"), "no field 'step'"),
        (("--town", "--cron", "0 25 * * 1"), "--cron '0 25 * * 1': field 2, hour, cannot be '25'"),
        (("--town", "--cron", ""), "has 0 fields"),
        (("--town", "--every", "1w"), "--every '1w': is not an interval"),
        (("--town", "--every", "6h", "--timezone", "Warsaw"), "did you mean Europe/Warsaw?"),
        (("--town", "--every", "6h", "--cron", "0 3 * * 1"), "a schedule takes --cron or --every, not both"),
        (("--town", "--timezone", "UTC"), "a schedule needs --cron or --every"),
    ],
)
def test_a_scene_that_cannot_be_added(
    words: tuple[str, ...], said: str, store: Store, photos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(photos.parent)
    (photos.parent / "empty").mkdir()
    done = scenes("add", "hill", *words)
    assert done.exit_code == 2 and said in done.output
    assert not list((store.root / "scenes").iterdir())


def test_a_second_scene_of_one_name_changes_nothing(store: Store) -> None:
    file = Path(told("add", "hill", "--town", "--licence", "ours")["file"])
    done = scenes("add", "Hill", "--town")
    assert done.exit_code == 2 and str(file) in done.output
    assert read_scene(store, "hill").licence == "ours"


def test_the_list_tells_of_each_scene_and_of_those_that_are_not_well(store: Store, photos: Path) -> None:
    assert "scenes add my_scene" in scenes("list").output
    told("add", "hill", "--photos", photos, "--every", "6h")
    told("add", "lost", "--photos", photos / "east")
    (store.root / "scenes" / "wrong.yml").write_text("photos: null\npreset: huge")
    (store.root / "scenes" / "two words.yml").write_text("photos: null")
    publish(store, made(store, "hill", "ok", 22.5))
    made(store, "other", "ok", None)
    (photos / "east" / "c.tif").unlink()
    (photos / "east").rmdir()
    listed = told("list")
    by_name = {scene["scene"]: scene for scene in listed["scenes"]}
    assert {name: scene["state"] for name, scene in by_name.items()} == {
        "hill": "ok", "lost": "gone", "wrong": "wrong", "two words": "wrong",
    }  # fmt: skip
    assert by_name["hill"]["photo_count"] == 2 and by_name["hill"]["versions"][0]["psnr_db"] == 22.5
    assert by_name["hill"]["published"] == by_name["hill"]["versions"][0]["version"]
    assert "lost.yaml:4: photos: folder" in by_name["lost"]["problem"]
    assert listed["not_in_the_registry"] == ["other"]
    shown = scenes("list").output
    for words in (
        "2 in",
        "Every 6h (UTC)",
        "next ",
        "22.50",
        "gone: ",
        "wrong.yml:2: preset = 'huge'",
        "registry: other",
    ):
        assert words in shown


def test_show_tells_what_differs_from_the_preset_and_the_versions(store: Store) -> None:
    told("add", "hill", "--town", "--set", "training.steps=500", "--set", "training.seed=0", "--licence", "[CC] BY")
    first, second = made(store, "hill", "ok", 22.5), made(store, "hill", "refused", None)
    publish(store, first)
    facts = told("show", "hill")
    assert facts["changes"] == {"training.steps": {"value": 500, "preset": 100}}
    assert [version["version"] for version in facts["versions"]] == [first.name, second.name]
    shown = scenes("show", "hill").output
    for words in ("built-in town", "[CC] BY", "training.steps = 500 (preset: 100)", "published", "22.50", "refused"):
        assert words in shown
    (second / "metrics.json").unlink()
    (first / "metrics.json").unlink()
    assert "no versions yet" in scenes("show", "hill").output


def test_show_of_a_file_with_a_mistake_names_it(store: Store) -> None:
    (store.root / "scenes" / "hill.yaml").write_text("photos: null\nphotos: null")
    done = scenes("show", "hill")
    assert done.exit_code == 1 and "hill.yaml:2: there is photos twice" in done.output


def test_removing_asks_and_leaves_the_versions(store: Store) -> None:
    told("add", "hill", "--town")
    version = made(store, "hill", "ok", 22.5)
    assert scenes("remove", "hill", answer="n\n").exit_code == 1
    assert scenes("remove", "hill", "--json").exit_code == 2
    assert read_scene(store, "hill")
    done = scenes("remove", "hill", answer="y\n")
    assert done.exit_code == 0 and "1 version " in done.output and "gc --scene hill" in done.output
    assert version.exists() and scenes("remove", "hill", "--yes").exit_code == 2


def test_a_file_with_a_mistake_can_be_removed(store: Store) -> None:
    (store.root / "scenes" / "hill.yml").write_text("photos: null\n\t")
    assert told("remove", "hill", "--yes")["versions"] == 0
    assert not list((store.root / "scenes").iterdir())


def test_a_schedule_is_given_changed_held_and_taken_away(store: Store) -> None:
    file = Path(told("add", "hill", "--town")["file"])
    file.write_text(f"# ours\n{file.read_text()}# the end\n")
    assert told("schedule", "hill", "--cron", "0 3 * * 1", "--timezone", "Europe/Warsaw")["next"]
    assert told("schedule", "hill", "--timezone", "Asia/Tokyo")["when"] == "At 03:00 on Monday (Asia/Tokyo)"
    assert told("schedule", "hill", "--pause")["next"] is None
    assert read_scene(store, "hill").schedule == Schedule(cron="0 3 * * 1", timezone="Asia/Tokyo", paused=True)
    assert told("schedule", "hill", "--resume")["next"]
    assert "hill: Every 6h (Asia/Tokyo), next " in scenes("schedule", "hill", "--every", "6h").output
    assert told("schedule", "hill", "--off")["schedule"] is None
    assert file.read_text().startswith("# ours\n") and file.read_text().endswith("# the end\n")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "say one thing"),
        (("--off", "--pause"), "say one thing"),
        (("--off", "--every", "6h"), "say one thing"),
        (("--pause",), "has no schedule"),
        (("--timezone", "UTC"), "a schedule needs --cron or --every"),
        (("--cron", "0 3 * * 9"), "field 5, weekday, cannot be '9'"),
    ],
)
def test_a_schedule_that_cannot_be(words: tuple[str, ...], said: str, store: Store) -> None:
    file = Path(told("add", "hill", "--town")["file"])
    before = file.read_bytes()
    done = scenes("schedule", "hill", *words)
    assert done.exit_code == 2 and said in done.output
    assert file.read_bytes() == before
