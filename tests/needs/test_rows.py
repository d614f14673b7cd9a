from __future__ import annotations

from pathlib import Path

import numpy as np
from charts.made_up_run import record

from aug3d_core.folds import Step
from aug3d_core.geometry.views import Points
from aug3d_core.needs.chosen import chosen_by
from aug3d_core.needs.decision import Decision
from aug3d_core.needs.ground import ground_of
from aug3d_core.needs.rows import needs_of
from aug3d_core.stages import STAGES
from aug3d_core.store import layout


def ground(tmp_path: Path, xyz: np.ndarray) -> Decision:
    Points(xyz=xyz, rgb=np.zeros((len(xyz), 3), np.uint8), error_px=np.zeros(len(xyz))).save(tmp_path / layout.POINTS)
    return ground_of(tmp_path)


def test_the_ground_is_told_as_stages_take_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    xyz = rng.uniform(-50, 50, (5000, 3)) * [1, 1, 0.001]
    assert ground(tmp_path, xyz).value == "level"
    assert ground(tmp_path, xyz + xyz[:, :1] * [0, 0, 0.2]).value == "tilted"
    few = ground(tmp_path, xyz[:3])
    assert few.value is None and "3 points" in few.measured, "it says why there is none"


def test_rows_come_in_the_order_of_the_steps_and_tell_who_decided(tmp_path: Path) -> None:
    decided = Decision(field="training.steps", value=628, measured="214,272 pixels", rule="1.5 rays for each")
    records = {name: record(name, metrics=metrics) for name, metrics in {
        "grouping": {"k": 15, "k_reason": "they overlap"}, "training": {"steps": 628, "stopped_by": "steps"},
    }.items()}  # fmt: skip
    made = [(Step(STAGES[name], fold), records[name], tmp_path) for fold in (0, 1) for name in records]
    rows = needs_of(made, {"training_fold1": (decided,)})
    assert [(row["fold"], row["by"]) for row in rows if row["field"] in ("training.steps", "grouping.k")] == [
        (0, "grouping"), (1, "grouping"), (1, "auto"),
    ]  # fmt: skip


def test_what_a_record_does_not_tell_is_no_choice() -> None:
    for stage in STAGES:
        assert not list(chosen_by(record(stage, metrics={}, config={}))), stage


def test_a_sweep_of_fewer_pairs_and_samples_says_what_it_saves() -> None:
    tried = {"pairs_tried": 563, "pairs_possible": 1770, "pairs_by": "gps", "photos": 60}
    [pairs] = chosen_by(record("matching", metrics=tried))
    assert pairs.value == "563 of 1,770, by gps" and pairs.saves == "68% of the comparisons"
    [samples] = chosen_by(
        record("rendering", metrics={"samples": 24, "samples_psnr_db": 40.2, "samples_reason": "fewest"})
    )
    assert samples.value == 24 and "81%" in samples.saves and "40.2 dB" in samples.measured
    [samples] = chosen_by(record("rendering", metrics={"samples": 4, "samples_reason": "as set"}))
    assert not samples.saves, "what is set is saved from nothing"


def test_photographs_worth_using_are_told_where_that_was_asked() -> None:
    thinned = record("photos", metrics={"photos": 60, "redundant": 240}, config={"least_motion": 0.05})
    [worth] = chosen_by(thinned)
    assert worth.value == "60 of 300" and worth.saves == "80% of the photographs"
    assert not list(chosen_by(record("photos", metrics={"photos": 60, "redundant": 0}, config={"least_motion": 0.0})))
