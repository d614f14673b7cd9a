"""A study finds the front, the cheapest that is enough and what auto loses; it goes on where it was, and says what failed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from aug3d_core.factory.config import scene_config
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.retention import plan
from aug3d_core.store.store import Store
from aug3d_core.store.usage import studies
from aug3d_core.studies.common.write import write_study
from aug3d_core.studies.tradeoff.arm import FACTORY
from aug3d_core.studies.tradeoff.findings import against_best, as_json, crashes, search_against_grid, table
from aug3d_core.studies.tradeoff.page import publication
from aug3d_core.studies.tradeoff.point import Point, below, on_front
from aug3d_core.studies.tradeoff.scene import open_studied
from aug3d_core.studies.tradeoff.search import Search
from aug3d_core.studies.tradeoff.setting import AS_THE_PAPER
from aug3d_core.studies.tradeoff.study import TradeoffFindings, study_scene
from tests.stand_in_stages import Made
from tests.studies.tradeoff.stand_in import Stages


def studied(
    stages: Stages,
    home: Path,
    quick: bool = True,
    seeds: int = 1,
    only: Sequence[str] = (),
    **more: float | bool | None,
) -> TradeoffFindings:
    scene = open_studied(Store(home), "demo", None)
    target, search = more.get("target_db"), bool(more.get("search_only"))
    return study_scene(
        Store(home), scene, quick, seeds, target, search, stages.maker(Store(home)), lambda *_: None, only
    )


def test_the_cheapest_that_is_enough_is_on_the_front_and_the_search_ends_at_it(
    stages: Stages, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aug3d_core.studies.tradeoff.study.setting_arms", lambda *_: [])
    found = studied(stages, tmp_path, quick=False, seeds=2)
    assert found.best is not None and found.chosen is not None and found.target_db is not None
    assert found.best.accuracy == pytest.approx(22.005) and found.target_db == pytest.approx(21.705)
    assert found.chosen.arm in [point.arm for point in on_front(found.factory)]
    assert "photos.max_px 320" in found.chosen.arm.label and "features" not in found.chosen.arm.label
    assert found.search is not None and found.search.reached is not None
    assert found.search.reached.psnr_db >= found.target_db
    judged = search_against_grid(found)
    assert judged["search_regret_db"] is not None and judged["search_regret_db"] <= 0.2
    assert regret_of(found, 30.0) == 0, "what ends above the grid's choice is not below it"
    assert regret_of(found, 20.0) == pytest.approx(regret_of(found, 20.5) + 0.5) and regret_of(found, 20.5) > 1
    repeated = {point.arm.label: len(point.results) for point in found.factory}
    assert repeated[found.best.arm.label] == repeated[found.chosen.arm.label] == 2 > min(repeated.values())
    assert not any(stages.grew), "no time is flattered by what earlier runs made"


def regret_of(found: TradeoffFindings, psnr_db: float) -> float:
    """Return how far the search of a study is told to be below the grid if it ends at so many dB."""
    assert found.search is not None and found.search.found is not None
    ended = found.search.found
    other = Search(found.search.target_db, [replace(ended, tried=replace(ended.tried, psnr_db=psnr_db))])
    regret = search_against_grid(replace(found, search=other))["search_regret_db"]
    assert regret is not None
    return regret


def test_repeats_are_made_where_seeds_matter(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path, quick=False, seeds=2, only=("mapper", "render samples"))
    repeats = {
        panel: {len(p.results) for p in found.points if p.arm.panel == panel} for panel in ("mapper", "render samples")
    }
    assert repeats == {"mapper": {1}, "render samples": {2}}


def test_a_scene_in_folds_is_judged_and_paid_for_over_all_of_them(stages: Stages, tmp_path: Path) -> None:
    stages.folds, stages.test_of = 2, lambda made: (1, 2, 3) if made["grouping"]["fold"] == 0 else (4,)
    found = studied(stages, tmp_path)
    own = next(point for point in found.factory if point.arm.mark == "preset")
    [first], [second] = ([own.results[0].held_out[f"photo {n}.jpg"] for n in some] for some in ((1,), (4,)))
    assert found.test_photos == 4 and second == pytest.approx(first - 1), "the stand-in's second fold is harder"
    assert own.accuracy == pytest.approx((3 * first + second) / 4), "every photograph counts alike"
    costs = own.results[0].costs
    assert costs["training"] == pytest.approx(2 * 350 / 20) and costs["matching"] == 75.0
    assert found.search is not None and found.search.trials[0].tried.training_s >= costs["training"] / 9
    assert len(as_json(found, "m")["decisions"]) == 1


def test_what_fails_in_one_fold_has_failed(stages: Stages, tmp_path: Path) -> None:
    stages.folds = 2
    stages.fails = lambda stage, made: (
        "engine: no"
        if stage == "training" and made["grouping"]["fold"] and made["training"]["head"]["features"] == 8
        else ""
    )
    found = studied(stages, tmp_path)
    narrow = [result for result in found.results if "training.head.features=8" in result.arm.settings]
    assert narrow and all(result.trial.failure and result.accuracy is None for result in narrow)


def test_times_are_those_of_the_stages_that_users_pay_for(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path)
    own = next(point for point in found.factory if point.arm.mark == "preset")
    costs = own.results[0].costs
    assert not {"town", "truth", "mesh_truth"} & set(costs) and costs["matching"] == 75.0
    assert own.cpu_seconds == pytest.approx(sum(costs.values())) and own.results[0].seconds * 2 == own.cpu_seconds


def test_auto_is_held_against_the_best(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path)
    judged = against_best(found)
    assert [one["field"] for one in as_json(found, "here")["decisions"]] == ["photos.max_px"]
    assert judged["auto_regret_db"] == pytest.approx(0.0) and judged["auto_time_ratio"] == pytest.approx(1.0)


def test_auto_is_held_against_the_best_on_the_photographs_that_both_were_judged_on(
    stages: Stages, tmp_path: Path
) -> None:
    found = studied(stages, tmp_path)
    assert found.auto is not None and found.best is not None
    auto, best = found.auto.results[0], found.best.results[0]
    moved = Point(found.auto.arm, (replace(auto, held_out={"b": 20.0, "c": 21.0, "d": 22.0, "e": 22.0, "z": 99.0}),))
    held = Point(found.best.arm, (replace(best, held_out={"a": 1.0, "b": 20.5, "c": 21.0, "d": 23.0, "e": 22.5}),))
    shared = below(moved, held)
    assert shared is not None and shared.db == pytest.approx(0.5)
    assert below(Point(moved.arm, (replace(auto, held_out={"y": 20.0}),)), held) is None
    alike = below(*(Point(moved.arm, (replace(auto, held_out={"a": psnr}),)) for psnr in (20.0, 21.0)))
    assert alike is not None and alike.db == pytest.approx(1.0), "the same test, however small"
    assert found.test_photos == 4


def test_chosen_panels_are_made_alone_and_told(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path, quick=False, only=["preset PAPER", "domes"], target_db=1.0)
    assert found.in_part
    assert {point.arm.panel for point in found.points} == {AS_THE_PAPER.name, "domes of virtual views"}
    assert found.best is None and found.search is None and found.auto is None
    page = (write_study(Store(tmp_path), publication(found, "here")) / layout.STUDY_PAGE).read_text()
    assert "as the scene has it" in page and "groups_per_step" in page and "has a score" not in page
    with pytest.raises(UsageError, match="no panel 'faces'"):
        studied(stages, tmp_path, only=["render", "faces"])


def test_a_look_at_some_panels_or_a_search_alone_does_not_take_the_place_of_the_whole_study(
    stages: Stages, tmp_path: Path
) -> None:
    whole = studied(stages, tmp_path)
    parts = (whole, replace(whole, in_part=True), replace(whole, searched_only=True), replace(whole, quick=False))
    assert len({publication(part, "here").about for part in parts}) == len(parts)


def test_what_was_judged_on_other_photographs_beats_nobody(stages: Stages, tmp_path: Path) -> None:
    stages.test_of = lambda made: (5, 6, 7) if made["training"]["head"]["planes"] == 16 else (1, 2, 3, 4)
    found = studied(stages, tmp_path)
    odd = [point for point in found.factory if not point.comparable]
    assert odd and all("planes 16" in point.arm.label for point in odd)
    assert not set(map(id, odd)) & set(map(id, on_front(found.factory)))


def test_a_search_goes_on_where_the_scenes_own_first_run_failed(stages: Stages, tmp_path: Path) -> None:
    own = open_studied(Store(tmp_path), "demo", None).config()

    def fail(stage: str, made: Made) -> str:
        if stage != "training" or made["training"]["seed"]:
            return ""
        as_it_is = made["training"]["head"] == own.training.head.model_dump(mode="json")
        return "crash: signal 11" if as_it_is and made["photos"]["max_px"] == own.photos.max_px else ""

    stages.fails = fail
    found = studied(stages, tmp_path, seeds=2, target_db=15.0)
    first, *_ = [result for result in found.results if result.arm.panel == FACTORY and result.arm.mark == "preset"]
    assert first.trial.failure and found.search is not None and found.search.reached is not None


def test_what_a_run_has_grown_is_not_taken_for_what_it_costs(stages: Stages, tmp_path: Path) -> None:
    stages.grown_from = 40
    found = studied(stages, tmp_path)
    assert {result.trial.records["sfm"].metrics["grown_from"] for result in found.results} == {0}
    assert len({result.trial.records["sfm"].key for result in found.results}) == stages.computed.count("sfm") / 2


def test_a_second_study_makes_nothing_again_and_says_so(stages: Stages, tmp_path: Path) -> None:
    studied(stages, tmp_path)
    stages.computed.clear()
    found = studied(stages, tmp_path)
    state = as_json(found, "here")["cache"]
    assert not stages.computed and state["found_made"] == state["outputs"] > 0


def test_settings_that_are_refused_are_a_result_and_crashes_are_counted(stages: Stages, tmp_path: Path) -> None:
    def fail(stage: str, made: Made) -> str:
        if stage == "matching" and made["matching"]["max_features"] == 512:
            return "refused: too few features"
        return "crash: signal 11" if stage == "training" and made["training"]["head"]["features"] == 8 else ""

    stages.fails = fail
    found = studied(stages, tmp_path)
    told = as_json(found, "here")
    assert told["crashes"] == crashes(found) > 0 and told["failed_runs"] > crashes(found)
    assert "features" not in told["best"]["label"], "what crashed is not the best"
    rows = table(found)
    assert set(rows.loc[rows["accuracy"].isna(), "cause"]) == {"refused", "crash"}


def test_a_full_disk_ends_the_study(stages: Stages, tmp_path: Path) -> None:
    stages.fails = lambda stage, made: "disk: no space left" if stage == "depth" else ""
    with pytest.raises(StoreError, match="no space left"):
        studied(stages, tmp_path)


def test_where_nothing_has_a_score_there_is_nothing_to_choose(stages: Stages, tmp_path: Path) -> None:
    stages.fails = lambda stage, made: "refused: no" if stage == "training" else ""
    found = studied(stages, tmp_path)
    assert found.best is None and found.chosen is None and found.search is None
    assert set(against_best(found).values()) | set(search_against_grid(found).values()) == {None}
    write_study(Store(tmp_path), publication(found, "here"))


def test_a_search_alone_tries_less_and_takes_a_target(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path, quick=False, search_only=True, target_db=21.0)
    assert {point.arm.panel for point in found.points} == {FACTORY}
    assert found.search is not None and found.search.reached is not None
    assert found.search.reached.psnr_db >= 21.0 and len(found.factory) < 48 / 2
    assert studied(stages, tmp_path, search_only=True).target_db == pytest.approx(20 + 1 + 1 / 20 - 0.2)


def test_a_search_alone_holds_auto_against_the_scene_s_own_with_every_seed(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path, search_only=True, seeds=3)
    assert {p.arm.mark: len(p.results) for p in found.whole if p.arm.mark} == {"preset": 3, "auto": 3}
    assert all(len(p.results) == 1 for p in found.whole if not p.arm.mark), "what the search tries, it tries once"


def test_repeats_are_counted_from_the_scene_s_own_seed(stages: Stages, tmp_path: Path) -> None:
    scene = open_studied(Store(tmp_path), "demo", None).with_settings(["training.seed=2"])
    found = study_scene(Store(tmp_path), scene, True, 3, None, True, stages.maker(Store(tmp_path)), lambda *_: None)
    for point in (point for point in found.whole if point.arm.mark):
        trained = [result.trial.records["training"].config["seed"] for result in point.results]
        assert sorted(trained) == [2, 3, 4]


def test_the_folder_holds_data_chart_and_a_page_that_needs_no_network(stages: Stages, tmp_path: Path) -> None:
    store = Store(tmp_path)
    found = studied(stages, tmp_path)
    folder = write_study(store, publication(found, "a machine & more"))
    names = {layout.STUDY_FINDINGS, layout.STUDY_SCORES, layout.STUDY_CHART, layout.STUDY_PAGE, layout.STUDY_PART}
    assert {path.name for path in folder.iterdir()} == names
    rows = pd.read_parquet(folder / layout.STUDY_SCORES)
    assert len(rows) == len(found.results) and {"cpu_seconds_training", "on_front", "chosen"} <= set(rows.columns)
    page = (folder / layout.STUDY_PAGE).read_text()
    assert 'src="http' not in page and "a machine &amp; more" in page and "as the scene has it" in page
    held = studies(store)[0]
    used = {(r.stage, r.key) for result in found.results for r in result.trial.records.values()}
    assert held.folder == folder and held.objects == used, "gc keeps what it used"


def test_what_a_study_of_a_scene_in_folds_used_is_kept(stages: Stages, tmp_path: Path) -> None:
    stages.folds = 2
    store = Store(tmp_path)
    write_study(store, publication(studied(stages, tmp_path), "here"))
    [held] = studies(store)
    assert all(store.object_dir(*item).is_dir() for item in held.objects)
    assert {stage for stage, _ in held.objects} >= {"training", "evaluation"} and plan(store, 1, 0.0).goes == ()


def test_what_stands_out_is_repeated_until_nothing_does_by_luck(
    stages: Stages, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aug3d_core.studies.tradeoff.study.setting_arms", lambda *_: [])
    stages.luck_db = 5.0  # with the first seed alone, the fewer steps the more
    found = studied(stages, tmp_path, quick=False, seeds=3)
    assert found.best is not None and found.chosen is not None
    assert all(len(point.results) == 3 for point in (found.best, found.chosen, *on_front(found.factory)))
    assert found.best.accuracy == pytest.approx(20 + 1 + 1 + 0.01), "all that was better by luck was found out"


def test_pictures_of_several_sizes_are_compared_by_what_they_gain(stages: Stages, tmp_path: Path) -> None:
    found = studied(stages, tmp_path, quick=False, only=["size of pictures"])
    assert len(found.points) == 3 and all(point.comparable and point.gain is not None for point in found.points)


def test_a_value_beyond_its_bounds_is_refused_and_told(stages: Stages, tmp_path: Path) -> None:
    scene = open_studied(Store(tmp_path), "demo", None).with_settings(["matching.max_features=512"])
    found = study_scene(
        Store(tmp_path),
        scene,
        False,
        1,
        None,
        False,
        stages.maker(Store(tmp_path)),
        lambda *_: None,
        ["features per photograph"],
    )
    [quarter] = [result for result in found.results if result.accuracy is None]
    assert quarter.trial.cause == "refused" and "128" in quarter.trial.failure and not crashes(found)
    page = (write_study(Store(tmp_path), publication(found, "here")) / layout.STUDY_PAGE).read_text()
    assert "matching.max_features" in page


def test_a_quick_look_is_at_a_small_town_unless_the_user_says_how_large(stages: Stages, tmp_path: Path) -> None:
    town = studied(stages, tmp_path).scene.config().town
    assert (
        town.width_px < scene_config("tiny").town.width_px
        and studied(stages, tmp_path, quick=False).scene.config().town != town
    )
    scene = open_studied(Store(tmp_path), "demo", None).with_settings(["town.length_m=99"])
    looked = study_scene(Store(tmp_path), scene, True, 1, None, False, stages.maker(Store(tmp_path)), lambda *_: None)
    assert looked.scene.config().town == town.model_copy(update={"length_m": 99})


def test_a_quick_look_makes_one_fold_unless_the_user_says_how_many(stages: Stages, tmp_path: Path) -> None:
    assert studied(stages, tmp_path).scene.config().grouping.folds == 1
    assert studied(stages, tmp_path, quick=False).scene.config().grouping.folds is None
    scene = open_studied(Store(tmp_path), "demo", None).with_settings(["grouping.folds=2"])
    looked = study_scene(Store(tmp_path), scene, True, 1, None, False, stages.maker(Store(tmp_path)), lambda *_: None)
    assert looked.scene.config().grouping.folds == 2


@pytest.mark.parametrize("target_db", [math.nan, math.inf, -1.0, 1e9])
def test_a_target_that_is_no_psnr_is_refused_before_anything_is_made(
    stages: Stages, tmp_path: Path, target_db: float
) -> None:
    with pytest.raises(UsageError, match="is no PSNR"):
        studied(stages, tmp_path, target_db=target_db)
    assert not stages.computed
