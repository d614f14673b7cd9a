"""The light in the corners of made-up flights whose lens is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aug3d_core.sfm.falloff import Falloff, evened, fit_falloff, read_falloffs, write_falloffs

CORNER = 0.8
VIEWS, POINTS = 24, 1500


def flight(light=lambda s: np.ones_like(s), seed=0, views=VIEWS, points=POINTS, noise=0.03, exposures=0.3):
    """Return points, views, levels of grey, tangents off the axis: cameras over a plane, each with an exposure of its own."""
    rng = np.random.default_rng(seed)
    at = np.stack([np.arange(views) * 0.15, rng.uniform(-0.3, 0.3, views)], axis=1)
    ground = rng.uniform([-0.5, -0.6], [views * 0.15 + 0.5, 0.6], (points, 2))
    albedo, exposure = rng.uniform(60, 120, points), np.exp(rng.normal(0, exposures, views))
    view, point = np.nonzero((np.abs(ground - at[:, None]) < [0.64, 0.48]).all(axis=2))
    off_axis = np.linalg.norm(ground[point] - at[view], axis=1)
    grey = albedo[point] * exposure[view] * light((off_axis / CORNER) ** 2) * np.exp(rng.normal(0, noise, len(point)))
    return point, view, grey, off_axis


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize(("linear", "squared"), [(-0.1, 0.0), (-0.3, 0.1), (-0.2, -0.4), (-0.6, 0.2)])
def test_what_a_lens_loses_is_found_whatever_the_exposures(linear, squared, seed):
    found = fit_falloff(*flight(lambda s: np.exp(linear * s + squared * s**2), seed), CORNER)
    assert found is not None and found.evened
    assert found.corner_light == pytest.approx(np.exp(linear + squared), abs=0.02)
    for s in (0.2, 0.5, 0.8):
        true = linear * s + squared * s**2
        assert found.linear * s + found.squared * s**2 == pytest.approx(true, abs=0.02)
    assert abs(found.linear + found.squared - linear - squared) < 4 * found.sigma, "as sure as it says"


@pytest.mark.parametrize("seed", range(6))
def test_a_lens_that_loses_nothing_is_left_as_it_is(seed):
    found = fit_falloff(*flight(seed=seed, noise=0.1), CORNER)
    assert found is not None and not found.evened
    assert found.corner_light == pytest.approx(1, abs=0.03)


def test_brighter_corners_are_left_as_they_are():
    found = fit_falloff(*flight(lambda s: np.exp(0.2 * s)), CORNER)
    assert found is not None and found.corner_light > 1.1 and not found.evened


def test_a_loss_that_is_not_sure_is_left_as_it_is():
    found = fit_falloff(*flight(lambda s: np.exp(-0.04 * s), points=250, noise=0.5), CORNER)
    assert found is not None and found.sigma > 0.02 and not found.evened


def test_points_that_were_matched_wrongly_have_little_say():
    point, view, grey, off_axis = flight(lambda s: np.exp(-0.3 * s))
    rng = np.random.default_rng(1)
    wrong = rng.random(len(grey)) < 0.1
    grey[wrong] = rng.uniform(10, 240, wrong.sum())
    found = fit_falloff(point, view, grey, off_axis, CORNER)
    assert found is not None and found.corner_light == pytest.approx(np.exp(-0.3), abs=0.03)


def test_what_is_too_dark_or_too_bright_to_differ_has_no_say():
    point, view, grey, off_axis = flight(lambda s: np.exp(-0.3 * s), exposures=0.0)
    flat = np.random.default_rng(1).random(POINTS)[point] < 0.3
    grey[flat] = 255.0
    found = fit_falloff(point, view, grey, off_axis, CORNER)
    assert found is not None and found.corner_light == pytest.approx(np.exp(-0.3), abs=0.02)


def test_a_pixel_without_a_ray_has_no_say():
    point, view, grey, off_axis = flight(lambda s: np.exp(-0.3 * s))
    more = (np.append(values, values[:5]) for values in (point, view, grey))
    folded = np.append(off_axis, np.full(5, np.nan))
    assert fit_falloff(*more, folded, CORNER) == fit_falloff(point, view, grey, off_axis, CORNER)


def test_the_order_of_observations_has_no_say():
    told = flight(lambda s: np.exp(-0.3 * s))
    shuffled = np.random.default_rng(0).permutation(len(told[0]))
    assert fit_falloff(*told, CORNER) == fit_falloff(*(one[shuffled] for one in told), CORNER)


@pytest.mark.parametrize(("views", "points"), [(7, POINTS), (VIEWS, 20), (VIEWS, 0)])
def test_too_few_tell_nothing(views, points):
    assert fit_falloff(*flight(views=views, points=points), CORNER) is None


def test_a_photograph_is_evened_out_and_as_bright_as_it_was():
    falloff = Falloff(CORNER, -0.3, 0.1, 0.01)
    intrinsics = np.array([100.0, 100.0, 64.0, 48.0])
    y, x = np.mgrid[:96, :128] + 0.5
    s = (((x - 64) / 100) ** 2 + ((y - 48) / 100) ** 2) / CORNER**2
    assert s.max() == pytest.approx(1, abs=0.03)
    light = np.exp(-0.3 * s + 0.1 * s**2)
    photo = np.rint(150 * light)[..., None].repeat(3, axis=2).astype(np.uint8)
    gain = falloff.gain((128, 96), intrinsics)
    even = evened(photo, gain)
    assert even.std() < 0.5
    assert photo[0, 0, 0] < 0.83 * photo[48, 64, 0], "the corner was darker"
    grey = np.full((96, 128, 3), 100, np.uint8)
    assert (evened(grey, gain).astype(float) ** 2).mean() == pytest.approx(1e4, rel=0.01)
    assert evened(np.full((96, 128, 3), 255, np.uint8), gain)[0, 0].tolist() == [255] * 3, "not beyond white"


def test_falloffs_are_read_as_they_were_written(tmp_path: Path):
    falloffs = {1: Falloff(CORNER, -0.3, 0.1, 0.01), 3: None}
    write_falloffs(falloffs, tmp_path / "falloff.json")
    assert read_falloffs(tmp_path / "falloff.json") == falloffs
