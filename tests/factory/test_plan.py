"""A run in folds: which steps there are, what they are called, and what each of them reads."""

from __future__ import annotations

import pytest

from aug3d_core.factory.config import scene_config
from aug3d_core.factory.plan import Step, fold_count, later_folds, seen_from, stage_of, steps
from aug3d_core.factory.stages import FROM_MODEL, FROM_PHOTOS, FROM_TOWN, GROUPING, STAGES
from aug3d_core.store.record import Record


def record(stage: str, **metrics: float) -> Record:
    values = {"stage": stage, "key": stage, "digest": "d", "recipe": "r", "config": {}, "inputs": {}, "versions": {}}
    more = {"files": {}, "metrics": metrics, "state": "ok", "notes": (), "series": {}, "pictures": {}}
    return Record.model_validate(values | more | {"seconds": 1.0, "peak_mib": 1.0})


@pytest.mark.parametrize("stages", [FROM_PHOTOS, FROM_TOWN, FROM_MODEL])
def test_one_fold_is_the_list_of_stages(stages: tuple) -> None:
    assert [step.name for step in steps(stages, {"grouping": record("grouping", folds=1)})] == [s.name for s in stages]
    assert [step.name for step in steps(stages, {})] == [s.name for s in stages]


def test_folds_repeat_what_reads_the_split_and_nothing_else() -> None:
    names = [step.name for step in steps(FROM_TOWN, {"grouping": record("grouping", folds=3)})]
    later = [stage.name for stage in FROM_TOWN[FROM_TOWN.index(GROUPING) :]]
    assert names == [s.name for s in FROM_TOWN] + [f"{name}_fold{fold}" for fold in (1, 2) for name in later]
    assert {stage_of(name) for name in names} == set(FROM_TOWN)


def test_the_folds_are_counted_when_the_split_is_made() -> None:
    records: dict[str, Record] = {}
    seen = []
    for step in steps(FROM_PHOTOS, records):
        assert step.name not in records
        seen.append(step.name)
        records[step.name] = record(step.stage.name, **({"folds": 2} if step.name == "grouping" else {}))
    assert seen[-1] == "evaluation_fold1"
    assert fold_count(records) == 2 and len(later_folds(FROM_PHOTOS, records)) == len(seen) - len(FROM_PHOTOS)


def test_each_step_reads_its_own_fold_and_what_the_folds_share() -> None:
    records = {step.name: record(step.name) for step in steps(FROM_PHOTOS, {"grouping": record("grouping", folds=2)})}
    seen = seen_from(Step(STAGES["surface"], 1), FROM_PHOTOS, records)
    assert {name: seen[name].stage for name in ("sfm", "grouping", "depth")} == {
        "sfm": "sfm", "grouping": "grouping_fold1", "depth": "depth_fold1",
    }  # fmt: skip
    del records["depth_fold1"]
    assert "depth" not in seen_from(Step(STAGES["surface"], 1), FROM_PHOTOS, records), "never another fold's"
    assert seen_from(Step(STAGES["surface"]), FROM_PHOTOS, records)["depth"].stage == "depth"


def test_only_the_split_is_told_its_fold() -> None:
    config = scene_config("tiny", ["grouping.fold=3"])
    assert [Step(GROUPING, fold).in_fold(config.grouping).model_dump()["fold"] for fold in (0, 2)] == [0, 2]
    assert Step(STAGES["depth"], 2).in_fold(config.depth) == config.depth
