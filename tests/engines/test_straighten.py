"""A flight that a wrong lens bent is straightened by GPS, however that errs, or by the gimbal; a straight one is left alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pycolmap
import pytest

from aug3d_core.geometry.similarity import Similarity, fit_similarity
from aug3d_core.geometry.transforms import centres
from aug3d_core.sfm import export
from aug3d_core.sfm import straighten as module
from aug3d_core.sfm.doming import Doming
from aug3d_core.sfm.straighten import straighten
from tests.engines.test_control_adjustment import bend_m, flight

OFF_M = np.array([0.0, 0.0, 37.0])  # altitudes are above where the drone took off


def noisy(at: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return at + rng.normal(size=at.shape)


def arched(at: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Altitudes of a barometer that falls and rises again by 4 m: against them a straight flight has a bowl."""
    arch_m = 4 * np.linspace(-1, 1, len(at)) ** 2
    return at + rng.normal(size=at.shape) * 0.3 + np.outer(arch_m, [0, 0, 1])


def wandering(at: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    steps = rng.normal(size=at.shape) * 0.25
    return at + np.cumsum(steps, axis=0) + rng.normal(size=at.shape) * 0.1


def partly_wrong(at: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    wrong = noisy(at, rng)
    wrong[::9] += [60.0, -40.0, 25.0]
    return wrong


def exact(at: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return at


def to_gps(model: pycolmap.Reconstruction, gps_m: np.ndarray) -> Doming | None:
    known = np.isfinite(gps_m).all(axis=1)
    found = centres(export.poses(model))
    fit = fit_similarity(found[known], gps_m[known]) if known.sum() > 3 else Similarity(1.0, np.eye(3), np.zeros(3))
    return straighten(model, gps_m, fit, refine_focal_length=False)


Measured = Callable[[np.ndarray, np.random.Generator], np.ndarray]


@pytest.fixture
def turned_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cameras that tell nothing, so that all is left to GPS: the flight's are hung too well."""
    monkeypatch.setattr(module, "doming_by_gimbal", lambda poses: None)


@pytest.mark.usefixtures("turned_by_hand")
@pytest.mark.parametrize("measured", [noisy, arched, wandering, partly_wrong, exact])
def test_a_bent_flight_is_straightened_by_gps(measured: Measured) -> None:
    model, _, at = flight(-0.06, held=True)
    before_m, points = bend_m(model, at), model.num_points3D()
    bend = to_gps(model, measured(at, np.random.default_rng(5)) + OFF_M)
    assert bend is not None and bend.sure and bend.told_by == "GPS altitudes"
    assert bend_m(model, at) < 0.5 * before_m
    assert model.camera(1).model_name == "RADIAL" and model.camera(1).params[3] == pytest.approx(-0.06, abs=0.01)
    assert model.num_points3D() > 0.95 * points


@pytest.mark.parametrize("hung", [True, False])
@pytest.mark.parametrize("measured", [noisy, arched, wandering, partly_wrong])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_straight_flight_stays_straight(
    measured: Measured, seed: int, hung: bool, request: pytest.FixtureRequest
) -> None:
    if not hung:
        request.getfixturevalue("turned_by_hand")
    model, _, at = flight(-0.06, held=False, seed=seed)
    before, before_m = export.poses(model), bend_m(model, at)
    bend = to_gps(model, measured(at, np.random.default_rng(seed)) + OFF_M)
    if bend is None:
        assert np.array_equal(export.poses(model), before) and model.camera(1).model_name == "SIMPLE_RADIAL"
    else:  # so well hung that it tells what the noise of the photographs bends
        assert hung and abs(bend.pct) < 0.15 and bend_m(model, at) < before_m


@pytest.mark.usefixtures("turned_by_hand")
def test_positions_without_altitudes_bend_nothing() -> None:
    model, _, at = flight(-0.06, held=True)
    gps_m = at.copy()
    gps_m[:, 2] = np.nan
    assert to_gps(model, gps_m) is None


@pytest.mark.usefixtures("turned_by_hand")
def test_photographs_without_gps_are_straightened_by_the_others() -> None:
    model, _, at = flight(-0.06, held=True)
    gps_m, before_m = noisy(at, np.random.default_rng(5)), bend_m(model, at)
    gps_m[::3] = np.nan
    assert to_gps(model, gps_m) and bend_m(model, at) < 0.5 * before_m


def no_gps(at: np.ndarray) -> np.ndarray:
    return np.full_like(at, np.nan)


def test_a_bent_flight_without_gps_is_straightened_by_its_gimbal() -> None:
    model, _, at = flight(-0.06, held=True)
    before_m, points = bend_m(model, at), model.num_points3D()
    bend = to_gps(model, no_gps(at))
    assert bend is not None and bend.told_by == "roll and pitch of the cameras" and bend_m(model, at) < 0.1 * before_m
    assert model.camera(1).params[3] == pytest.approx(-0.06, abs=0.01) and model.num_points3D() > 0.95 * points


def test_what_gps_and_gimbal_do_not_agree_on_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    model, _, at = flight(-0.06, held=True)
    monkeypatch.setattr(module, "doming_by_gimbal", lambda poses: Doming(0.0, 0.1))
    assert to_gps(model, noisy(at, np.random.default_rng(5))) is None


@pytest.mark.parametrize("gone", [False, True])
def test_a_bend_that_photographs_contradict_is_left(gone: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gimbal feigns a bend of 3 %: they keep it, or it costs them their match."""
    model, _, at = flight(-0.06, held=False)
    feigned = iter([Doming(3.0, 0.1), Doming(0.0 if gone else 2.0, 0.1)])
    monkeypatch.setattr(module, "doming_by_gimbal", lambda poses: next(feigned))
    monkeypatch.setattr(module, "_AS_WELL", 0.5 if gone else 2.0)
    before = export.poses(model)
    assert to_gps(model, no_gps(at)) is None and np.array_equal(export.poses(model), before)
