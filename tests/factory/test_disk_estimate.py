"""A run that may not fit on the disk is refused beforehand, with an estimate that is too large rather than too small."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from aug3d_core.factory.config import SceneConfig, scene_config
from aug3d_core.factory.disk_estimate import check_room, first_run_bytes
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import Step, steps
from aug3d_core.factory.stages import FROM_PHOTOS, FROM_TOWN
from aug3d_core.run.errors import StoreError
from aug3d_core.store.record import FileEntry, Record
from aug3d_core.store.store import Store

TINY = scene_config("tiny")
MIB = 2**20


def material(folder: Path, photos: int) -> Material:
    folder.mkdir(exist_ok=True)
    for i in range(photos):
        (folder / f"{i}.jpg").touch()
    return Material(photos=folder)


def nothing_made(given: Material) -> list[tuple[Step, Record | None]]:
    return [(step, None) for step in steps(FROM_PHOTOS if given.photos else FROM_TOWN, {})]


def record(stage: str, config: SceneConfig, size_bytes: int) -> Record:
    return Record(
        stage=stage, key="k", digest="d", recipe="r", config=getattr(config, stage).model_dump(), inputs={}, versions={},
        files={"all": FileEntry(sha256="", size_bytes=size_bytes, mtime_ns=0)}, metrics={}, state="ok", notes=(),
        series={}, pictures={}, seconds=1.0, peak_mib=1.0,
    )  # fmt: skip


def version(size_bytes: int) -> dict[str, Record]:
    """Return the records of an earlier version, each of the same size."""
    return {stage.name: record(stage.name, TINY, size_bytes) for stage in FROM_TOWN}


@pytest.fixture
def free_mib(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    def set_free(mib: float) -> None:
        monkeypatch.setattr(
            "aug3d_core.factory.disk_estimate.shutil.disk_usage", lambda _: SimpleNamespace(free=int(mib * MIB))
        )

    return set_free


@pytest.mark.parametrize(
    ("photos", "wrote_mib", "most_mib"),  # what real runs of tiny wrote, and the most they may have needed meanwhile
    [(None, 420, 640), (120, 892, 1270), (18, 254, 395)],  # the town; ochota; brighton in 3 folds
)
def test_a_first_run_needs_less_than_estimated(
    photos: int | None, wrote_mib: int, most_mib: int, tmp_path: Path
) -> None:
    given = material(tmp_path / "photos", photos) if photos else Material()
    assert most_mib < first_run_bytes(given, TINY) / MIB < 6 * wrote_mib


def test_the_estimate_of_a_first_run_grows_with_photographs_folds_and_settings(tmp_path: Path) -> None:
    few, many = material(tmp_path / "few", 100), material(tmp_path / "many", 1000)
    fixed = 512 * MIB
    assert 9 < (first_run_bytes(many, TINY) - fixed) / (first_run_bytes(few, TINY) - fixed) < 10
    for setting in ("depth.max_px=1024", "photos.max_px=4096", "grouping.folds=4", "sampling.domes=5000"):
        assert first_run_bytes(few, scene_config("tiny", [setting])) > 1.5 * first_run_bytes(few, TINY), setting


def test_a_scene_made_before_needs_twice_what_its_missing_steps_wrote(
    tmp_path: Path, free_mib: Callable[[float], None]
) -> None:
    store, before = Store(tmp_path / "home"), version(1000 * MIB)
    plan = [(step, None if step.name in ("training", "evaluation") else before[step.name])
            for step in steps(FROM_TOWN, {})]  # fmt: skip
    free_mib(2 * 2 * 1000 + 65)
    check_room(store, "demo", Material(), TINY, before, plan)
    free_mib(2 * 2 * 1000 + 63)
    with pytest.raises(StoreError, match=r"may need 4\.0 GiB"):
        check_room(store, "demo", Material(), TINY, before, plan)


def test_later_folds_count_as_the_first_did(tmp_path: Path, free_mib: Callable[[float], None]) -> None:
    store, before = Store(tmp_path / "home"), version(1000 * MIB)
    training = next(stage for stage in FROM_TOWN if stage.name == "training")
    plan = [(Step(training, fold), None) for fold in range(3)]
    free_mib(2 * 3 * 1000 + 63)
    with pytest.raises(StoreError):
        check_room(store, "demo", Material(), TINY, before, plan)
    free_mib(2 * 3 * 1000 + 65)
    check_room(store, "demo", Material(), TINY, before, plan)


def test_a_step_that_was_never_made_is_a_first_run(tmp_path: Path, free_mib: Callable[[float], None]) -> None:
    free_mib(first_run_bytes(Material(), TINY) / MIB + 63)
    before = version(1)
    del before["training"]
    with pytest.raises(StoreError):
        check_room(Store(tmp_path / "home"), "demo", Material(), TINY, before, nothing_made(Material()))


def test_photographs_that_cannot_be_read_are_left_to_their_stage(tmp_path: Path) -> None:
    gone = Material(photos=tmp_path / "gone")
    check_room(Store(tmp_path / "home"), "demo", gone, TINY, {}, nothing_made(gone))


def test_a_run_that_cannot_fit_names_the_figures_the_disk_and_what_to_do(small_disk: Callable[[int], Path]) -> None:
    disk = small_disk(900)
    store, plan = Store(disk), nothing_made(Material())
    with pytest.raises(StoreError) as caught:
        check_room(store, "demo", Material(), TINY, {}, plan)
    assert str(disk) in caught.value.problem and "900 MiB are free" in caught.value.problem
    assert "may need 1.3 GiB" in caught.value.problem
    assert all(way in caught.value.remedy for way in ("aug3d gc", "--home", "smaller preset"))
    smaller = scene_config("tiny", ["depth.max_px=192"])
    check_room(store, "demo", Material(), smaller, {}, plan)
    with (disk / "something").open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, 400 * MIB)
    with pytest.raises(StoreError, match="500 MiB are free"):
        check_room(store, "demo", Material(), smaller, {}, plan)


def test_a_run_that_writes_nothing_needs_no_room(small_disk: Callable[[int], Path]) -> None:
    made = version(10**12)
    plan = [(Step(stage), made[stage.name]) for stage in FROM_TOWN]
    check_room(Store(small_disk(1)), "demo", Material(), TINY, made, plan)
