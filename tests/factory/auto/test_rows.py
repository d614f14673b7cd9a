from __future__ import annotations

from pathlib import Path

import numpy as np

from aug3d_core.factory.auto.ground_kind import ground_of
from aug3d_core.factory.auto.rows import needs_of
from aug3d_core.factory.plan import Step
from aug3d_core.factory.stages import STAGES
from aug3d_core.geometry.views import Points
from aug3d_core.run.stage import Decision
from aug3d_core.sfm.files import POINTS
from tests.report.made_up_run import record


def ground(tmp_path: Path, xyz: np.ndarray) -> Decision:
    Points(xyz=xyz, rgb=np.zeros((len(xyz), 3), np.uint8), error_px=np.zeros(len(xyz))).save(tmp_path / POINTS)
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
    k = Decision(field="grouping.k", value=15, measured="31 training photographs", rule="they overlap")
    records = {"grouping": record("grouping", decisions=(k,)), "training": record("training")}
    made = [(Step(STAGES[name], fold), records[name], tmp_path) for fold in (0, 1) for name in records]
    rows = needs_of(made, {"training_fold1": (decided,)})
    assert [(row["fold"], row["by"]) for row in rows if row["field"] in ("training.steps", "grouping.k")] == [
        (0, "grouping"), (1, "grouping"), (1, "auto"),
    ]  # fmt: skip
    assert rows[0] == {"step": "grouping", "fold": 0, "by": "grouping", **k.model_dump()}
