"""A run that does not fit into the memory or on the disk is refused beforehand, and a setting is named with which it would."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from aug3d_core.factory.build import Built
from aug3d_core.factory.config import AUTO, SceneConfig, overridden, scene_config
from aug3d_core.factory.estimate.estimate import estimate_of
from aug3d_core.factory.estimate.room import check_room, needed_bytes
from aug3d_core.factory.estimate.size import size_of
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import Step, steps
from aug3d_core.factory.stages import FROM_PHOTOS, FROM_TOWN
from aug3d_core.factory.walk import Visit
from aug3d_core.run.errors import Aug3dError, StoreError, TooLarge
from aug3d_core.run.limits import LIMIT_MEMORY
from aug3d_core.store.record import FileEntry, Record
from aug3d_core.store.store import Store

TINY = scene_config("tiny")
MIB = 2**20


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "home")


def material(folder: Path, photos: int) -> Material:
    folder.mkdir(exist_ok=True)
    for i in range(photos):
        (folder / f"{i}.jpg").touch()
    return Material(photos=folder)


def stages_of(given: Material) -> Sequence[Step]:
    return list(steps(FROM_PHOTOS if given.photos else FROM_TOWN, {}))


def nothing_made(given: Material) -> list[Visit]:
    return [Visit(step) for step in stages_of(given)]


def record(stage: str, size_bytes: int, config: SceneConfig = TINY) -> Record:
    return Record(
        stage=stage, key="k", digest="d", recipe="r", config=getattr(config, stage).model_dump(), inputs={}, versions={},
        files={"all": FileEntry(sha256="", size_bytes=size_bytes, mtime_ns=0)},
        metrics={"photos": 60, "megapixels_median": 0.3072, "with_gps": 60},
        state="ok", notes=(), series={}, pictures={}, seconds=1.0, peak_mib=1.0,
    )  # fmt: skip


def version(size_bytes: int, config: SceneConfig = TINY) -> dict[str, Record]:
    """Return the records of an earlier version, each of the same size."""
    return {stage.name: record(stage.name, size_bytes, config) for stage in FROM_TOWN}


def made_again(before: dict[str, Record], *names: str) -> list[Visit]:
    """Return the plan of a run in which only these steps are missing."""
    return [
        Visit(step) if step.name in names else Visit(step, None, Built(before[step.name], cached=True))
        for step in steps(FROM_TOWN, {})
    ]


@pytest.fixture
def free_mib(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    def set_free(mib: float) -> None:
        monkeypatch.setattr(
            "aug3d_core.factory.estimate.room.shutil.disk_usage", lambda _: SimpleNamespace(free=int(mib * MIB))
        )

    return set_free


def first_run_mib(store: Store, given: Material, config: SceneConfig = TINY) -> float:
    return needed_bytes(store, given, config, {}, stages_of(given)) / MIB


@pytest.mark.parametrize(
    ("photos", "wrote_mib", "most_mib"),  # what real runs of tiny wrote, and the most they may have needed meanwhile
    [(None, 420, 640), (120, 892, 1270), (18, 254, 395)],  # the town; ochota; brighton in 3 folds
)
def test_a_first_run_needs_less_than_estimated(
    photos: int | None, wrote_mib: int, most_mib: int, tmp_path: Path, store: Store
) -> None:
    given = material(tmp_path / "photos", photos) if photos else Material()
    assert most_mib < first_run_mib(store, given) < 6 * wrote_mib


def test_what_a_first_run_writes_grows_with_photographs_folds_and_settings(tmp_path: Path, store: Store) -> None:
    few, many = material(tmp_path / "few", 100), material(tmp_path / "many", 1000)
    assert 8 < first_run_mib(store, many) / first_run_mib(store, few) < 16
    for setting in ("depth.max_px=1024", "photos.max_px=4096", "grouping.folds=4"):
        assert first_run_mib(store, few, overridden(TINY, [setting])) > 1.4 * first_run_mib(store, few), setting


def test_a_scene_made_before_needs_twice_what_its_missing_steps_wrote(
    store: Store, free_mib: Callable[[float], None]
) -> None:
    before = version(1000 * MIB)
    plan = made_again(before, "training", "evaluation")
    free_mib(2 * 2 * 1000 + 65)
    check_room(store, "demo", Material(), TINY, before, plan)
    free_mib(2 * 2 * 1000 + 63)
    with pytest.raises(StoreError, match=r"may need 4\.0 GiB"):
        check_room(store, "demo", Material(), TINY, before, plan)


def wrote_by_law(given: Material, times: int = 1) -> dict[str, Record]:
    """Return the records of a version of which each step wrote what its law says, or some times as much."""
    costs = estimate_of(TINY, size_of(given, TINY, {}))
    return {stage: record(stage, round(times * costs[stage].disk_mib.likely * MIB)) for stage in costs}


@pytest.mark.parametrize(
    "changes", [(), ("town.max_photos=45",), ("town.max_photos=200",), ("depth.max_px=256",), ("dataset.width_px=512",)]
)
def test_a_scene_made_before_needs_as_many_times_more_as_it_has_grown(store: Store, changes: tuple[str, ...]) -> None:
    before, config = wrote_by_law(Material()), overridden(TINY, ["town.max_photos=60", *changes])
    costs = estimate_of(config, size_of(Material(), config, {}))
    stages = stages_of(Material())
    need_mib = needed_bytes(store, Material(), config, before, stages) / MIB
    assert need_mib - 64 == pytest.approx(2 * sum(costs[step.name].disk_mib.likely for step in stages), rel=1e-3)


@pytest.mark.parametrize("domes", [16, 0])  # none are likely
def test_what_auto_decided_last_time_counts_where_it_is_still_open(domes: int, store: Store) -> None:
    auto = scene_config(AUTO)
    before = version(1000 * MIB, overridden(auto, [f"sampling.domes={domes}"]))
    needed = needed_bytes(store, Material(), auto, before, stages_of(Material()))
    assert needed == pytest.approx((2 * 1000 * len(before) + 64) * MIB)
    coarser = overridden(auto, ["depth.max_px=128"])
    depth = [step for step in stages_of(Material()) if step.name == "depth"]
    assert needed_bytes(store, Material(), coarser, before, depth) < 300 * MIB, "what is set is no more open"


def test_a_step_that_wrote_nothing_tells_nothing_of_one_that_has_to(store: Store) -> None:
    rendering = [step for step in stages_of(Material()) if step.name == "rendering"]
    before = version(1)
    idle = {**before["sampling"].config, "domes": 0}
    before["sampling"] = before["sampling"].model_copy(update={"config": idle})
    assert needed_bytes(store, Material(), TINY, before, rendering) == needed_bytes(
        store, Material(), TINY, {}, rendering
    )


def test_a_version_that_tells_no_size_or_other_settings_counts_as_none(store: Store) -> None:
    stages = stages_of(Material())
    first = needed_bytes(store, Material(), TINY, {}, stages)
    before = version(1)
    assert needed_bytes(store, Material(), TINY, {"town": before["town"]}, stages) == first
    before["depth"] = before["depth"].model_copy(update={"config": {"of": "long ago"}})
    assert needed_bytes(store, Material(), TINY, before, stages) == first


def test_the_setting_that_is_named_makes_a_scene_fit_that_was_made_before(
    store: Store, free_mib: Callable[[float], None]
) -> None:
    before, plan = wrote_by_law(Material(), 3), nothing_made(Material())
    free_mib(1.05 * needed_bytes(store, Material(), TINY, before, stages_of(Material())) / MIB)
    check_room(store, "demo", Material(), TINY, before, plan)
    finer = overridden(TINY, ["depth.max_px=1024"])
    with pytest.raises(StoreError) as caught:
        check_room(store, "demo", Material(), finer, before, plan)
    check_room(store, "demo", Material(), named_setting(caught.value, finer), before, plan)


def test_later_folds_count_as_the_first_did(store: Store, free_mib: Callable[[float], None]) -> None:
    before = version(1000 * MIB)
    training = next(stage for stage in FROM_TOWN if stage.name == "training")
    plan = [Visit(Step(training, fold)) for fold in range(3)]
    free_mib(2 * 3 * 1000 + 63)
    with pytest.raises(StoreError):
        check_room(store, "demo", Material(), TINY, before, plan)
    free_mib(2 * 3 * 1000 + 65)
    check_room(store, "demo", Material(), TINY, before, plan)


def test_a_step_that_was_never_made_is_estimated(store: Store, free_mib: Callable[[float], None]) -> None:
    before = version(1 * MIB)
    free_mib(2 * len(before) + 65)
    check_room(store, "demo", Material(), TINY, before, nothing_made(Material()))
    del before["depth"]
    with pytest.raises(StoreError):
        check_room(store, "demo", Material(), TINY, before, nothing_made(Material()))


def test_photographs_that_cannot_be_read_are_left_to_their_stage(tmp_path: Path, store: Store) -> None:
    gone = Material(photos=tmp_path / "gone")
    check_room(store, "demo", gone, TINY, {}, nothing_made(gone))
    assert needed_bytes(store, gone, TINY, {}, stages_of(gone)) == 0


def named_setting(error: Aug3dError, config: SceneConfig = TINY) -> SceneConfig:
    """Return the settings with the one changed that an error names."""
    return overridden(config, [error.remedy.partition("--set ")[2].partition(",")[0].split()[0]])


def test_a_run_without_disk_names_the_figures_the_disk_and_what_to_do(small_disk: Callable[[int], Path]) -> None:
    disk = small_disk(700)
    store, plan = Store(disk), nothing_made(Material())
    with pytest.raises(StoreError) as caught:
        check_room(store, "demo", Material(), TINY, {}, plan)
    assert str(disk) in caught.value.problem and "700 MiB are free" in caught.value.problem
    assert all(way in caught.value.remedy for way in ("aug3d gc", "--home", "--set depth.max_px="))
    smaller = named_setting(caught.value)
    check_room(store, "demo", Material(), smaller, {}, plan)
    with (disk / "something").open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, 600 * MIB)
    with pytest.raises(StoreError, match="100 MiB are free"):
        check_room(store, "demo", Material(), smaller, {}, plan)


def test_a_run_that_writes_nothing_needs_no_room(small_disk: Callable[[int], Path]) -> None:
    made = version(10**12)
    check_room(Store(small_disk(1)), "demo", Material(), TINY, made, made_again(made))


def test_a_stage_that_cannot_have_enough_memory_is_refused_with_a_setting_that_helps(
    tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch, free_mib: Callable[[float], None]
) -> None:
    free_mib(10**7)
    given = material(tmp_path / "photos", 500)
    large = scene_config("tiny", ["depth.max_px=4096", "photos.max_px=4096"])
    monkeypatch.setenv(LIMIT_MEMORY, "3.3")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})  # matching takes more memory on more cores
    with pytest.raises(TooLarge) as caught:
        check_room(store, "city", given, large, {}, nothing_made(given))
    assert "of scene 'city' needs" in caught.value.problem and "3.3 GiB" in caught.value.problem
    assert "--set photos.max_px=" in caught.value.remedy and LIMIT_MEMORY in caught.value.remedy
    path, value = caught.value.remedy.partition("--set ")[2].partition(",")[0].split("=")
    check_room(store, "city", given, overridden(large, [f"{path}={value}"]), {}, nothing_made(given))


def test_textures_are_made_coarser_where_nothing_else_helps(
    tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch, free_mib: Callable[[float], None]
) -> None:
    free_mib(10**7)
    given = material(tmp_path / "photos", 500)
    fine = scene_config("tiny", ["depth.max_px=2048", "photos.max_px=2048"])
    monkeypatch.setenv(LIMIT_MEMORY, "2.8")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    with pytest.raises(TooLarge, match="stage surface") as caught:
        check_room(store, "city", given, fine, {}, nothing_made(given))
    assert "--set surface.texel_budget=" in caught.value.remedy
    check_room(store, "city", given, named_setting(caught.value, fine), {}, nothing_made(given))


def test_what_is_merely_likely_to_need_too_much_memory_is_not_refused(
    tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = material(tmp_path / "photos", 60)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})  # on more cores two meshes are drawn side by side
    monkeypatch.setenv(LIMIT_MEMORY, "0.8")  # 1 GiB is likely
    check_room(store, "s", given, TINY, {}, nothing_made(given))
    monkeypatch.setenv(LIMIT_MEMORY, "0.3")
    with pytest.raises(TooLarge):
        check_room(store, "s", given, TINY, {}, nothing_made(given))


def test_memory_of_stages_that_are_made_counts_no_more(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT_MEMORY, "0.4")
    before = version(1)
    check_room(store, "demo", Material(), TINY, before, made_again(before, "grouping"))
    with pytest.raises(TooLarge, match="stage surface"):
        check_room(store, "demo", Material(), TINY, before, made_again(before, "surface"))
