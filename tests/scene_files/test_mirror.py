"""The registry of one machine, on others: the same scenes, the same mistakes, and never in place of files that people wrote."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from aug3d_core.bench.s3_service import BUCKET, KEYS, s3_service
from aug3d_core.collections.entry import CollectionEntry
from aug3d_core.collections.files import COLLECTIONS
from aug3d_core.factory.material import Elsewhere, gather
from aug3d_core.factory.stages import FROM_MODEL, FROM_POSES, POSES
from aug3d_core.run.errors import Aug3dError, InputError, StoreError, UsageError
from aug3d_core.run.stage import Stage
from aug3d_core.scene_files.entry import SceneEntry
from aug3d_core.scene_files.files import REGISTRY, read_each, read_scene, remove_scene, scene_file, write_scene
from aug3d_core.scene_files.mirror import (
    bring,
    check_has_none_of_its_own,
    share,
    tell_photographs,
    told_photographs,
    was_brought,
)
from aug3d_core.scene_files.schedule import Schedule
from aug3d_core.store.bucket import Bucket
from aug3d_core.store.store import Store

BOTH = (REGISTRY, COLLECTIONS)


@pytest.fixture(scope="module")
def service() -> Iterator[str]:
    with s3_service() as address:
        yield address


@pytest.fixture
def bucket(service: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Bucket:
    for name, value in {**KEYS, "AWS_ENDPOINT_URL": service}.items():
        monkeypatch.setenv(name, value)
    return Bucket(f"s3://{BUCKET}/{tmp_path.name}")


@pytest.fixture
def here(tmp_path: Path) -> Store:
    return Store(tmp_path / "here")


@pytest.fixture
def there(tmp_path: Path) -> Store:
    return Store(tmp_path / "there")


def test_scenes_and_collections_are_the_same_there(bucket: Bucket, here: Store, there: Store) -> None:
    entry = SceneEntry(
        photos=None, settings={"training": {"steps": 7}}, tags=("gpu",), schedule=Schedule(cron="0 3 * * 1")
    )
    write_scene(here, "hill", entry)
    COLLECTIONS.add(here, "all", CollectionEntry(train=("hill",)))
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    assert read_each(there) == {"hill": entry}
    assert COLLECTIONS.read_each(there) == COLLECTIONS.read_each(here)
    assert "Brought from" in scene_file(there, "hill").read_text().splitlines()[0]


def test_a_relative_path_is_the_same_folder_on_every_machine(bucket: Bucket, here: Store, there: Store) -> None:
    (here.root / "scenes" / "hill.yaml").write_text("photos: ../photos\n")
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    assert read_scene(there, "hill").photos == here.root / "photos"


def test_photographs_that_are_not_there_are_known_by_what_was_told_last(
    bucket: Bucket, here: Store, there: Store
) -> None:
    write_scene(here, "hill", SceneEntry(photos=here.root / "photos"))
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    assert was_brought(scene_file(there, "hill")) and not was_brought(scene_file(here, "hill"))
    entry = read_scene(there, "hill")
    with pytest.raises(InputError, match="photos"):
        entry.material()
    assert told_photographs(bucket, "hill") is None
    for read in (
        Elsewhere(photos="before", photo_count=1),
        Elsewhere(photos="now", photo_count=2, poses="p", has_points=True),
    ):
        tell_photographs(bucket, "hill", read)
    material = entry.material(told_photographs(bucket, "hill"))
    assert (material.photos, material.elsewhere) == (entry.photos, read)
    with pytest.raises(UsageError):
        tell_photographs(bucket, "../hill", read)
    bucket.put(bucket_name := "photographs/hill", b"{")
    with pytest.raises(StoreError, match=bucket_name):
        told_photographs(bucket, "hill")


@pytest.mark.parametrize(("has_points", "stages"), [(True, FROM_MODEL), (False, FROM_POSES)])
def test_what_poses_that_are_not_there_hold_was_told(here: Store, has_points: bool, stages: tuple[Stage, ...]) -> None:
    entry = SceneEntry(photos=here.root / "photos", poses=here.root / "sparse")
    material = entry.material(Elsewhere(photos="a", photo_count=3, poses="b", has_points=has_points))
    assert material.stages() == stages
    sources = gather(here, replace(POSES, inputs=("folder", "given")), {}, material)
    assert {name: source.digest for name, source in sources.items()} == {"folder": "a", "given": "b"}


def test_what_is_changed_and_removed_follows(bucket: Bucket, here: Store, there: Store) -> None:
    for scene in ("hill", "dale"):
        write_scene(here, scene, SceneEntry(photos=None))
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    remove_scene(here, "hill")
    scene_file(here, "dale").write_text("photos: null\npreset: small\n")
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    assert read_each(there) == {"dale": SceneEntry(photos=None, preset="small")}


def test_what_is_wrong_here_is_wrong_there(bucket: Bucket, here: Store, there: Store) -> None:
    (here.root / "scenes" / "hill.yaml").write_text("photos: [")
    write_scene(here, "dale", SceneEntry(photos=None))
    (here.root / "scenes" / "dale.yml").write_text("photos: null\n")
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    assert {scene: type(entry) for scene, entry in read_each(there).items()} == {
        scene: type(entry) for scene, entry in read_each(here).items()
    }
    assert all(isinstance(entry, Aug3dError) for entry in read_each(there).values())


def test_a_file_whose_name_is_no_text_keeps_no_other_from_being_shared(
    bucket: Bucket, here: Store, there: Store
) -> None:
    write_scene(here, "hill", SceneEntry(photos=None))
    (here.root / "scenes" / os.fsdecode(b"h\xfcgel.yaml")).write_text("photos: null\n")
    share(here, bucket, BOTH)
    bring(there, bucket, BOTH)
    assert [*read_each(there)] == ["hill"]


def test_files_that_people_wrote_are_never_replaced(bucket: Bucket, here: Store, there: Store) -> None:
    share(here, bucket, BOTH)
    file = write_scene(there, "own", SceneEntry(photos=None))
    before = file.read_bytes()
    for tried in (lambda: bring(there, bucket, BOTH), lambda: check_has_none_of_its_own(there, BOTH)):
        with pytest.raises(UsageError, match=r"own\.yaml was written here"):
            tried()
    assert file.read_bytes() == before


def test_a_store_without_a_registry_or_with_a_torn_one(bucket: Bucket, there: Store) -> None:
    with pytest.raises(StoreError, match="no registry") as refused:
        bring(there, bucket, BOTH)
    assert "aug3d up" in refused.value.remedy
    bucket.put("registry.json", b"{")
    with pytest.raises(StoreError, match="damaged"):
        bring(there, bucket, BOTH)


def test_names_from_the_store_stay_in_their_folder(bucket: Bucket, there: Store) -> None:
    names = (
        "scenes/../../out.yaml",
        "scenes/.hidden.yaml",
        "scenes/a b.yaml",
        "objects/x.yaml",
        "scenes/x.txt",
        "x.yaml",
    )
    told = {
        "host": "evil\nphotos: x",
        "files": {**dict.fromkeys(names, "photos: null"), "scenes/good.yaml": "photos: null"},
    }
    bucket.put("registry.json", json.dumps(told).encode())
    before = {path for path in there.root.parent.rglob("*") if path.is_file()}
    bring(there, bucket, BOTH)
    after = {path for path in there.root.parent.rglob("*") if path.is_file() and path.suffix != ".lock"}
    assert after - before == {there.root / "scenes" / "good.yaml"}
    assert read_each(there) == {"good": SceneEntry(photos=None)}
