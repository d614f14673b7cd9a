"""`aug3d collections`: what people type, and what they are told. Training itself is a journey of its own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.judging.summary import CHEAP
from aug3d_core.scene_files import SceneEntry, Schedule, write_scene
from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.store import Store
from flows.cli import app


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "home"))
    store = Store(tmp_path / "home")
    for scene in ("north", "far"):
        write_scene(store, scene, SceneEntry(photos=None))
    return store


def collections(*words: str | Path, answer: str = "") -> Result:
    return CliRunner().invoke(app, ["collections", *map(str, words)], input=answer)


def told(*words: str | Path) -> Any:
    done = collections(*words, "--json")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def trained(store: Store, name: str, **psnr_db: float) -> Path:
    scores = {"test_ssim_mean": 0.7, "test_views": 4, **{f"cheap_{one}": 20.0 for one in CHEAP}}
    tests = {scene: {"role": "hold out", "test_psnr_mean": db, **scores} for scene, db in psnr_db.items()}
    version = new_version(store, name, layout.COLLECTIONS)
    trouble = {"lost": {"role": "train", "trouble": "its disk is gone", "remedy": "connect it"}}
    metrics = {
        "collection": name,
        "state": "degraded",
        "tests": tests,
        "scenes": trouble,
        "untested": {"odd": "no test"},
    }
    write_metrics(version, metrics | {"notes": ["they overlap"], "objects": [], "training": {"key": "k"}})
    publish(store, version)
    return version


def test_a_collection_is_added_with_everything_and_what_is_next(store: Store) -> None:
    done = collections(
        "add", "all", "--train", "north", "--hold-out", "far", "--towns", "3", "--towns-seed", "5",
        "--set", "training.steps=50", "--cron", "0 3 * * 1", "--timezone", "Europe/Warsaw", "--description", "Both",
    )  # fmt: skip
    assert done.exit_code == 0 and "collections train all" in done.output
    assert COLLECTIONS.read(store, "all") == CollectionEntry(
        train=("north",),
        hold_out=("far",),
        towns=3,
        towns_seed=5,
        settings={"training": {"steps": 50}},
        description="Both",
        schedule=Schedule(cron="0 3 * * 1", timezone="Europe/Warsaw"),
    )


def test_a_head_that_is_chosen_is_written_by_its_name_alone(store: Store) -> None:
    assert collections("add", "all", "--train", "north", "--set", "training.head=pixelnerf").exit_code == 0
    entry = COLLECTIONS.read(store, "all")
    assert entry.settings == {"training": {"head": {"name": "pixelnerf"}}}
    assert entry.config().training.head.name == "pixelnerf"


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["all", "--train", "nowhere"], "scene 'nowhere' is not registered"),
        (["all", "--train", "north", "--hold-out", "north"], "can play one part"),
        (["all"], "nothing to train on"),
        (["../all", "--towns", "1"], "is not a scene name"),
        (["all", "--towns", "1", "--preset", "huge"], "no preset 'huge'"),
        (["all", "--towns", "1", "--set", "training.stepps=1"], "no field 'stepps'"),
        (["all", "--towns", "1", "--set", "sfm.seed=1"], "each scene's own"),
        (["all", "--towns", "1", "--cron", "never"], "--cron 'never': has 1 fields"),
        (
            ["all", "--towns", "1", "--cron", "0 3 * * 1", "--every", "6h"],
            "a schedule takes --cron or --every, not both",
        ),
        (["all", "--towns", "1", "--preset", "auto"], "--preset auto: collections take tiny, small or paper"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(store: Store, words: list[str], problem: str) -> None:
    done = collections("add", *words)
    assert done.exit_code == 2 and problem in done.output.replace("\n", " ")
    assert COLLECTIONS.read_each(store) == {}


def test_a_list_shows_each_and_what_is_wrong_with_it(store: Store) -> None:
    assert "no collection yet" in collections("list").output
    COLLECTIONS.add(store, "all", CollectionEntry(train=("north",), towns=2))
    (store.root / "collections" / "odd.yaml").write_text("towns: [")
    trained(store, "all", far=21.0)
    listed = {one["collection"]: one for one in told("list")}
    assert listed["all"]["versions"] == 1 and listed["all"]["published"]
    assert "odd.yaml:1" in listed["odd"]["problem"]
    assert collections("list").exit_code == 0


def test_show_tells_the_parts_and_how_good_the_model_is(store: Store) -> None:
    COLLECTIONS.add(store, "all", CollectionEntry(train=("north",), hold_out=("far",), towns=2))
    assert "collections train all" in collections("show", "all").output
    version = trained(store, "all", far=21.25)
    output = collections("show", "all").output
    for text in (
        "north, 2 towns",
        "21.25",
        "its disk is gone",
        "connect it",
        "odd: no test",
        "they overlap",
        version.name,
    ):
        assert text in output
    assert told("show", "all")["metrics"]["tests"]["far"]["test_psnr_mean"] == 21.25
    assert collections("show", "none").exit_code == 2


def test_what_is_next_names_a_home_that_is_not_the_usual_one(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AUG3D_HOME", str(tmp_path / "another"))
    there = ("--home", str(store.root))
    for words in (("list",), ("add", "all", "--train", "north"), ("show", "all")):
        assert f"--home {store.root}" in collections(*words, *there).output.replace("\n", " "), words
    Store(tmp_path / "empty")
    listed = CliRunner().invoke(app, ["scenes", "list", "--home", str(tmp_path / "empty")]).output
    assert f"scenes add my_scene --photos DIR --home {tmp_path / 'empty'}" in listed.replace("\n", " ")


def test_removing_asks_and_leaves_the_versions(store: Store) -> None:
    COLLECTIONS.add(store, "all", CollectionEntry(towns=1))
    version = trained(store, "all", far=21.0)
    assert collections("remove", "all", answer="n\n").exit_code == 1
    assert collections("remove", "all", "--json").exit_code == 2
    assert collections("remove", "all", "--yes").exit_code == 0
    assert COLLECTIONS.read_each(store) == {} and version.is_dir()


def test_training_what_is_not_there_or_wrong_is_refused_at_once(store: Store) -> None:
    assert "no collection 'all'" in collections("train", "all").output
    (store.root / "collections").mkdir()
    (store.root / "collections" / "odd.yaml").write_text("towns: [")
    done = collections("train", "odd")
    assert done.exit_code == 1 and "odd.yaml:1" in done.output
