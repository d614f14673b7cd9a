"""The one task: what was made is not made again; what changed, vanished or was altered is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.material import Material
from aug3d_core.factory.stages import PHOTOS
from aug3d_core.factory.walk import walk
from aug3d_core.run.errors import StageFailed
from aug3d_core.store.store import Store

pytestmark = pytest.mark.usefixtures("prefect")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    photos = tmp_path / "photos"
    photos.mkdir()
    rng = np.random.default_rng(0)
    for index in range(4):
        Image.fromarray(rng.integers(0, 255, (240, 320, 3), np.uint8)).save(photos / f"{index}.jpg")
    return photos


def make_photos(home: Path, folder: Path):
    from prefect import flow

    from tasks.build_task import through_prefect

    store = Store(home)

    @flow
    def only_photos():
        (visit,) = walk(store, [PHOTOS], scene_config("tiny"), Material(photos=folder), through_prefect(store))
        return visit

    return only_photos()


def test_a_second_run_computes_nothing_and_prefect_knows(tmp_path: Path, folder: Path) -> None:
    first, second = make_photos(tmp_path / "home", folder), make_photos(tmp_path / "home", folder)
    assert not first.cached and second.cached
    assert first.record == second.record
    assert last_task_state() == "Cached"


@pytest.mark.parametrize("harm", ["alter", "remove"])
def test_a_harmed_object_is_a_miss_for_prefect_too(tmp_path: Path, folder: Path, harm: str) -> None:
    first = make_photos(tmp_path / "home", folder)
    table = Store(tmp_path / "home").files_dir(first.record) / "photos.parquet"
    table.write_bytes(b"rubbish") if harm == "alter" else table.unlink()
    again = make_photos(tmp_path / "home", folder)
    assert not again.cached
    assert again.record.digest == first.record.digest
    assert last_task_state() == "Completed"


def test_a_changed_photo_is_a_miss(tmp_path: Path, folder: Path) -> None:
    first = make_photos(tmp_path / "home", folder)
    Image.new("RGB", (320, 240), "red").save(folder / "0.jpg")
    again = make_photos(tmp_path / "home", folder)
    assert not again.cached and again.record.key != first.record.key


def test_a_failed_stage_fails_the_flow_with_its_typed_error(tmp_path: Path, folder: Path) -> None:
    for photo in ("1.jpg", "2.jpg", "3.jpg"):
        (folder / photo).write_bytes((folder / photo).read_bytes()[:500])
    with pytest.raises(StageFailed, match="photos") as caught:
        make_photos(tmp_path / "home", folder)
    assert caught.value.remedy and caught.value.replay


def last_task_state() -> str:
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.sorting import TaskRunSort

    with get_client(sync_client=True) as client:
        runs = client.read_task_runs(sort=TaskRunSort.EXPECTED_START_TIME_DESC, limit=1)
    return runs[0].state_name or ""
