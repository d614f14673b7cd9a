"""What a run will take grows as the scene does, costs nothing where all is there, and follows what the machine has made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from aug3d_core.depth.cameras import depth_sizes
from aug3d_core.factory.build import Built
from aug3d_core.factory.config import AUTO, SceneConfig, scene_config
from aug3d_core.factory.estimate import calibration
from aug3d_core.factory.estimate.calibration import (
    REFERENCE,
    Calibration,
    Sample,
    calibration_by,
    calibration_of,
    samples_of_records,
)
from aug3d_core.factory.estimate.cost import Cost, Range
from aug3d_core.factory.estimate.estimate import estimate_of, estimate_plan, in_folds
from aug3d_core.factory.estimate.laws import LAWS, scene_here
from aug3d_core.factory.estimate.likely import likely_settings
from aug3d_core.factory.estimate.size import SceneSize, size_of
from aug3d_core.factory.material import Material
from aug3d_core.factory.plan import steps
from aug3d_core.factory.stages import FROM_TOWN, STAGES
from aug3d_core.factory.walk import Visit, planned
from aug3d_core.geometry.views import Views
from aug3d_core.heads.config import names
from aug3d_core.photos.files import PHOTO_IMAGES
from aug3d_core.store.record import FileEntry, Record
from aug3d_core.store.seal import sealed
from aug3d_core.store.store import Store

TINY = scene_config("tiny")
TOWN = SceneSize(60, 640 * 480)
MIB = 2**20


def likely(
    config: SceneConfig, size: SceneSize, stage: str, calibrated: Calibration = REFERENCE, cores: int | None = None
) -> Cost:
    return estimate_of(config, size, calibrated, cores)[stage]


def photographs(count: int, px: float = 1024 * 768) -> SceneSize:
    return SceneSize(count, px)


def test_every_stage_of_a_run_has_a_law() -> None:
    runs = {stage.name for stage in STAGES.values() if stage.presets} | {stage.name for stage in FROM_TOWN}
    assert runs <= set(LAWS)


@pytest.mark.parametrize("preset", ["tiny", "small", "paper"])
@pytest.mark.parametrize("photos", [3, 60, 2000])
def test_every_figure_is_a_range_above_nothing(preset: str, photos: int) -> None:
    for stage, cost in estimate_of(scene_config(preset), photographs(photos)).items():
        for one in (cost.seconds, cost.peak_mib, cost.disk_mib):
            assert 0 < one.low < one.likely < one.high, stage


@pytest.mark.parametrize("stage", ["town", "photos", "matching", "depth"])
def test_twice_the_photographs_take_about_twice_the_time(stage: str) -> None:
    one, two = (likely(TINY, photographs(count), stage).seconds.likely for count in (200, 400))
    assert 1.8 < two / one < 2.1


def test_mapping_takes_more_than_twice_as_long_for_twice_the_photographs() -> None:
    one, two = (likely(TINY, photographs(count), "sfm").seconds.likely for count in (200, 400))
    assert 2.2 < two / one < 4


def test_what_is_looked_at_without_gps_grows_with_the_photographs_not_with_their_pairs() -> None:
    few, many = (likely(TINY, SceneSize(photos, 1e6, gps=False), "matching").seconds.likely for photos in (1000, 4000))
    assert many < 4.2 * few
    assert few > likely(TINY, SceneSize(1000, 1e6), "matching").seconds.likely * 0.8


@pytest.mark.parametrize(
    ("smaller", "stage"),
    [
        ("photos.max_px=512", "photos"), ("photos.max_px=512", "matching"), ("photos.max_px=512", "sfm"),
        ("photos.max_px=400", "depth"), ("matching.max_features=1024", "matching"), ("matching.first_octave=0", "matching"),
        ("depth.max_px=256", "depth"), ("depth.max_px=256", "surface"), ("depth.plane_step_px=4", "depth"),
        ("surface.texel_gsd=2", "surface"), ("sampling.domes=4", "rendering"), ("sampling.domes=0", "rendering"),
        ("rendering.samples=2", "rendering"), ("training.steps=50", "training"), ("training.head.planes=16", "training"),
        ("training.input_views=2", "training"), ("evaluation.flythrough_frames=0", "evaluation"),
    ],
)  # fmt: skip
def test_a_smaller_setting_makes_its_stage_cheaper_and_none_dearer(smaller: str, stage: str) -> None:
    size, changed = photographs(100), scene_config("tiny", [smaller])
    before, after = estimate_of(TINY, size), estimate_of(changed, size)
    assert after[stage].seconds.likely < before[stage].seconds.likely
    for name, cost in after.items():
        for figure in ("seconds", "peak_mib", "disk_mib"):
            assert getattr(cost, figure).likely <= getattr(before[name], figure).likely, (name, figure)


@pytest.mark.parametrize("head", names())
def test_each_head_takes_time_by_its_steps(head: str) -> None:
    one, two = (
        likely(scene_config("tiny", [f"training.head={head}", f"training.steps={n}"]), TOWN, "training")
        for n in (1000, 2000)
    )
    assert 1.5 < two.seconds.likely / one.seconds.likely < 2.1
    assert two.peak_mib == one.peak_mib


def test_more_cores_take_no_longer_and_what_runs_on_one_gains_nothing() -> None:
    two, eight = estimate_of(TINY, TOWN, cores=2), estimate_of(TINY, TOWN, cores=8)
    assert all(eight[stage].seconds.likely <= two[stage].seconds.likely for stage in two)
    assert eight["sfm"].seconds == two["sfm"].seconds
    assert eight["depth"].seconds.likely < 0.5 * two["depth"].seconds.likely


@pytest.mark.parametrize(
    # Records that the laws were not fitted on: `make demo` as docs/presets.md has it, one core of another processor
    ("stage", "processor_s", "peak_mib"),
    [
        ("town", 108, 850), ("matching", 54, 419), ("sfm", 28, 351), ("depth", 86, 647), ("surface", 75, 990),
        ("rendering", 33, 407), ("dataset", 4, 449),
    ],
)  # fmt: skip
def test_a_machine_of_another_kind_is_within_the_range(stage: str, processor_s: float, peak_mib: float) -> None:
    faster = Calibration(slowness=0.65)  # by all stages but this one
    cost = likely(TINY, TOWN, stage, faster, cores=1)
    assert cost.seconds.low < processor_s < cost.seconds.high
    assert cost.peak_mib.low < peak_mib < cost.peak_mib.high


def record(stage: str, seconds: float, metrics: Mapping[str, Any] | None = None, config: SceneConfig = TINY) -> Record:
    return Record(
        stage=stage, key=f"{stage}{seconds}", digest="d", recipe="r", config=getattr(config, stage).model_dump(),
        inputs={}, versions={}, files={"all": FileEntry(sha256="", size_bytes=10 * MIB, mtime_ns=0)},
        metrics=dict(metrics or {}), state="ok", notes=(), series={}, pictures={}, seconds=seconds, peak_mib=500.0,
    )  # fmt: skip


READ = {"photos": 60, "megapixels_median": 0.3072, "with_gps": 60}


def made_in(seconds: float, config: SceneConfig = TINY, **metrics: float) -> dict[str, Record]:
    """Return the records of a scene of 60 photographs, each of which took as long."""
    return {stage.name: record(stage.name, seconds, {**READ, **metrics}, config) for stage in FROM_TOWN}


def test_what_a_home_has_made_is_estimated_as_it_was() -> None:
    records = made_in(77.0)
    known = calibration_by(list(samples_of_records(records)))
    assert f"{len(FROM_TOWN)} stages that this machine made" in known.told
    for stage in records:
        cost = likely(TINY, TOWN, stage, known)
        assert cost.seconds.likely == pytest.approx(77) and cost.seconds.low > 77 / 1.5 and cost.seconds.high < 77 * 1.5
        assert cost.peak_mib.likely == pytest.approx(500) and cost.disk_mib.likely == pytest.approx(10)


def test_records_of_one_size_tell_of_others_by_the_law() -> None:
    known = calibration_by(list(samples_of_records(made_in(77.0))))
    double = likely(TINY, SceneSize(120, TOWN.photo_px), "depth", known).seconds
    assert 1.8 * 77 < double.likely < 2.1 * 77
    far = likely(TINY, SceneSize(2000, TOWN.photo_px), "depth", known).seconds
    assert far.high / far.low > 1.2 * double.high / double.low


def test_records_narrow_the_range() -> None:
    known = calibration_by(list(samples_of_records(made_in(77.0))))
    for one, other in ((known, REFERENCE),):
        narrow, wide = (likely(TINY, TOWN, "depth", each).seconds for each in (one, other))
        assert narrow.high / narrow.low < wide.high / wide.low


def test_the_newest_records_count_and_their_median() -> None:
    took = (10.0, 12.0, 50.0, 1000.0, 1000.0)  # newest first
    samples = [sample for seconds in took for sample in samples_of_records(made_in(seconds))]
    assert likely(TINY, TOWN, "depth", calibration_by(samples)).seconds.likely == pytest.approx(12)


def test_what_grew_from_an_earlier_result_tells_nothing() -> None:
    samples = [*samples_of_records(made_in(1.0, grown_from=50)), *samples_of_records(made_in(77.0))]
    assert likely(TINY, TOWN, "sfm", calibration_by(samples)).seconds.likely == pytest.approx(77)


def test_a_stage_that_was_never_made_here_is_as_the_others_are() -> None:
    samples = [sample for sample in samples_of_records(made_in(77.0)) if sample.record.stage != "training"]
    slower = [
        Sample(sample.record.model_copy(update={"seconds": 2 * sample.record.seconds}), sample.config, sample.size)
        for sample in samples
    ]
    one, two = (likely(TINY, TOWN, "training", calibration_by(each)).seconds.likely for each in (samples, slower))
    assert two == pytest.approx(2 * one)


def test_a_machine_that_has_made_nothing_is_measured_by_a_fixed_work(monkeypatch: pytest.MonkeyPatch) -> None:
    for factor in (1, 3):
        monkeypatch.setattr(calibration, "fixed_work_s", lambda factor=factor: factor * calibration._REFERENCE_S)
        known = calibration_by([])
        assert "of calibration" in known.told
        for stage, cost in estimate_of(TINY, TOWN, known).items():
            assert cost.seconds.likely == pytest.approx(factor * likely(TINY, TOWN, stage).seconds.likely)
            assert cost.peak_mib == likely(TINY, TOWN, stage).peak_mib


def test_the_fixed_work_takes_a_moment() -> None:
    assert 0.001 < calibration.fixed_work_s() < 10


def test_nobody_waits_for_it_where_no_times_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "fixed_work_s", lambda: pytest.fail("it was done"))
    calibration_by([], timed=False)


def test_a_home_with_damaged_versions_counts_as_one_without(tmp_path: Path) -> None:
    store = Store(tmp_path)
    version = tmp_path / "scenes" / "hill" / "2026-01-01"
    version.mkdir(parents=True)
    (version / "metrics.json").write_text("{")
    assert calibration_of(store, timed=False).of_stages == {}


def visits(made: Mapping[str, Record]) -> list[Visit]:
    return [
        Visit(step, None, Built(made[step.name], cached=True) if step.name in made else None)
        for step in steps(FROM_TOWN, {})
    ]


def test_steps_that_are_there_take_nothing(tmp_path: Path) -> None:
    made = made_in(1.0, folds=1)
    store = Store(tmp_path)
    all_there = estimate_plan(store, Material(), TINY, visits(made))
    assert set(all_there.steps.values()) == {None} and all_there.total.seconds == Range(0, 0, 0)
    one = estimate_plan(store, Material(), TINY, visits({k: v for k, v in made.items() if k != "depth"}))
    assert [name for name, cost in one.steps.items() if cost] == ["depth"]
    assert one.total == one.steps["depth"]


def test_all_together_is_the_sum_of_times_and_disk_and_the_largest_memory(tmp_path: Path) -> None:
    found = estimate_plan(Store(tmp_path), Material(), TINY, visits({}))
    costs = [cost for cost in found.steps.values() if cost]
    assert found.total.seconds.likely == pytest.approx(sum(cost.seconds.likely for cost in costs))
    assert found.total.disk_mib.high == pytest.approx(sum(cost.disk_mib.high for cost in costs))
    assert found.total.peak_mib.likely == max(cost.peak_mib.likely for cost in costs)


@pytest.mark.parametrize(
    ("photos", "overrides", "folds"),
    [(20, (), 2), (38, (), 2), (40, (), 1), (60, (), 1), (60, ("grouping.folds=4",), 4)],
)
def test_all_together_counts_the_folds_that_are_likely(photos: int, overrides: tuple[str, ...], folds: int) -> None:
    config = scene_config("tiny", overrides)
    missing = list(steps(FROM_TOWN, {}))
    counted = [step.name for step in in_folds(missing, config, photographs(photos))]
    assert len([name for name in counted if name.startswith("training")]) == folds
    assert len([name for name in counted if name.startswith("matching")]) == 1
    late = [
        step for step in missing if step.name in ("training", "evaluation")
    ]  # the split is made: its folds are known
    assert in_folds(late, config, photographs(photos)) == late


@pytest.fixture
def of_size(tmp_path: Path) -> Callable[..., Material]:
    def make(count: int, width: int, height: int) -> Material:
        folder = tmp_path / f"{count}-{width}"
        folder.mkdir()
        for i in range(count):
            Image.new("RGB", (width, height)).save(folder / f"{i}.jpg")
        return Material(photos=folder)

    return make


def test_the_size_of_a_folder_is_read_from_a_few_headers(of_size: Callable[..., Material]) -> None:
    given = of_size(50, 320, 240)
    assert size_of(given, TINY, {}) == SceneSize(50, 320 * 240, gps=False)
    assert given.photos
    for i in range(50):
        if i % 3:
            (given.photos / f"{i}.jpg").write_bytes(b"no picture")
    assert size_of(given, TINY, {}).photos == 50


@pytest.mark.parametrize("max_px", [256, 512, 900, 4000])
@pytest.mark.parametrize("size", [(1024, 768), (768, 1024), (1024, 576), (1024, 1024)])
def test_depth_maps_are_as_large_as_their_stage_makes_them(size: tuple[int, int], max_px: int) -> None:
    views = Views(np.arange(1), np.eye(4)[None, :3], np.ones((1, 4)), np.array([size]))
    width, height = size  # as photographs of four times the size are worked on
    given = SceneSize(60, 16.0 * width * height, aspect=width / height)
    scene = scene_here(scene_config("tiny", [f"depth.max_px={max_px}"]), given)
    expected = depth_sizes(views, max_px)[0]
    assert scene.depth_mpx * 1e6 == pytest.approx(expected.prod(), rel=3e-3)
    assert scene.planes == pytest.approx(38 * expected.max() / 512, rel=3e-3), "by the side along which most is seen"


def test_photographs_that_stand_upright_are_known_by_their_headers_and_by_their_copies(
    of_size: Callable[..., Material], tmp_path: Path
) -> None:
    store, aspect = Store(tmp_path / "home"), 240 / 320
    assert size_of(of_size(3, 240, 320), TINY, {}) == SceneSize(3, 320 * 240, gps=False, aspect=aspect)
    file = FileEntry(sha256="", size_bytes=1, mtime_ns=0)
    read = record("photos", 1.0, READ).model_copy(update={"files": {f"{PHOTO_IMAGES}/{i}.png": file for i in range(4)}})
    (store.place(read) / PHOTO_IMAGES).mkdir(parents=True)
    assert size_of(Material(), TINY, {"photos": read}, store).aspect == 4 / 3, "none of them is here"
    for i in range(3):
        Image.new("RGB", (240, 320)).save(store.place(read) / PHOTO_IMAGES / f"{i}.png")
    assert size_of(Material(), TINY, {"photos": read}, store).aspect == aspect
    assert {sample.size.aspect for sample in samples_of_records(made_in(1.0) | {"photos": read}, store)} == {aspect}


def test_texels_are_likely_as_large_as_upright_photographs_make_them(tmp_path: Path) -> None:
    store, auto = Store(tmp_path), scene_config(AUTO, ["photos.max_px=1024"])
    plan = list(planned(store, Material(), auto))
    lying, upright = (
        likely_settings(auto, SceneSize(60, 12e6, aspect=aspect), plan, store, Material()).surface.texel_gsd
        for aspect in (4 / 3, 3 / 4)
    )
    assert (lying, upright) == (1.6, 1.2)


def test_the_size_of_the_town_follows_from_its_settings() -> None:
    assert size_of(Material(), TINY, {}) == SceneSize(60, 640 * 480)
    fewer = scene_config("tiny", ["town.max_photos=15", "town.width_px=320", "town.gps=false"])
    assert size_of(Material(), fewer, {}) == SceneSize(15, 320 * 240, gps=False)


def test_what_was_read_says_how_many_photographs_there_are() -> None:
    read = record("photos", 1.0, {**READ, "photos": 55, "with_gps": 0})
    assert size_of(Material(), TINY, {"photos": read}) == SceneSize(55, 307_200, gps=False)


def test_open_settings_count_as_they_will_likely_be_and_widen_the_range(tmp_path: Path) -> None:
    store, auto = Store(tmp_path), scene_config(AUTO)
    plan = list(planned(store, Material(), auto))
    chosen = likely_settings(auto, TOWN, plan, store, Material())
    # What `auto` chose for the town of 60 photographs: docs/presets.md, aug3d_core/factory/auto
    assert chosen.matching.first_octave == 0 and chosen.sampling.domes == 0
    assert 100 <= chosen.training.steps <= 170 and chosen.training.least_gain_db == 0
    found = estimate_plan(store, Material(), auto, plan)
    usual = estimate_plan(store, Material(), TINY, list(planned(store, Material(), TINY)))
    assert "training.steps" in found.open_fields and not usual.open_fields
    assert found.total.seconds.likely < 0.9 * usual.total.seconds.likely
    spread, narrow = (one.total.seconds.high / one.total.seconds.low for one in (found, usual))
    assert spread > 1.5 * narrow


def test_a_setting_that_is_made_by_hand_is_not_open(tmp_path: Path) -> None:
    store, auto = Store(tmp_path), scene_config(AUTO, ["training.steps=5000"])
    plan = list(planned(store, Material(), auto))
    chosen = likely_settings(auto, TOWN, plan, store, Material())
    assert chosen.training.steps == 5000 and "training.steps" not in chosen.auto


def test_a_step_whose_settings_are_decided_has_those(tmp_path: Path) -> None:
    store, auto = Store(tmp_path), scene_config(AUTO)
    plan = list(planned(store, Material(), auto))
    decided = replace(plan[1], work=replace(plan[0].work, config=TINY.photos)) if plan[0].work else plan[1]
    chosen = likely_settings(auto, TOWN, [plan[0], decided, *plan[2:]], store, Material())
    assert chosen.photos == TINY.photos and "photos.max_px" not in chosen.auto


def test_a_stage_that_had_nothing_to_do_tells_nothing_of_one_that_has() -> None:
    nothing = scene_config("tiny", ["sampling.domes=0"])
    known = calibration_by(list(samples_of_records(made_in(5.0, nothing))))  # 10 times what the law says
    assert likely(nothing, TOWN, "rendering", known).seconds.likely == pytest.approx(5)
    law = likely(TINY, TOWN, "rendering").seconds.likely
    assert likely(TINY, TOWN, "rendering", known).seconds.likely == pytest.approx(law * known.slowness)


def test_records_of_the_likest_size_count() -> None:
    small, large = (scene_config("tiny", [f"depth.max_px={px}"]) for px in (160, 640))
    newer = [sample for _ in range(3) for sample in samples_of_records(made_in(400.0, large))]
    known = calibration_by([*newer, *samples_of_records(made_in(9.0, small))])
    assert likely(small, TOWN, "depth", known).seconds.likely == pytest.approx(9)
    assert likely(large, TOWN, "depth", known).seconds.likely == pytest.approx(400)


def write_version(store: Store, records: Mapping[str, Record], path: Path, cached: tuple[str, ...] = ()) -> None:
    """Write a version that is made of such objects, and says that it lies at a path."""
    version = store.root / "scenes" / "hill" / "2026-01-01"
    version.mkdir(parents=True)
    objects = {}
    for step, one in records.items():
        work = store.work_dir(one.stage, one.key)
        work.mkdir(parents=True)
        (work / "job.json").write_text("{}")
        (work / "log.txt").touch()
        (work / "files").mkdir(exist_ok=True)
        given = one.model_dump(exclude={"stage", "key", "digest", "files"})
        objects[step] = {"stage": one.stage, "key": store.commit(work, one.stage, one.key, given).key}
    metrics = {
        "scene": "hill", "paths": {"metrics": str(path)}, "objects": objects,
        "stages": {step: {"cached": step in cached} for step in records},
    }  # fmt: skip
    (version / "metrics.json").write_bytes(sealed(metrics))


def test_a_home_tells_by_its_versions(tmp_path: Path) -> None:
    store = Store(tmp_path / "home")
    write_version(store, made_in(77.0), store.root / "scenes" / "hill" / "2026-01-01" / "metrics.json")
    known = calibration_of(store)
    assert likely(TINY, TOWN, "surface", known).seconds.likely == pytest.approx(77)
    found = estimate_plan(store, Material(), TINY, visits({}))
    assert found.told == known.told == f"from {len(FROM_TOWN)} stages that this machine made"


def test_what_other_machines_made_tells_nothing_of_this_one(tmp_path: Path, shared: str) -> None:
    own, others = Store(tmp_path / "own"), Store(tmp_path / "others")
    records = made_in(77.0)
    write_version(own, records, own.root / "scenes" / "hill" / "2026-01-01" / "metrics.json", cached=("town", "photos"))
    assert set(calibration_of(own, timed=False).of_stages) == set(records) - {"town", "photos"}
    write_version(others, records, Path("/elsewhere/metrics.json"))
    assert calibration_of(others, timed=False).of_stages == {}
