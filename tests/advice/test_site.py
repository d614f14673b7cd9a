"""What a flight is about, and how low nothing flies."""

from __future__ import annotations

import numpy as np
import pytest

from aug3d_core.advice.site import site_of
from aug3d_core.geometry.views import Views
from aug3d_core.run.errors import InputError
from tests.advice.flown_site import HIGH_M, PICTURE_M, ROOF_M, ground_points, mesh, site, views


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
    assert (flown[:, 2] >= roof_m + 15 - 1e-6).all()
    assert np.allclose(flown[:, 2], max(HIGH_M, roof_m + 15), atol=0.2)


def test_without_metres_the_margin_is_a_share_of_the_height() -> None:
    assert site(margin=None).floor == pytest.approx(ROOF_M + 0.2 * HIGH_M, abs=0.1)


def test_a_flight_that_never_looks_down_has_no_site() -> None:
    up = views()
    turned = up.cam_from_world.copy()
    turned[:, 1:3] *= -1  # about the camera's x axis: they look at the sky
    with pytest.raises(InputError, match="looks at the ground"):
        site_of(mesh(), Views(up.photo_id, turned, up.intrinsics, up.size), ground_points(), 15.0)
