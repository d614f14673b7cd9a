"""A study on stand-in stages: what is made, what is found again, what fails, and what is said of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from aug3d_core.judging.summary import CHEAP
from aug3d_core.run.errors import StoreError, UsageError
from aug3d_core.store import layout
from aug3d_core.store.scenes import new_version, write_metrics
from aug3d_core.store.store import Store
from aug3d_core.studies.common.write import write_study
from aug3d_core.studies.paper.arm import PaperTable, nothing_more
from aug3d_core.studies.paper.augmentation import augmentation_table
from aug3d_core.studies.paper.cell import PaperResult
from aug3d_core.studies.paper.effort import study_effort
from aug3d_core.studies.paper.findings import PaperFindings, as_json, findings
from aug3d_core.studies.paper.grouping import grouping_table
from aug3d_core.studies.paper.page import publication
from aug3d_core.studies.paper.rows import cheap_answers
from aug3d_core.studies.paper.scene import open_finished
from aug3d_core.studies.paper.scores import score_table
from aug3d_core.studies.paper.tables import judged, make_table
from tests.stand_in_stages import Made, fold_of
from tests.studies.paper.stand_in import Stages, finished_scene

SEEDS = 2


@pytest.fixture
def stages() -> Stages:
    return Stages()


def run(stages: Stages, home: Path, study: PaperTable, *overrides: str) -> tuple[PaperFindings, list[PaperResult]]:
    store = finished_scene(home) if not (home / layout.SCENES).exists() else Store(home)
    scene = study_effort(open_finished(store, "little", None), False, overrides)
    results = make_table(store, study, scene, SEEDS, stages.maker(store), lambda *_: None)
    return findings(study, scene, SEEDS, results, "a machine"), results


def some(study: PaperTable, *keys: str) -> PaperTable:
    """Return a study of a few of its arms: what is tested does not hang on how many there are."""
    return replace(study, arms=tuple(arm for arm in study.arms if arm.name in keys), then=nothing_more)


@pytest.mark.parametrize("done", [0, 5])
def test_a_run_that_ended_early_does_not_stand_for_the_scene(done: int, tmp_path: Path) -> None:
    store = finished_scene(tmp_path, folds=2)
    whole = open_finished(store, "little", None)
    objects = {step: {"stage": record.stage, "key": record.key} for step, record in [*whole.records.items()][:done]}
    early = {"scene": "little", "preset": "paper", "state": "failed", "objects": objects, "paths": {}}
    write_metrics(new_version(store, "little"), early)
    assert open_finished(store, "little", None) == whole


def test_a_study_leaves_nothing_open(tmp_path: Path) -> None:
    store = finished_scene(tmp_path)
    assert open_finished(store, "little", None).settings.auto == ()
    with pytest.raises(UsageError, match="--preset auto has nothing to decide"):
        open_finished(store, "little", "auto")


def test_every_cell_is_made_and_nothing_is_made_twice(stages: Stages, tmp_path: Path) -> None:
    found, results = run(stages, tmp_path, grouping_table(False))
    assert len(results) == SEEDS * (15 + 3) and found.failed == 0
    assert stages.computed.count("grouping") == 15, "seeds and input views share the groups"
    assert stages.computed.count("training") == SEEDS * (15 + 2), "three inputs of the best were trained before"
    assert not {"sfm", "depth", "surface", "sampling", "rendering"} & set(stages.computed)
    stages.computed.clear()
    again, _ = run(stages, tmp_path, grouping_table(False))
    assert stages.computed == [] and as_json(again) == as_json(found)


def test_a_killed_study_goes_on(stages: Stages, tmp_path: Path) -> None:
    def kill(stage: str, made: Made) -> str:
        if stage == "training" and stages.computed.count("training") == 5:
            raise KeyboardInterrupt
        return ""

    stages.fails = kill
    with pytest.raises(KeyboardInterrupt):
        run(stages, tmp_path, grouping_table(True))
    stages.fails = lambda stage, made: ""
    run(stages, tmp_path, grouping_table(True))
    assert stages.computed.count("training") == SEEDS * (4 + 1)


def test_virtual_views_are_as_many_as_asked_and_shared_by_seeds(stages: Stages, tmp_path: Path) -> None:
    found, _ = run(stages, tmp_path, augmentation_table(False))
    rows = {row.arm.name: row for row in found.rows}
    assert stages.computed.count("rendering") == 9 + 3, "three ways at three K, and three shares that are new"
    assert rows["real, K 10"].virtual_views == 0 and rows["real + grid, K auto"].virtual_views == 32
    assert [rows[f"{share} % virtual"].virtual_views for share in (0, 25, 50, 100, 200)] == [0, 8, 16, 24, 48]


def test_orderings_come_out_as_the_scores_were_made(stages: Stages, tmp_path: Path) -> None:
    tested = {t.ordering.claim: t.verdict for t in run(stages, tmp_path, grouping_table(False))[0].orderings}
    assert tested["Groups by shared points are better than those by sequence, grid or ray (K 20)"] == "holds"
    assert tested["Groups by seen surface are better than those by shared points (K 20)"] == "does not hold"
    assert tested["K 10 is better than K 20 (shared)"] == "holds"
    assert tested["3 input views are better than 9"] == "not decided", "they were made alike"


def test_groups_that_cannot_be_made_are_a_row_that_says_why(stages: Stages, tmp_path: Path) -> None:
    study = some(grouping_table(False), "shared, K 20", "shared, K 10")
    too_large = replace(study.arms[0], settings=(*study.arms[0].settings, "grouping.k=40"))
    found, _ = run(stages, tmp_path, replace(study, arms=(too_large, study.arms[1])))
    row = next(row for row in found.rows if row.arm.name == "shared, K 20")
    assert (row.failed, row.runs, row.average) == (SEEDS, SEEDS, None)
    assert row.notes == ("failed: no groups of 40: there are only 30 training views",)
    claim = next(t for t in found.orderings if t.ordering.claim.startswith("K 10 is better than K 20 (shared)"))
    assert claim.verdict == "not decided" and claim.differences[0].mean is None


def test_a_run_that_fails_or_gives_no_number_is_told_and_the_rest_goes_on(stages: Stages, tmp_path: Path) -> None:
    def diverge(stage: str, made: Made) -> str:
        lost = stage == "training" and made["grouping"]["method"] == "ray" and made["training"]["seed"] == 1
        return "refused: training diverged" if lost else ""

    def score(made: Made, photo: int) -> float:
        return np.nan if made["grouping"]["method"] == "grid" and photo == 33 else 20.0 + photo / 10

    stages.fails, stages.score = diverge, score
    found, _ = run(stages, tmp_path, some(grouping_table(False), "shared, K 10", "ray, K 10", "grid, K 10"))
    rows = {row.arm.name: row for row in found.rows}
    ray, grid = rows["ray, K 10"], rows["grid, K 10"]
    assert (ray.failed, ray.runs) == (1, SEEDS) and ray.average is not None and "diverged" in ray.notes[0]
    assert (grid.failed, grid.average) == (SEEDS, None) and "no PSNR for 1 photos" in grid.notes[0]
    folder = write_study(Store(tmp_path), publication(found))
    page = (folder / layout.STUDY_PAGE).read_text()
    assert "diverged" in page and "no PSNR for 1 photos" in page
    assert "NaN" not in (folder / layout.STUDY_FINDINGS).read_text()


def test_a_full_disk_ends_the_study(stages: Stages, tmp_path: Path) -> None:
    stages.fails = lambda stage, made: "disk: no space left" if stage == "training" else ""
    with pytest.raises(StoreError, match="no space left"):
        run(stages, tmp_path, grouping_table(True))


def test_another_split_than_the_scenes_own_is_refused(stages: Stages, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"another test than scene 'little'.*\n.*test_share"):
        run(stages, tmp_path, grouping_table(True), "grouping.test_share=0.4")


def test_cells_that_were_tested_on_other_photographs_are_never_compared(stages: Stages, tmp_path: Path) -> None:
    _, results = run(stages, tmp_path, grouping_table(True))
    score_table(results)
    moved = results[1].views.assign(photo_id=results[1].views["photo_id"] + 1)
    with pytest.raises(AssertionError, match="different tests"):
        score_table([results[0], replace(results[1], views=moved)])


def test_every_fold_of_a_small_scene_is_tested(stages: Stages, tmp_path: Path) -> None:
    store = finished_scene(tmp_path, folds=3)
    scene = study_effort(open_finished(store, "little", None), False, ())
    results = make_table(store, grouping_table(True), scene, 1, stages.maker(store), lambda *_: None)
    found = findings(grouping_table(True), scene, 1, results, "a machine")
    assert found.test_photos == 3 * 4 and {result.cell.fold for result in results} == {0, 1, 2}


def test_an_arm_is_scored_by_the_seeds_that_have_a_score_in_every_fold(stages: Stages, tmp_path: Path) -> None:
    def fail(stage: str, made: Made) -> str:
        if stage != "training" or fold_of(made) == 0:
            return ""
        lost = {"ray": (0, 1), "grid": (1,)}.get(made["grouping"]["method"], ())
        return "refused: training diverged" if made["training"]["seed"] in lost else ""

    stages.fails = fail
    stages.score = lambda made, photo: 20.0 + 10 * fold_of(made) + made["training"]["seed"]
    finished_scene(tmp_path, folds=2)
    found, results = run(stages, tmp_path, some(grouping_table(False), "shared, K 10", "ray, K 10", "grid, K 10"))
    rows = {row.arm.name: row for row in found.rows}
    shared, ray, grid = rows["shared, K 10"], rows["ray, K 10"], rows["grid, K 10"]
    assert (shared.average, shared.seeds) == (25.5, (25.0, 26.0))
    assert (grid.average, grid.best, grid.seeds, grid.failed) == (25.0, 30.0, (25.0,), 1)
    assert (ray.average, ray.best, ray.low, ray.ssim, ray.seeds, ray.failed) == (None, None, None, None, (), 2)
    assert "fold 1 failed" in ray.notes[0]
    assert {arm: psnr for arm, (psnr, _) in judged(results).items()} == {"shared, K 10": 25.5, "grid, K 10": 25.0}
    folder = write_study(Store(tmp_path), publication(found))
    assert "NaN" not in (folder / layout.STUDY_FINDINGS).read_text()


def test_cheap_answers_are_told_of_every_fold_alike() -> None:
    rows = [
        {"arm": arm, "seed": 0, "fold": fold, "photo_id": fold, "input_views": 3, "psnr": 20.0}
        | {f"{name}_psnr": 10.0 * (1 + fold) for name in CHEAP}
        for arm, fold in (("a", 0), ("a", 1), ("b", 0))
    ]
    assert cheap_answers(pd.DataFrame(rows)) == {3: dict.fromkeys(CHEAP, 15.0)}


def test_effort_is_the_same_in_every_run_and_less_than_the_presets(stages: Stages, tmp_path: Path) -> None:
    found, results = run(stages, tmp_path, grouping_table(True), "training.head.features=8")
    configs = [dict(result.records["training"].config) for result in results]
    for config in configs:
        for name in ("seed", "input_views"):
            config.pop(name)
    assert all(config == configs[0] for config in configs)
    assert configs[0]["head"]["features"] == 8 and configs[0]["steps"] == found.effort["steps"] < 1000
    assert configs[0]["least_gain_db"] == 0, "no arm ends before another"


def test_what_is_written_can_be_read_by_programs(stages: Stages, tmp_path: Path) -> None:
    found, results = run(stages, tmp_path, augmentation_table(True))
    folder = write_study(Store(tmp_path), publication(found))
    told = json.loads((folder / layout.STUDY_FINDINGS).read_text())
    assert {arm["arm"] for arm in told["arms"]} == {row.arm.name for row in found.rows}
    assert len(told["cells"]) == len(results) and all(cell["psnr"] for cell in told["cells"])
    scores = pd.read_parquet(folder / layout.STUDY_SCORES)
    assert len(scores) == 4 * len(results)
    for row in found.rows:
        assert row.average == pytest.approx(scores[scores["arm"] == row.arm.name]["psnr"].mean())
    page = (folder / layout.STUDY_PAGE).read_text()
    assert "http" not in page and "data:image" in page, "one page that needs no network"


def test_a_scene_without_what_a_study_needs_is_refused(tmp_path: Path) -> None:
    store = finished_scene(tmp_path)
    for record in (tmp_path / "objects" / "surface").glob("*/record.json"):
        record.unlink()
    with pytest.raises(UsageError, match="scene 'little' has no surface"):
        open_finished(store, "little", None)
