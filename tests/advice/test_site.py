"""What a flight is about, and how low nothing flies."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.advice.site import HIGHER, site_of
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError
from tests.advice.flown_site import (
    HIGH_M,
    PICTURE_M,
    ROOF_M,
    ground_points,
    mesh,
    on_slope,
    site,
    tower,
    views,
    with_piece,
)


def test_height_and_picture_are_those_of_the_flight() -> None:
    assert site().height == pytest.approx(HIGH_M, abs=0.1) and site().picture == pytest.approx(PICTURE_M, rel=0.01)


@pytest.mark.parametrize("skipped_m", [0.0, 50.0])
def test_a_gap_belongs_to_the_flight_and_what_lies_beyond_does_not(skipped_m: float) -> None:
    area = site(skipped_m).area
    assert area.has(np.array([(0.0, 0), (75, 75), (-75, 75 + PICTURE_M * 0.2)])).all()
    assert not area.has(np.array([(75 + PICTURE_M * 0.3, 0), (0, -500), (1e6, 1e6)])).any()


def test_samples_lie_on_the_surface_and_in_its_hole() -> None:
    whole, holed = site(), site(hole=True)
    assert not whole.in_hole.any()
    there = holed.samples.xyz[holed.in_hole]
    assert np.abs(there[:, :2]).max() <= 31 and np.allclose(there[:, 2], 0, atol=0.1)
    assert len(there) * holed.area.cell**2 == pytest.approx(60 * 60, rel=0.1)
    assert len(holed.samples.xyz) == pytest.approx(len(whole.samples.xyz), rel=0.03), (
        "as dense in the hole as beside it"
    )


@pytest.mark.parametrize("roof_m", [ROOF_M, 55.0, 90.0])
def test_nothing_flies_below_the_margin_over_the_highest_roof(roof_m: float) -> None:
    flown = site(roof_m=roof_m).flown(np.random.default_rng(0).uniform(-75, 75, (50, 2)))
    assert np.allclose(flown[:, 2], max(HIGH_M, roof_m + 15), atol=0.2)


def test_on_a_slope_a_roof_counts_from_its_own_ground() -> None:
    """Else all photographs would be taken above that of the highest house, far above the ground further down."""
    rise, roof_m = 0.4, 70.0
    flown = site_of(*on_slope(rise, roof_m), 15.0).flown(np.random.default_rng(0).uniform(-75, 75, (50, 2)))
    above = flown[:, 2] - rise * flown[:, 0]
    far = np.abs(flown[:, :2] - 40).max(axis=1) > 10 + PICTURE_M
    assert np.allclose(above[far], roof_m + 15, atol=5.0) and far.any()
    assert (above > roof_m + 14).all()


@pytest.mark.parametrize("wide_m", [1.0, 3.0, 6.0, 12.0])
def test_a_tower_counts_however_narrow(wide_m: float) -> None:
    place = site_of(tower(wide_m, 0.0, 90.0), views(), ground_points(), 15.0)
    assert place.roof == pytest.approx(90.0)
    assert place.floor_at(np.array([[20.0, 20.0 + PICTURE_M / 2]])) >= 105 - 1e-6


@pytest.mark.parametrize("low_m", [40.0, -45.0])
def test_a_narrow_piece_that_hangs_loose_is_neither_roof_nor_ground(low_m: float) -> None:
    beside = np.array([(145.0, 0, low_m), (150, 0, low_m), (145, 5, low_m)])  # beyond the mesh, where rays meet it
    above = np.array([(-50.0, 0, 40), (-46, 0, 44), (-50, 4, 40)])
    one = np.array([(0, 1, 2)])
    place = site_of(with_piece(with_piece(mesh(), beside, one), above, one), views(), ground_points(), 15.0)
    assert place.roof == pytest.approx(ROOF_M) and place.area.lowest == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("rise", [0.0, 0.4])
def test_on_a_slope_the_flight_is_as_high_above_the_ground_as_on_the_level(rise: float) -> None:
    flown = site_of(*on_slope(rise), 15.0).flown(np.random.default_rng(0).uniform(-75, 75, (50, 2)), HIGHER)
    assert np.allclose(flown[:, 2] - rise * flown[:, 0], HIGHER * HIGH_M, atol=1.0)


def test_without_metres_the_margin_is_a_share_of_the_height() -> None:
    assert site(margin=None).floor == pytest.approx(ROOF_M + 0.2 * HIGH_M, abs=0.1)
    assert site(margin=None).floor_at(np.array([[40.0, 40.0]])) == pytest.approx(ROOF_M + 0.2 * HIGH_M, abs=0.1)


def test_a_flight_that_never_looks_down_has_no_site() -> None:
    up = views()
    turned = up.cam_from_world.copy()
    turned[:, 1:3] *= -1  # about the camera's x axis: they look at the sky
    with pytest.raises(InputError, match="looks at the ground"):
        site_of(mesh(), Views(up.photo_id, turned, up.intrinsics, up.size), ground_points(), 15.0)
