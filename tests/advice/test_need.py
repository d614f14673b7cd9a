"""What a photograph counts for a view, and that a view takes only the few that are best for it."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.advice.choice import pose
from aug3d_core.advice.need import Look, Need, look_of, need_of, offers
from aug3d_core.geometry.views import Views
from tests.advice.flown_site import FOCAL_PX, HIGH_M, SIZE_PX, site, views

INTRINSICS = np.array([FOCAL_PX, FOCAL_PX, SIZE_PX[0] / 2, SIZE_PX[1] / 2])


def look(east_m: float, north_m: float = 0.0, high_m: float = HIGH_M, pitch_deg: float = -90.0) -> Look:
    camera = pose(np.array([east_m, north_m, high_m]), 0.0, pitch_deg)
    return look_of(site(), camera, INTRINSICS, np.array(SIZE_PX))


def need(flown: Views, *asked: Look, error: np.ndarray | None = None) -> Need:
    poses = zip(flown.cam_from_world, flown.intrinsics, flown.size, strict=True)
    error = np.ones(len(site().samples.xyz)) if error is None else error
    return need_of(asked, [look_of(site(), *one) for one in poses], error)


def nothing() -> Views:
    return views().take(np.zeros(0, int))


def test_without_photographs_all_is_missing_of_what_a_view_shows_and_the_rest_is_not_asked_for() -> None:
    view = look(0.0)
    found = need(nothing(), view)
    assert found.missing == pytest.approx(1.0)
    there = np.isfinite(found.missing_at())
    assert set(np.flatnonzero(there)) == set(view.sample) and (found.missing_at()[there] == 1).all()


def test_a_photograph_counts_less_the_farther_it_stands_and_the_higher() -> None:
    view = look(0.0)
    found = need(nothing(), view)
    [offer] = offers([view], [look(0.0), look(8.0), look(25.0), look(0.0, high_m=3 * HIGH_M), look(500.0)])
    assert offer.photo.tolist() == [0, 1, 2, 3], "one shows nothing of it"
    adds = found.added(0, offer)
    assert adds[0] > adds[1] > adds[2] > 0 and adds[0] > 2 * adds[3] > 0


def test_what_is_added_is_what_is_missing_less_and_a_view_takes_three() -> None:
    view = look(0.0)
    found, near = need(nothing(), view), [look(3.0), look(-3.0), look(0.0, 3.0), look(0.0, 9.0)]
    [offer] = offers([view], near)
    for taken in range(3):
        before, adds = found.missing, found.added(0, offer)[taken]
        found.take(0, offer.counts[taken])
        assert before - found.missing == pytest.approx(adds, rel=1e-3) and adds > 0.01
    assert found.added(0, offer)[3] == 0, "farther than all three"
    [closer] = offers([view], [look(0.0)])
    better = found.added(0, closer)[0]
    kept = found.missing
    found.take(0, closer.counts[0])
    assert kept - found.missing == pytest.approx(better, rel=1e-3) and better > 0


def test_a_view_is_predicted_from_the_photographs_that_are_best_for_it() -> None:
    flown = views()
    all_of_them, few = need(flown, look(2.0, 2.0)), need(flown.take(np.arange(0, len(flown), 7)), look(2.0, 2.0))
    assert 0 < all_of_them.missing < few.missing < 1
    at = np.abs(flown.cam_from_world[:, :2, 3]).max(axis=1)
    nearest = need(flown.take(np.argsort(at)[:9]), look(2.0, 2.0))
    assert nearest.missing == pytest.approx(all_of_them.missing, rel=0.02)


def test_a_view_of_where_the_model_errs_more_weighs_more() -> None:
    here, there = look(-60.0), look(60.0)
    error = np.where(site().samples.xyz[:, 0] < 0, 2.0, 0.5)
    found = need(nothing(), here, there, error=error)
    assert found.missing == pytest.approx(1.0)
    [at_here, at_there] = offers([here, there], [here, there])
    adds = found.added(0, at_here)[0], found.added(1, at_there)[0]
    assert adds[0] == pytest.approx(4 * adds[1], rel=0.05)
    found.take(0, at_here.counts[0])
    assert found.missing == pytest.approx(1.0 - adds[0] / 2.5, rel=1e-2)
