"""A run of a registered scene follows its file, and what is said on the command line is stronger, and told."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material
from aug3d_core.run.errors import UsageError
from aug3d_core.scene_files import SceneEntry, write_scene
from aug3d_core.store.store import Store
from flows import cli
from flows.registered import as_registered, tell_of_file
from tests.photos.photo_files import write_photo

SETTINGS = ["training.steps=500"]


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Return two folders of photographs."""
    for name in ("near", "far"):
        write_photo(tmp_path / name / "a.jpg", seed=0)
    return tmp_path / "near", tmp_path / "far"


@pytest.fixture
def store(tmp_path: Path, folders: tuple[Path, Path]) -> Store:
    store = Store(tmp_path / "home")
    write_scene(store, "hill", SceneEntry(photos=folders[0], preset="auto", settings={"training": {"steps": 500}}))
    write_scene(store, "town", SceneEntry(photos=None))
    return store


def told(store: Store, scene: str, material: Material, preset: str, *overrides: str) -> str:
    console = Console(file=io.StringIO(), width=1000)
    tell_of_file(console, store, scene, material, preset, scene_config(preset, overrides))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_name_alone_is_what_the_file_says(store: Store, folders: tuple[Path, Path]) -> None:
    material, preset, config = as_registered(store.root, "hill", None, None, [])
    assert (material, preset, config) == (Material(photos=folders[0]), "auto", scene_config("auto", SETTINGS))
    assert as_registered(store.root, "town", None, None, []) == (Material(), "tiny", scene_config("tiny"))


def test_what_is_said_is_stronger_than_the_file(store: Store) -> None:
    _, preset, config = as_registered(store.root, "hill", None, "small", ["training.seed=3"])
    assert (preset, config) == ("small", scene_config("small", [*SETTINGS, "training.seed=3"]))
    _, _, config = as_registered(store.root, "hill", None, None, ["training.steps=7"])
    assert config == scene_config("auto", ["training.steps=7"])
    poses = store.root / "transforms.json"
    assert as_registered(store.root, "hill", poses, None, [])[0].poses == poses
    with pytest.raises(UsageError, match="town is the built-in town"):
        as_registered(store.root, "town", poses, None, [])


def test_a_scene_that_is_not_registered_needs_photographs(store: Store) -> None:
    with pytest.raises(UsageError, match="--photos is missing, and there is no scene 'hil'") as missing:
        as_registered(store.root, "hil", None, None, [])
    assert "give --photos DIR; did you mean hill?" in missing.value.remedy


def test_a_run_that_follows_the_file_says_so_and_one_that_does_not_says_in_what(
    store: Store, folders: tuple[Path, Path]
) -> None:
    near, far = (Material(photos=folder) for folder in folders)
    assert told(store, "hill", near, "auto", *SETTINGS).strip() == f"as {store.root}/scenes/hill.yaml says"
    assert told(store, "dale", near, "tiny") == ""
    other = told(store, "hill", far, "tiny")
    assert other.count("\n") == 1 and other.startswith("note ") and "aug3d run hill alone follows it" in other
    assert f"otherwise: photos {folders[0]}, preset auto, training.steps 500;" in other
    assert "otherwise: training.steps 500;" in told(store, "hill", near, "auto", "training.steps=7")
    assert "otherwise: training.steps 100;" in told(store, "town", Material(), "tiny", "training.steps=7")
    fields = ("town.seed", "sfm.seed", "training.seed", "training.steps", "training.warmup_steps", "evaluation.panels")
    assert "and 1 more;" in told(store, "town", Material(), "tiny", *(f"{field}=8" for field in fields))


def test_a_file_with_a_mistake_stops_no_run_that_does_not_need_it(store: Store, folders: tuple[Path, Path]) -> None:
    (store.root / "scenes" / "hill.yaml").write_text("photos: [")
    note = told(store, "hill", Material(photos=folders[0]), "tiny")
    assert "its file is wrong" in note and "hill.yaml:1" in note
    done = CliRunner().invoke(cli.app, ["run", "hill", "--home", str(store.root)])
    assert done.exit_code == 1 and "hill.yaml:1" in done.output.replace("\n", "")


@pytest.mark.parametrize("words", [[], ["--photos", "{far}"]])
def test_the_command_plans_what_the_file_says_or_what_was_said(
    words: list[str], store: Store, folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    planned: list[Any] = []
    monkeypatch.setattr(cli, "print_plan", lambda *given: planned.extend(given))
    line = ["run", "hill", "--home", str(store.root), "--dry-run", *(word.format(far=folders[1]) for word in words)]
    done = CliRunner().invoke(cli.app, line)
    assert done.exit_code == 0, done.output
    photos, config = (folders[1], scene_config("tiny")) if words else (folders[0], scene_config("auto", SETTINGS))
    assert planned[2:4] == [Material(photos=photos), config]
    assert ("says otherwise" if words else "hill.yaml says") in done.output.replace("\n", " ")


def test_the_help_says_that_a_registered_scene_needs_no_more_than_its_name() -> None:
    told = " ".join(CliRunner().invoke(cli.app, ["run", "--help"]).output.split())
    assert "A registered scene needs no more than its name" in told
