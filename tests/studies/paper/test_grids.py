"""The two grids hold the paper's tables, and arms differ in what they are called after alone."""

from __future__ import annotations

import pytest

from aug3d_core.factory.config import overridden, scene_config
from aug3d_core.studies.paper import augmentation, grouping
from aug3d_core.studies.paper.arm import PaperArm, PaperTable, fitting
from aug3d_core.studies.paper.augmentation import augmentation_table
from aug3d_core.studies.paper.grouping import grouping_table

STUDIES = [grouping_table(False), grouping_table(True), augmentation_table(False), augmentation_table(True)]


def by_key(study: PaperTable) -> dict[str, PaperArm]:
    return {arm.name: arm for arm in study.arms}


def test_every_way_of_grouping_at_every_k() -> None:
    arms = by_key(grouping_table(False))
    assert set(arms) == {
        f"{m}, K {k}" for m in ("sequence", "grid", "ray", "shared", "surface") for k in (20, 10, "auto")
    }
    assert all(arm.rendered_share == 0 for arm in arms.values()), "the paper's first table is of photographs alone"


def test_every_kind_of_data_at_every_k_and_a_sweep() -> None:
    arms = by_key(augmentation_table(False))
    kinds = ("real", "grid", "semantic", "real + grid", "real + semantic", "real + spiral")
    assert {f"{kind}, K {k}" for kind in kinds for k in (20, 10, "auto")} <= set(arms)
    assert {f"{share} % virtual" for share in (0, 25, 50, 100, 200)} <= set(arms)
    assert (
        arms["200 % virtual"].rendered_share == 2 and "training.rendered_share=0.6667" in arms["200 % virtual"].settings
    )
    assert "training.rendered_share=1" in arms["grid, K 10"].settings
    assert "sampling.method=buildings" in arms["real + semantic, K 10"].settings


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: f"{study.name}, {len(study.arms)} arms")
def test_arms_are_settings_that_there_are_and_comparisons_are_of_arms_that_there_are(study: PaperTable) -> None:
    judged = {arm.name: (20.0, 20.0) for arm in study.arms}
    arms = [*study.arms, *study.then(judged)]
    keys = [arm.name for arm in arms]
    assert len(set(keys)) == len(keys)
    for arm in arms:
        overridden(scene_config("tiny"), arm.settings)
        assert arm.against in keys
    for ordering in study.orderings:
        assert {key for pair in ordering.pairs for key in pair} <= set(keys), ordering.claim


def test_depth_is_left_out_where_the_model_is_taught_any() -> None:
    table = augmentation_table(False)
    swept, rays = (fitting(table, scene_config("tiny", [f"training.head={name}"])) for name in ("sweep", "pixelnerf"))
    dropped = {arm.name for arm in swept.arms} - {arm.name for arm in rays.arms}
    assert dropped == {f"{data}, no depth taught, K {k}" for data in ("real", "real + grid") for k in (20, 10)}
    assert swept == table and len(rays.orderings) == len(table.orderings) - 4
    grouped = grouping_table(False)
    assert fitting(grouped, scene_config("paper")) == grouped


def test_what_is_the_same_is_made_once() -> None:
    """Zero per cent of virtual views are the real photographs alone, and a hundred are real + grid."""
    arms = by_key(augmentation_table(False))
    for one, other in (("0 % virtual", "real, K 10"), ("100 % virtual", "real + grid, K 10")):
        configs = [overridden(scene_config("tiny"), arms[key].settings) for key in (one, other)]
        assert configs[0] == configs[1] and arms[one].rendered_share == arms[other].rendered_share


def test_more_inputs_go_to_the_best_that_leaves_a_target() -> None:
    study = grouping_table(False)
    judged = {"shared, K 10": (21.0, 10.0), "ray, K auto": (25.0, 7.0), "grid, K 20": (20.0, 20.0)}
    arms = study.then(judged)
    assert [arm.labels["inputs"] for arm in arms] == ["3", "6", "9"]
    assert all("grouping.method=shared" in arm.settings and "grouping.k=10" in arm.settings for arm in arms)
    assert "training.input_views=9" in arms[2].settings and "training.input_views=3" not in arms[2].settings
    assert study.then({"ray, K auto": (25.0, 9.0)}) == [], "nine inputs of nine members leave nothing to predict"


def test_the_papers_orderings_are_marked() -> None:
    papers = [o.claim for study in STUDIES[::2] for o in study.orderings if o.paper]
    assert any("shared points are better" in claim and "K 20" in claim for claim in papers)
    assert any(claim.startswith("K 10 is better than K 20 (shared)") for claim in papers)
    assert any(claim.startswith("Real + grid is better than real alone (K 20)") for claim in papers)
    assert grouping.key("shared", "20") == "shared, K 20" and augmentation.key("real", "20") == "real, K 20"
