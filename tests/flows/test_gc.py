"""`aug3d gc` says what would go and what stays, asks before a whole scene goes, and waits for nobody."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.store.scenes import share_version
from aug3d_core.store.store import Store
from flows.cli import app
from tests.store.little_store import add_collection_version, add_object, add_version


def invoke(*arguments: str | Path, says: str | None = None):
    return CliRunner().invoke(app, ["gc", *(str(argument) for argument in arguments)], input=says)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Return a store with four versions of a scene, the objects of which are 2 MiB each, and an object of no version."""
    store = Store(tmp_path)
    for i in range(4):
        add_object(store, "sfm", f"k{i}", 2 * 2**20)
        add_version(store, "demo", f"2026-0{i + 1}", [("sfm", f"k{i}")])
    add_object(store, "prediction", "p")
    return store


def objects(store: Store) -> set[str]:
    return {path.name for path in store.root.glob("objects/*/*")}


def test_a_dry_run_tells_by_scene_and_stage_and_drops_nothing(store: Store) -> None:
    done = invoke("--dry-run", "--home", store.root)
    assert done.exit_code == 0, done.output
    assert len(objects(store)) == 5
    rows = [line.split("│")[1:-1] for line in done.output.splitlines() if line.startswith("│")]
    cells = [[cell.strip() for cell in row] for row in rows]
    assert ["demo", "sfm", "1", "2.0"] in cells and ["demo", "version", "1", "0.0"] in cells
    assert ["together", "", "2", "2.0"] in cells and ["demo", "4", "0", "8.0", "0.0"] in cells
    assert "what would go" in done.output and "--keep-hours 0 drops them" in done.output
    assert "not in the registry: demo;" in done.output and "aug3d gc --scene NAME --home" in done.output


def test_a_collection_of_the_registry_is_no_stray(store: Store) -> None:
    add_collection_version(store, "all", "1", [("sfm", "k0")])
    COLLECTIONS.add(store, "all", CollectionEntry(towns=1))
    assert json.loads(invoke("--dry-run", "--home", store.root, "--json").stdout)["not_registered"] == ["demo"]


def test_what_went_is_told_as_json_with_the_disk_before_and_after(store: Store) -> None:
    done = invoke("--keep", 2, "--keep-hours", 0, "--home", store.root, "--json")
    told = json.loads(done.stdout)
    assert objects(store) == {"k2", "k3"}
    counts = {(row["scene"], row["what"]): row["count"] for row in told["goes"]}
    assert counts == {("demo", "sfm"): 2, ("demo", "version"): 2, (None, "prediction"): 1}
    assert told["bytes"] == sum(row["bytes"] for row in told["goes"]) > 4 * 2**20
    assert told["scenes"]["demo"]["versions"] == 2 and told["scenes"]["demo"]["own_bytes"] > 4 * 2**20
    assert told["not_registered"] == ["demo"] and told["young"] == {"count": 0, "bytes": 0}
    assert set(told["free_bytes"]) == {"before", "after"} and not told["dry_run"]
    again = invoke("--keep", 2, "--keep-hours", 0, "--home", store.root)
    assert again.exit_code == 0 and "nothing had to go" in again.output


def test_nothing_goes_while_a_run_uses_the_store_but_looking_is_free(store: Store) -> None:
    with store.using():
        refused, looked = invoke("--home", store.root), invoke("--dry-run", "--home", store.root)
    assert refused.exit_code == 1 and looked.exit_code == 0
    assert "is using the store" in refused.output and "wait until it has ended" in refused.output
    assert len(objects(store)) == 5


def test_a_whole_scene_goes_only_after_a_yes(store: Store) -> None:
    no = invoke("--scene", "demo", "--home", store.root, says="n\n")
    assert no.exit_code == 1 and "Drop all of this?" in no.output and "all of demo" in no.output
    assert len(objects(store)) == 5
    yes = invoke("--scene", "demo", "--home", store.root, says="y\n")
    assert yes.exit_code == 0 and objects(store) == {"p"}
    assert not list((store.root / "scenes").iterdir())


def test_a_scene_of_the_registry_is_said_to_stay_there(store: Store) -> None:
    (store.root / "scenes" / "demo.yaml").write_text("photos: null\n")
    told = invoke("--scene", "demo", "--home", store.root, says="n\n").output
    assert "it stays in the registry" in told and "aug3d scenes remove demo --home" in told
    assert "not in the registry" not in invoke("--dry-run", "--home", store.root).output


@pytest.mark.parametrize(
    ("words", "said", "code"),
    [
        (("--scene", "demo", "--json"), "add --yes", 2),
        (("--scene", "dmeo", "--yes"), "nothing of a scene 'dmeo'", 2),
        (("--scene", "../x", "--yes"), "is not a scene name", 2),
        (("--keep", "0"), "--keep", 2),
        (("--keep-hours", "-1"), "--keep-hours", 2),
    ],
)
def test_wrong_use_drops_nothing(words: tuple[str, ...], said: str, code: int, store: Store) -> None:
    done = invoke(*words, "--home", store.root)
    assert done.exit_code == code and said in done.output
    assert len(objects(store)) == 5


def test_a_version_that_cannot_be_read_is_named_and_nothing_goes(store: Store) -> None:
    (store.root / "scenes" / "demo" / "2026-01" / "metrics.json").write_text("{")
    done = invoke("--home", store.root)
    assert done.exit_code == 1 and "metrics.json does not say which objects it needs" in done.output
    assert len(objects(store)) == 5


def test_a_run_that_would_not_fit_is_refused_before_anything_is_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "aug3d_core.factory.estimate.room.shutil.disk_usage", lambda _: SimpleNamespace(free=300 * 2**20)
    )
    done = CliRunner().invoke(app, ["demo", "--home", str(tmp_path), "--json"])
    assert done.exit_code == 1
    failure = json.loads(done.stdout)["failure"]
    assert "300 MiB are free" in failure["problem"] and str(tmp_path) in failure["problem"]
    assert "aug3d gc" in failure["remedy"] and not (tmp_path / "prefect").exists()


def test_a_shared_store_is_told_and_cleaned_by_a_machine_that_made_nothing(tmp_path: Path, shared: str) -> None:
    maker, other = Store(tmp_path / "maker"), tmp_path / "other"
    for i in range(3):
        add_object(maker, "sfm", f"k{i}", 2 * 2**20)
        share_version(maker, add_version(maker, "demo", f"2026-0{i + 1}", [("sfm", f"k{i}")]), [("sfm", f"k{i}")])
    looked = json.loads(invoke("--dry-run", "--home", other, "--json").stdout)["shared"]
    assert (looked["url"], looked["objects"], looked["goes"]) == (shared, 3, [])
    assert looked["scenes"]["demo"]["versions"] == 3 and looked["store_bytes"] > 2 * 2**20
    said = invoke("--scene", "demo", "--home", other, says="n\n").output
    assert "Drop all of this?" in said and "version" in said and not [*other.glob("scenes/*/*")]
    gone = json.loads(invoke("--scene", "demo", "--yes", "--home", other, "--json").stdout)["shared"]
    assert [(row["scene"], row["what"], row["count"]) for row in gone["goes"]] == [("demo", "version", 3)]
    assert gone["scenes"] == {} and looked["bytes"] == 0
    text = invoke("--dry-run", "--home", other).output
    assert f"in {shared}" in text and "in all  3 objects" in text
