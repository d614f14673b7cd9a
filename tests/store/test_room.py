"""What a run will write is told beforehand: never less than real runs wrote, and not many times as much."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aug3d_core.errors import StoreError
from aug3d_core.folds import Step, steps
from aug3d_core.make import Material
from aug3d_core.scene_config import SceneConfig, scene_config
from aug3d_core.stages import FROM_PHOTOS, FROM_TOWN
from aug3d_core.store.record import FileEntry, Record
from aug3d_core.store.room import bytes_to_write, check_room
from aug3d_core.store.store import Store

# MiB that real runs of the preset tiny wrote, stage by stage: the town, 120 photographs of ochota, 18 of brighton in 3 folds
WROTE = {
    "town": {
        "town": 22.5, "photos": 34.8, "matching": 54.4, "sfm": 50.0, "depth": 211.8, "surface": 30.6, "mesh_truth": 1.3,
        "overlap": 1.7, "rendering": 4.6, "dataset": 5.2, "training": 0.9, "evaluation": 1.8,
    },
    "ochota": {
        "photos": 142.8, "matching": 122.4, "sfm": 176.4, "depth": 369.2, "surface": 66.4, "overlap": 2.3,
        "rendering": 2.6, "dataset": 4.9, "training": 0.9, "evaluation": 2.1,
    },
    "brighton": {
        "photos": 20.8, "matching": 16.1, "sfm": 22.7, "depth": 137.3, "surface": 39.6, "overlap": 3.9,
        "rendering": 3.8, "dataset": 5.2, "training": 2.8, "evaluation": 1.8,
    },
}  # fmt: skip
PHOTOS = {"town": 60, "ochota": 120, "brighton": 18}
TINY = scene_config("tiny")


def material(folder: Path, photos: int) -> Material:
    folder.mkdir(exist_ok=True)
    for i in range(photos):
        (folder / f"{i}.jpg").touch()
    return Material(photos=folder)


def nothing_made(given: Material) -> list[tuple[Step, Record | None]]:
    return [(step, None) for step in steps(FROM_PHOTOS if given.photos else FROM_TOWN, {})]


def record(stage: str, config: SceneConfig, size_bytes: int = 0, **metrics: int) -> Record:
    return Record(
        stage=stage, key="k", digest="d", recipe="r", config=getattr(config, stage).model_dump(), inputs={}, versions={},
        files={"all": FileEntry(sha256="", size_bytes=size_bytes, mtime_ns=0)}, metrics=dict(metrics), state="ok", notes=(),
        series={}, pictures={}, seconds=1.0, peak_mib=1.0,
    )  # fmt: skip


def version(photos: int, size_bytes: int, config: SceneConfig = TINY) -> dict[str, Record]:
    """Return what an earlier version is made of, the same bytes in every stage."""
    made = {stage.name: record(stage.name, config, size_bytes) for stage in FROM_PHOTOS}
    return made | {"photos": record("photos", config, size_bytes, photos=photos)}


@pytest.mark.parametrize("scene", WROTE)
def test_the_rules_hold_for_real_runs(scene: str, tmp_path: Path) -> None:
    given = Material() if scene == "town" else material(tmp_path / "photos", PHOTOS[scene])
    told = {s: size / 2**20 for s, size in bytes_to_write(given, TINY, {}, nothing_made(given)).items()}
    for stage, wrote in WROTE[scene].items():
        assert wrote <= told[stage], stage
        assert told[stage] < 1.7 * wrote or told[stage] - wrote < 30, stage
    assert sum(told.values()) < 2 * sum(WROTE[scene].values())


def test_a_scene_that_did_not_change_writes_what_it_wrote(tmp_path: Path) -> None:
    given = material(tmp_path / "photos", 60)
    told = bytes_to_write(given, TINY, version(60, 10**6), nothing_made(given))
    assert set(told.values()) == {10**6} and len(told) == len(FROM_PHOTOS)


def test_only_what_is_not_in_the_store_counts(tmp_path: Path) -> None:
    given = material(tmp_path / "photos", 60)
    before = version(60, 10**6)
    plan = [
        (step, None if step.name in ("training", "evaluation") else before[step.name])
        for step in steps(FROM_PHOTOS, {})
    ]
    assert bytes_to_write(given, TINY, before, plan) == {"training": 10**6, "evaluation": 10**6}
    assert bytes_to_write(given, TINY, before, [(step, before[step.name]) for step, _ in plan]) == {}


@given(more=st.integers(2, 20))
def test_more_photographs_write_in_proportion(more: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    given = material(tmp_path_factory.mktemp("scene") / "photos", 50 * more)
    told = bytes_to_write(given, TINY, version(50, 10**9), nothing_made(given))
    for stage in ("photos", "matching", "sfm", "depth"):
        assert 0.7 * more < told[stage] / 10**9 <= more, stage
    assert told["evaluation"] == 10**9


def test_settings_that_changed_since_count(tmp_path: Path) -> None:
    given = material(tmp_path / "photos", 60)
    told = bytes_to_write(given, scene_config("tiny", ["depth.max_px=1024"]), version(60, 10**9), nothing_made(given))
    assert 3.5 < told["depth"] / 10**9 <= 4
    assert told["sfm"] == 10**9


def test_a_small_scene_is_counted_in_its_folds(tmp_path: Path) -> None:
    given = material(tmp_path / "photos", 18)
    one = bytes_to_write(given, scene_config("tiny", ["grouping.folds=1"]), {}, nothing_made(given))
    own = bytes_to_write(given, TINY, {}, nothing_made(given))
    six = bytes_to_write(given, scene_config("tiny", ["grouping.folds=6"]), {}, nothing_made(given))
    assert own["depth"] == 3 * one["depth"] and six["depth"] == 6 * one["depth"]
    assert own["sfm"] == six["sfm"] == one["sfm"]


def test_folds_that_are_known_count_once_each(tmp_path: Path) -> None:
    given = material(tmp_path / "photos", 18)
    split = record("grouping", TINY, folds=3)  # of the first fold: the others were not made when the run was killed
    plan = [(s, split if s.name == "grouping" else None) for s in steps(FROM_PHOTOS, {"grouping": split})]
    told = bytes_to_write(given, TINY, {}, plan)
    unknown = bytes_to_write(given, TINY, {}, nothing_made(given))
    assert {stage: told[stage] for stage in ("depth", "training")} == {s: unknown[s] for s in ("depth", "training")}


def test_photographs_that_cannot_be_read_are_left_to_their_stage(tmp_path: Path) -> None:
    gone = Material(photos=tmp_path / "gone")
    check_room(Store(tmp_path / "home"), "demo", gone, TINY, {}, nothing_made(gone))


def test_a_run_that_cannot_fit_is_told_with_the_figures_the_disk_and_what_to_do(
    small_disk: Callable[[int], Path],
) -> None:
    disk = small_disk(600)
    store, plan = Store(disk), nothing_made(Material())
    with pytest.raises(StoreError) as caught:
        check_room(store, "demo", Material(), TINY, {}, plan)
    assert str(disk) in caught.value.problem and "600 MiB are free" in caught.value.problem
    assert "needs about 817 MiB" in caught.value.problem and "depth (243 MiB)" in caught.value.problem
    assert all(way in caught.value.remedy for way in ("aug3d gc", "--home", "smaller preset"))
    smaller = scene_config("tiny", ["depth.max_px=256"])
    check_room(store, "demo", Material(), smaller, {}, plan)
    with (disk / "something").open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, 400 * 2**20)
    with pytest.raises(StoreError, match="200 MiB are free"):
        check_room(store, "demo", Material(), smaller, {}, plan)


def test_a_run_that_writes_nothing_needs_no_room(small_disk: Callable[[int], Path]) -> None:
    made: Mapping[str, Record] = version(60, 10**12) | {"town": record("town", TINY, photos=60)}
    plan = [(Step(stage), made[stage.name]) for stage in FROM_PHOTOS]
    check_room(Store(small_disk(1)), "demo", Material(), TINY, made, plan)
