"""What `aug3d bench advice` flies, and how it lays reconstructions over the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from aug3d_core.advice.plan import plan_of
from aug3d_core.bench.advice import MORE, Flown, _clearance, _gain, _ways, laid_over_truth
from aug3d_core.geometry.similarity import Similarity
from aug3d_core.geometry.transforms import centres, forward
from aug3d_core.town.config import TownConfig
from tests.advice.flown_site import mesh, views, write_scene


def flown() -> Flown:
    truth = views()
    photos = [Path(f"town_{i:04d}.jpg") for i in range(len(truth))]
    given = np.ones(len(truth), bool)
    return Flown(TownConfig(), truth, mesh(), photos, given, [], truth.cam_from_world[:0])


def test_every_way_takes_as_many_photographs_over_the_same_area_above_the_same_floor(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0), [], MORE, 15.0)
    ways = _ways(plan, flown(), np.random.default_rng(0))
    assert set(ways) == {"advice", "lines", "random"} and all(len(poses) == MORE for poses in ways.values())
    for name, poses in ways.items():
        at, looks = centres(poses), forward(poses)
        assert (at[:, 2] >= plan.site.floor - 1e-3).all(), name
        spots = at[:, :2] - looks[:, :2] / looks[:, 2:] * at[:, 2:]
        assert np.abs(spots).max() < 100, name
    # The town's own origin is at the height of the scene's
    assert _clearance(plan, flown()) == pytest.approx(
        centres(ways["advice"])[:, 2].min() - mesh().xyz[:, 2].max(), abs=0.01
    )
    assert len(np.unique(np.round(centres(ways["lines"]), 3), axis=0)) == MORE


def test_every_way_is_flown_where_it_is_on_earth_not_in_the_scene(tmp_path: Path) -> None:
    plan = plan_of(*write_scene(tmp_path, skipped_m=50.0), [], MORE, 15.0)
    assert plan.origin is not None
    raised = replace(plan, origin=plan.origin + np.array([0.0, 0.0, 10.0]))
    low, high = (_ways(one, flown(), np.random.default_rng(0)) for one in (plan, raised))
    for name in low:
        assert np.allclose(centres(high[name]) - centres(low[name]), [0, 0, 10], atol=0.02), name


def test_a_reconstruction_is_laid_over_the_truth_by_the_photographs_of_the_flight(tmp_path: Path) -> None:
    one, moved = flown(), Similarity(2.0, np.eye(3), np.array([5.0, -3.0, 1.0]))
    found = one.truth.take(np.arange(0, 60, 2))
    poses = moved.inverse().move_cameras(found.cam_from_world)
    poses[-1, :, 3] += 100.0  # a photograph that was taken later: nobody knows its true place
    type(found)(np.arange(30), poses, found.intrinsics, found.size).save(tmp_path / "views.npz")
    names = [one.photos[i].name for i in range(0, 58, 2)] + ["zz_more_000.jpg"]
    pd.DataFrame({"photo_id": range(30), "name": names}).to_parquet(tmp_path / "photos.parquet")
    back = laid_over_truth(tmp_path, tmp_path, one)
    assert back.scale == pytest.approx(2.0) and np.allclose(back.translation, moved.translation)


@pytest.mark.parametrize(
    ("advised_db", "other_db", "value", "holds"),
    [(1.0, 0.4, 2.5, True), (0.5, 0.4, 1.25, False), (-1.0, 0.4, -2.5, False)],
)
def test_advice_is_worth_twice_what_the_best_other_adds(
    advised_db: float, other_db: float, value: float, holds: bool
) -> None:
    found = _gain(advised_db, other_db)
    assert (found.value, found.unit, found.goal, found.holds) == (pytest.approx(value), "ratio", 2.0, holds)


@pytest.mark.parametrize("other_db", [-0.4, -0.1, 0.0])
@pytest.mark.parametrize(("advised_db", "holds"), [(0.5, True), (0.0, False), (-1.0, False)])
def test_where_the_best_other_adds_nothing_advice_is_worth_what_it_adds(
    advised_db: float, other_db: float, holds: bool
) -> None:
    found = _gain(advised_db, other_db)
    assert (found.value, found.goal, found.holds) == (advised_db, 0.0, holds) and found.unit.startswith("dB")
