"""A home that can only be read: what reads works, and what writes says which folder cannot be written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aug3d_core.store import layout
from aug3d_core.store.published import publish
from aug3d_core.store.scenes import last_version, object_of
from aug3d_core.store.store import Store
from flows.cli import app
from tests.photos.photo_files import write_photo
from tests.tasks.logged import version
from tests.tests_support import flip

ReadOnly = Callable[[Path], None]


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photos")
    write_photo(folder / "a.jpg", seed=0)
    return folder


@pytest.fixture
def home(tmp_path: Path, photos: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a home with two versions of a scene, the registry's files, and a collection."""
    home = tmp_path / "home"
    monkeypatch.setenv("AUG3D_HOME", str(home))
    first, _ = version(home, scene="hill"), version(home, "b", scene="hill")
    for words in (["scenes", "add", "hill", "--photos", str(photos)], ["collections", "add", "all", "--train", "hill"]):
        assert CliRunner().invoke(app, words).exit_code == 0
    publish(Store(home), first)
    return home


READS = (
    "show hill", "compare hill@published hill", "verify", "verify hill", "gc --dry-run", "gc --dry-run --scene hill",
    "scenes list", "scenes show hill", "collections list", "collections show all", "demo --dry-run",
    "run hill --photos {photos} --dry-run",
)  # fmt: skip


@pytest.mark.parametrize("line", READS)
def test_what_reads_says_the_same_as_where_it_may_write(
    line: str, home: Path, photos: Path, read_only: ReadOnly
) -> None:
    words = [*line.format(photos=photos).split(), "--json"]
    before = CliRunner().invoke(app, words)
    held = sorted(home.rglob("*"))
    read_only(home)
    after = CliRunner().invoke(app, words)
    assert (before.exit_code, after.exit_code) == (0, 0), after.output
    told = [json.loads(done.stdout) for done in (before, after)]
    for one in told:  # what it took, and what else is on the disk
        for name in ("seconds", "free_bytes"):
            one.pop(name, None) if isinstance(one, dict) else None
    assert told[0] == told[1] and sorted(home.rglob("*")) == held


# Not study stability: it brings open3d into this process, and other tests of it have torch
WRITES = (
    "demo", "run hill --photos {photos}", "gc", "gc --scene hill", "verify --repair", "scenes add two --town",
    "scenes remove hill --yes", "scenes schedule hill --every 6h", "collections add two --towns 3",
    "collections remove all --yes", "collections train all", "collections towns --count 1", "study grouping hill",
    "study tradeoff hill", "bench geometry", "up", "predict --photos {photos}",
)  # fmt: skip


@pytest.mark.parametrize("line", WRITES)
def test_what_writes_names_the_folder(line: str, home: Path, photos: Path, read_only: ReadOnly) -> None:
    read_only(home)
    done = CliRunner().invoke(app, [*line.format(photos=photos).split(), "--json"])
    assert done.exit_code == 1 and done.exception.__class__ is SystemExit, done.output
    assert (
        json.loads(done.stdout)["failure"]["problem"] == f"the store {home} can only be read: {home} cannot be written"
    )


def test_what_waits_for_mlflow_waits_on(home: Path, read_only: ReadOnly) -> None:
    waiting = home / layout.MLFLOW_OUTBOX / "one.json"
    waiting.parent.mkdir()
    newest = max(path.parent.name for path in (home / layout.SCENES / "hill").glob(f"*/{layout.METRICS}"))
    waiting.write_text(json.dumps({"scene": "hill", "version": newest}))
    read_only(home)
    done = CliRunner().invoke(app, ["compare", "hill@published", "hill"])
    assert done.exit_code == 0 and "MLflow" not in done.output and waiting.exists()


def test_one_folder_that_cannot_be_written_is_named(home: Path, read_only: ReadOnly) -> None:
    read_only(home / layout.OBJECTS)
    assert CliRunner().invoke(app, ["show", "hill"]).exit_code == 0
    done = CliRunner().invoke(app, ["demo"])
    assert done.exit_code == 1 and f"{home / layout.OBJECTS} cannot be written" in done.output.replace("\n", "")


def test_a_home_with_nothing_in_it_is_read(tmp_path: Path, read_only: ReadOnly) -> None:
    (tmp_path / "home").mkdir()
    read_only(tmp_path / "home")
    for words, code in ((["scenes", "list"], 0), (["collections", "list"], 0), (["verify"], 0), (["show", "hill"], 2)):
        assert CliRunner().invoke(app, [*words, "--home", str(tmp_path / "home")]).exit_code == code


def test_what_is_damaged_is_named_and_stays(home: Path, read_only: ReadOnly) -> None:
    store = Store(home)
    record = object_of(store, last_version(store, "hill"), "dataset")
    flip(store.place(record) / "panel.png")
    read_only(home)
    done = CliRunner().invoke(app, ["verify", "--json"])
    assert done.exit_code == 3 and len(json.loads(done.stdout)["damaged"]) == 1
    done = CliRunner().invoke(app, ["export", "hill", str(home.parent / "out"), "--format", "dtu"])
    assert done.exit_code == 1 and "it could not be put aside" in done.output
